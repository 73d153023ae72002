#!/usr/bin/env bash
# try-wheel.sh DIST: installs the wheel for this Python from a folder, in a bare Debian, with pip alone, and uses it.
# What apt installs is Python itself; no compiler, no library. mypy reads a script against the installed package.
set -euo pipefail
project=$(realpath "$(dirname "$0")/../..")
dist=$1

apt-get -q update
DEBIAN_FRONTEND=noninteractive apt-get -q install --yes --no-install-recommends python3-venv
for command in cc gcc g++ cmake; do
  if command -v "$command"; then exit 1; fi
done
if ldconfig -p | grep -E 'libglib|liblcm|libsundials|libsodium'; then exit 1; fi

wheel=$(ls "$dist"/quasilpv-*-cp"$(python3 -c 'import sys; print(*sys.version_info[:2], sep="")')"-*.whl)
python3 -m venv "$HOME/quasilpv"
PATH=$HOME/quasilpv/bin:$PATH
cd "$HOME"
pip install --progress-bar off "$wheel"
python "$project/tools/lib/environment_size.py" "$project/docs/how-to/install.md"
design --version
for program in qlpv-controller qlpv-simulator; do "$program" --help >/dev/null; done
design demo -o demo
said=$(design view --log LAST 2>&1) && exit 1 # the extra is not there, and a line says so
[[ $said == *"pip install 'quasilpv[view]'"* ]]

pip install --progress-bar off "${wheel}[hil,view]"
design hil serial-square -o hil
design log info LAST

python3 -m venv "$HOME/mypy"
"$HOME/mypy/bin/pip" install --progress-bar off mypy
"$HOME/mypy/bin/mypy" --strict --python-executable "$HOME/quasilpv/bin/python" "$project/examples/typed.py"
python "$project/examples/typed.py"
