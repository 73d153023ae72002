#!/usr/bin/env bash
# packages.sh LIST...: installs the Debian packages named in the lists (tools/packages/*.txt) that are not there yet.
set -euo pipefail
cd "$(dirname "$0")/../.."
source tools/lib/say.sh

if ! command -v dpkg-query >/dev/null; then
  say "not a Debian system: install what $* name by hand"
  exit 0
fi

missing=()
while read -r package; do
  status=$(dpkg-query -W -f='${db:Status-Status}\n' "$package" 2>/dev/null | head -n 1) || true
  if [[ $status != installed ]]; then missing+=("$package"); fi
done < <(sed -e 's/#.*//' -e 's/[[:space:]]//g' -e '/^$/d' "$@")

if ((${#missing[@]} == 0)); then exit 0; fi

as_root=()
if ((EUID != 0)); then
  command -v sudo >/dev/null || die "neither root nor sudo; ask an administrator for: apt-get install ${missing[*]}"
  as_root=(sudo)
fi
say "installing with apt-get: ${missing[*]}"
"${as_root[@]}" apt-get -q -o DPkg::Lock::Timeout=120 update
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
  apt-get -q -o DPkg::Lock::Timeout=120 install --yes --no-install-recommends "${missing[@]}"
