#!/usr/bin/env bash
# bare-debian.sh SUITE FOLDER MIRROR [NAME]: a bare Debian system in FOLDER/NAME (SUITE), in place of what was there, with
# a clone of HEAD in /quasilpv. FOLDER/SUITE.tar keeps what debootstrap made, for the next time.
set -euo pipefail
cd "$(dirname "$0")/../.."
source tools/lib/say.sh

suite=$1 folder=$2 mirror=$3
system=$folder/${4:-$suite}

remove_system() {
  # Nothing is mounted there but by hand: removing through such a mount would empty a folder of this machine.
  if grep -qF " $system/" /proc/self/mountinfo; then die "$system: something is mounted in it, unmount it first"; fi
  rm -rf --one-file-system "$system"
}

# What this machine takes to reach the registries: name servers, proxies, certificates of its own.
keep_configuration() {
  local path kept=(/etc/resolv.conf /etc/pip.conf /etc/apt/apt.conf /etc/apt/auth.conf.d /usr/local/share/ca-certificates)
  mapfile -t -O "${#kept[@]}" kept < <(grep -lsE '^[[:space:]]*Acquire::(http|https|Check|Retries|Force)' /etc/apt/apt.conf.d/*)
  for path in "${kept[@]}"; do
    if [[ -e $path ]]; then
      mkdir -p "$system${path%/*}"
      cp -aL --no-target-directory "$path" "$system$path"
    fi
  done
  printf '127.0.0.1 localhost\n::1 localhost\n127.0.1.1 %s\n' "$(uname -n)" >"$system/etc/hosts"
}

remove_system
if [[ ! -f $folder/$suite.tar ]]; then
  say "debootstrap $suite from $mirror"
  debootstrap --variant=minbase "$suite" "$system" "$mirror"
  tar --directory "$system" --numeric-owner --create --file "$folder/$suite.tar.part" .
  mv "$folder/$suite.tar.part" "$folder/$suite.tar"
  remove_system
fi
mkdir "$system"
tar --directory "$system" --numeric-owner --extract --file "$folder/$suite.tar"
keep_configuration
git clone --quiet --no-hardlinks . "$system/quasilpv"
git -C "$system/quasilpv" log --oneline -1
