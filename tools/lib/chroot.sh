#!/usr/bin/env bash
# chroot.sh SYSTEM COMMAND...: runs a command as root in the Debian system of that folder. What it mounts there and
# what it starts is in namespaces of its own: both end with it and with who called it, however they end, and the machine
# never sees the mounts.
#
# HOST_FOLDERS: pairs FOLDER:FOLDER_INSIDE, one a line, of folders of this machine that are there too.
set -euo pipefail

if [[ $1 != --inside ]]; then
  exec setpriv --pdeathsig KILL unshare --mount --pid --fork --kill-child -- "$0" --inside "$@"
fi
system=$2
shift 2

# A mount point, for its / to be one: what runs there may make systems and namespaces of its own (tools/wheels).
mount --bind "$system" "$system"
mount -t proc proc "$system/proc"
mount -t sysfs -o ro sysfs "$system/sys"
mount -t tmpfs -o mode=755 tmpfs "$system/dev"
for device in null zero full random urandom tty; do
  touch "$system/dev/$device"
  mount --bind "/dev/$device" "$system/dev/$device"
done
mkdir "$system/dev/pts" "$system/dev/shm"
mount -t devpts -o newinstance,ptmxmode=0666 devpts "$system/dev/pts"
mount -t tmpfs -o mode=1777 tmpfs "$system/dev/shm"
ln -s pts/ptmx "$system/dev/ptmx"
ln -s /proc/self/fd "$system/dev/fd"
for stream in 0:stdin 1:stdout 2:stderr; do ln -s "/proc/self/fd/${stream%:*}" "$system/dev/${stream#*:}"; done
while IFS=: read -r folder inside; do
  mkdir -p "$folder" "$system$inside"
  mount --bind "$folder" "$system$inside"
done < <(sed '/^$/d' <<<"${HOST_FOLDERS:-}")

# What the registries take to be reached through is kept of the environment, and nothing else.
environment=(HOME=/root LANG=C.UTF-8 "TERM=${TERM:-dumb}" PIP_CACHE_DIR=/var/cache/pip
  PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin)
for name in {http,https,ftp,no}_proxy {HTTP,HTTPS,FTP,NO}_PROXY \
  PIP_{INDEX_URL,EXTRA_INDEX_URL,TRUSTED_HOST,PROXY,CERT,DEFAULT_TIMEOUT}; do
  if [[ -n ${!name:-} ]]; then environment+=("$name=${!name}"); fi
done

# Not exec: the first process of a namespace has to stay, to wait for those whose parents are gone.
chroot "$system" /usr/bin/env --ignore-environment "${environment[@]}" "$@"
