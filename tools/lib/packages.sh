#!/usr/bin/env bash
# packages.sh LIST...: makes sure that what the lists (tools/packages/*.txt) name is there. On Debian 12 and 13 it
# installs the packages that are missing; elsewhere it names what is missing and fails. QUASILPV_PACKAGES=skip trusts
# that all is there.
#
# A line of a list is a package, `[codename]` if it is of that release only, what it is recognised by on systems with
# other package names (command:NAME, header:FILE or python:MODULE, with | between alternatives), and # its reason.
set -euo pipefail
cd "$(dirname "$0")/../.."
source tools/lib/say.sh

system() { # ID, VERSION_CODENAME, PRETTY_NAME: as os-release(5) has it
  # shellcheck source=/dev/null
  (source "${OS_RELEASE:-/etc/os-release}" 2>/dev/null && printf '%s' "${!1:-}") || true
}

suite=
if [[ $(system ID) == debian ]] && command -v dpkg-query >/dev/null && command -v apt-get >/dev/null; then
  case $(system VERSION_CODENAME) in bookworm | trixie) suite=$(system VERSION_CODENAME) ;; esac
fi

# lines: what the lists say, without comments, one package each.
lines() { sed -e 's/#.*//' -e '/^[[:space:]]*$/d' "$@"; }

# ---- Debian 12 and 13 -----------------------------------------------------------------------------------------------

install_packages() {
  local missing=() as_root=() package marks status
  while read -r package marks; do
    if [[ $marks == *\[* && $marks != *"[$suite]"* ]]; then continue; fi
    status=$(dpkg-query -W -f='${db:Status-Status}\n' "$package" 2>/dev/null | head -n 1) || true
    if [[ $status != installed ]]; then missing+=("$package"); fi
  done < <(lines "$@")
  if ((${#missing[@]} == 0)); then return; fi

  if ((EUID != 0)); then
    command -v sudo >/dev/null || die "neither root nor sudo; ask an administrator for: apt-get install ${missing[*]}"
    as_root=(sudo)
  fi
  say "installing with apt-get: ${missing[*]}"
  "${as_root[@]}" apt-get -q -o DPkg::Lock::Timeout=120 update
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
    apt-get -q -o DPkg::Lock::Timeout=120 install --yes --no-install-recommends "${missing[@]}"
}

# ---- any other system -----------------------------------------------------------------------------------------------

# include_folders: where compilers look here, one a line.
include_folders() {
  printf '%s\n' /usr/include /usr/local/include "/usr/include/$(uname -m)-linux-gnu"
  tr ':;' '\n' <<<"${CPATH:-}:${CPLUS_INCLUDE_PATH:-}:${CMAKE_INCLUDE_PATH:-}"
  tr ':;' '\n' <<<"${CMAKE_PREFIX_PATH:-}" | sed 's,.$,&/include,'
  "${PYTHON:-python3}" -c 'import sysconfig; print(sysconfig.get_path("include"))' 2>/dev/null || true
  clang -print-resource-dir 2>/dev/null | sed 's,$,/include,' || true
}

# is_there KIND:ALTERNATIVE|...
is_there() {
  local names name folder
  IFS='|' read -ra names <<<"${1#*:}"
  for name in "${names[@]}"; do
    case $1 in
      command:*) if command -v "$name" >/dev/null; then return 0; fi ;;
      python:*) if "${PYTHON:-python3}" -c "import $name" 2>/dev/null; then return 0; fi ;;
      header:*) for folder in "${folders[@]}"; do if [[ -e $folder/$name ]]; then return 0; fi; done ;;
    esac
  done
  return 1
}

name_missing() {
  local folders missing=() package mark
  mapfile -t folders < <(include_folders | sed '/^$/d')
  while read -r package mark; do
    if ! is_there "$mark"; then missing+=("$package (${mark#*:})"); fi
  done < <(lines "$@")
  if ((${#missing[@]} == 0)); then return; fi

  printf '%s: packages are installed on Debian 12 and 13 only. Missing here, by their Debian names:\n' \
    "$(system PRETTY_NAME | grep . || uname -s)" >&2
  printf '  %s\n' "${missing[@]}" >&2
  die "Install them, or set QUASILPV_PACKAGES=skip if they are there and were not seen."
}

case "${QUASILPV_PACKAGES:-}:$suite" in
  skip:*) say "not looked at: QUASILPV_PACKAGES=skip" ;;
  :) name_missing "$@" ;;
  :*) install_packages "$@" ;;
  *) die "QUASILPV_PACKAGES: got ${QUASILPV_PACKAGES}, expected skip or nothing" ;;
esac
