#!/usr/bin/env bash
# preset.sh PRESET: configures, builds and tests the C++ side with one preset of CMakePresets.json.
set -euo pipefail
cd "$(dirname "$0")/../.."

cmake --preset "$1"
cmake --build --preset "$1"
ctest --preset "$1" -j "$JOBS" --no-tests=error
