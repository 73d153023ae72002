#!/usr/bin/env bash
# environment.sh [EXTRA...]: makes .venv and installs into it what pyproject.toml requires, with the extra `dev` and those
# that are named; does nothing when it did so for these requirements.
set -euo pipefail
cd "$(dirname "$0")/../.."
source tools/lib/say.sh

python=${PYTHON:-python3}
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
  die "$python is $("$python" -V); expected Python 3.11 or newer (set PYTHON to choose another)"

requirements=$("$python" tools/lib/requirements.py "$@")
state=$(printf '%s\n' "$("$python" -VV)" "$PWD" "$requirements")
stamp=.venv/.requirements
if [[ -f $stamp && $(<"$stamp") == "$state" ]] && .venv/bin/python -c ''; then exit 0; fi

if ! .venv/bin/python -m pip --version; then
  say "creating .venv with $("$python" -V)"
  "$python" -m venv --clear .venv
fi
mapfile -t packages <<<"$requirements"
say "installing with pip into .venv: ${packages[*]}"
.venv/bin/python -m pip install --disable-pip-version-check --progress-bar off "${packages[@]}"
printf '%s\n' "$state" >"$stamp"
