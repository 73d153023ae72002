# shellcheck shell=bash
# Sourced by the phases: `say` speaks to the person at the terminal even though the phase's output goes to its log.

if ! { true >&3; } 2>/dev/null; then exec 3>&1; fi

say() {
  printf '%-12s %s\n' "${PHASE:-}" "$*" >&3
  printf '%s\n' "$*"
}

die() {
  printf '%s\n' "$*" >&2
  exit 1
}
