#!/usr/bin/env bash
# Runs every quick linter over the tracked files, all of them even if one complains.
set -uo pipefail
cd "$(dirname "$0")/../.." || exit

status=0
lint() {
  printf '== %s\n' "$*"
  "$@" || status=1
}

mapfile -t cpp_files < <(git ls-files '*.cpp' '*.hpp')
mapfile -t shell_files < <(git grep --files-with-matches --max-count=1 '^#!/usr/bin/env bash' -- tools .ci)

lint .venv/bin/ruff check .
lint .venv/bin/ruff format --check .
lint .venv/bin/mypy
lint clang-format --dry-run -Werror "${cpp_files[@]}"
lint shellcheck --external-sources --source-path=. "${shell_files[@]}"
exit "$status"
