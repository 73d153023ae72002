# shellcheck shell=bash
# Sourced by tools/demo and tools/test: runs named phases with their output in build/log/<phase>.log, one line on the
# terminal each. `plan` names the phases to come, `phase` stops the script when its command fails, `check` notes the
# failure and goes on, `finish` ends. A phase reaches the terminal through file descriptor 3 (tools/lib/say.sh).

log_dir=build/log
failed_checks=()
phases_left=()
mkdir -p "$log_dir"

JOBS=${JOBS:-$(nproc)}
CMAKE_BUILD_PARALLEL_LEVEL=$JOBS
# Both test runners start one process per core: a threaded BLAS inside each would only oversubscribe the machine.
OPENBLAS_NUM_THREADS=1
export JOBS CMAKE_BUILD_PARALLEL_LEVEL OPENBLAS_NUM_THREADS

# plan KIND NAME...: what will run. KIND tells apart runs that take a different time; the seconds of every phase are kept
# in $log_dir/seconds-KIND, one line each.
plan() {
  seconds_file=$log_dir/seconds-$1
  shift
  phases_left=("$@")
  touch "$seconds_file"
}

# left: the phases that have not begun, and how long they took the last time.
left() {
  local name seconds total=0 bound=about
  if ((${#phases_left[@]} == 0)); then return; fi
  for name in "${phases_left[@]}"; do
    seconds=$(sed -n "s/^$name //p" "$seconds_file")
    if [[ -n $seconds ]]; then total=$((total + seconds)); else bound='at least'; fi
  done
  printf '   left: %s' "${phases_left[*]}"
  if ((total > 0)); then printf ', %s %d min' "$bound" $(((total + 59) / 60)); fi
}

# begun NAME: takes it off the plan.
begun() {
  if [[ ${phases_left[0]:-} == "$1" ]]; then phases_left=("${phases_left[@]:1}"); fi
}

# took NAME SECONDS: keeps it for the next run.
took() {
  if [[ -z ${seconds_file:-} ]]; then return; fi
  { sed "/^$1 /d" "$seconds_file" && printf '%s %d\n' "$1" "$2"; } >"$seconds_file.new"
  mv "$seconds_file.new" "$seconds_file"
}

# watch_log NAME LOG: says now and then how far a phase has come, by the last [12%] or [3/45] in its log; on a terminal
# always in the same line. Ends with this shell, too.
watch_log() {
  local begun=$SECONDS every=300 end='\n' progress
  if [[ -t 1 ]]; then every=5 end='\r'; fi
  while sleep 5 >/dev/null 2>&1 && kill -0 $$; do
    if (((SECONDS - begun) % every >= 5)); then continue; fi
    progress=$(grep -oE '\[ *[0-9]+(%|/[0-9]+)\]' "$2" | tail -n 1) || true
    printf "%-12s running %d s %s, see %s$end" "$1" "$((SECONDS - begun))" "$progress" "$2"
  done
}

# run_logged NAME COMMAND...: prints name, outcome, elapsed time and what is left; on failure the tail of the log as well.
run_logged() {
  local name=$1 log=$log_dir/$1.log started=$SECONDS outcome=ok status=0
  shift
  begun "$name"
  : >"$log"
  watch_log "$name" "$log" &
  PHASE=$name "$@" 3>&1 >"$log" 2>&1 </dev/null || status=$?
  { kill $! && wait $!; } 2>/dev/null || true
  if ((status != 0)); then outcome=FAILED; else took "$name" "$((SECONDS - started))"; fi
  if [[ -t 1 ]]; then printf '\033[K'; fi
  printf '%-12s %-6s %4d s%s\n' "$name" "$outcome" "$((SECONDS - started))" "$(left)"
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
