# shellcheck shell=bash
# Sourced by tools/demo and tools/test: runs named phases with their output in build/log/<phase>.log, one line on the
# terminal each. `phase` stops the script when its command fails, `check` notes the failure and goes on, `finish` ends.
# A phase reaches the terminal through file descriptor 3 (tools/lib/say.sh).

log_dir=build/log
failed_checks=()
mkdir -p "$log_dir"

JOBS=${JOBS:-$(nproc)}
CMAKE_BUILD_PARALLEL_LEVEL=$JOBS
# Both test runners start one process per core: a threaded BLAS inside each would only oversubscribe the machine.
OPENBLAS_NUM_THREADS=1
export JOBS CMAKE_BUILD_PARALLEL_LEVEL OPENBLAS_NUM_THREADS

# run_logged NAME COMMAND...: prints name, outcome and elapsed time; on failure the tail of the log as well.
run_logged() {
  local name=$1 log=$log_dir/$1.log started=$SECONDS outcome=ok status=0
  shift
  if [[ -t 1 ]]; then printf '%-12s running, see %s\r' "$name" "$log"; fi
  PHASE=$name "$@" 3>&1 >"$log" 2>&1 </dev/null || status=$?
  if ((status != 0)); then outcome=FAILED; fi
  if [[ -t 1 ]]; then printf '\033[K'; fi
  printf '%-12s %-6s %4d s\n' "$name" "$outcome" "$((SECONDS - started))"
  if ((status != 0)); then
    printf '%s\n' "--- exit status $status; the last lines of $log:"
    tail -n 40 "$log"
    printf '%s\n' '---'
  fi
  return "$status"
}

phase() {
  if ! run_logged "$@"; then
    printf '%s: stopped in phase %s\n' "$0" "$1"
    exit 1
  fi
}

check() {
  run_logged "$@" || failed_checks+=("$1")
}

finish() {
  if ((${#failed_checks[@]} > 0)); then
    printf '%s: FAILED: %s (%d s)\n' "$0" "${failed_checks[*]}" "$SECONDS"
    exit 1
  fi
  printf '%s: ok (%d s)\n' "$0" "$SECONDS"
}
