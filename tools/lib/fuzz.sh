#!/usr/bin/env bash
# fuzz.sh RUNS: builds the fuzzers of the decoders with clang and gives each RUNS inputs, grown from tests/fuzz/corpus.
# A finding ends it, and is left in build/fuzz.
set -euo pipefail
cd "$(dirname "$0")/../.."

runs=${1:?usage: fuzz.sh RUNS}
cmake --preset fuzz
cmake --build --preset fuzz
for decoder in artifact_json artifact_cbor message; do
  grown=build/fuzz/grown/$decoder
  mkdir -p "$grown"
  "build/fuzz/tests/fuzz/${decoder}_fuzz" -runs="$runs" -max_len=8192 -timeout=20 -print_final_stats=1 \
    -artifact_prefix=build/fuzz/ "$grown" "tests/fuzz/corpus/$decoder"
done
