#!/usr/bin/env bash
# build.sh [--with-tests]: builds the C++ tree in build/release and installs the package, editable, into .venv.
#
# One CMake tree serves both sides: scikit-build-core configures build/release (pyproject.toml, state "editable"),
# builds the extension quasilpv._runtime and the executables, and installs them into .venv; --with-tests then builds
# the rest of the same tree, tests and benchmarks. With nothing to do it takes about a second.
set -euo pipefail
cd "$(dirname "$0")/../.."

.venv/bin/python -m pip install --disable-pip-version-check --verbose --no-build-isolation --no-deps --editable .
if [[ ${1:-} == --with-tests ]]; then cmake --build build/release; fi
