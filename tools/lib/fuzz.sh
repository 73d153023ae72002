#!/usr/bin/env bash
# fuzz.sh RUNS: builds the fuzzers of the decoders with clang and gives each RUNS inputs, grown from tests/fuzz/corpus,
# as many at a time as there are JOBS. A finding is left in build/fuzz, and the log of each fuzzer too.
set -euo pipefail
cd "$(dirname "$0")/../.."

runs=${1:?usage: fuzz.sh RUNS}
cmake --preset fuzz
cmake --build --preset fuzz

export runs
# shellcheck disable=SC2016 # expanded by the shell of each fuzzer
printf '%s\n' artifact_json artifact_cbor message | xargs -P "${JOBS:-1}" -I{} bash -euc '
  mkdir -p build/fuzz/grown/{}
  build/fuzz/tests/fuzz/{}_fuzz -runs="$runs" -max_len=8192 -timeout=20 -print_final_stats=1 \
    -artifact_prefix=build/fuzz/ build/fuzz/grown/{} tests/fuzz/corpus/{} >build/fuzz/{}.log 2>&1 || status=$?
  echo "== {}"
  tail -n 40 build/fuzz/{}.log
  exit "${status:-0}"'
