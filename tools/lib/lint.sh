#!/usr/bin/env bash
# Runs every quick linter over the tracked files, all of them even if one complains.
set -uo pipefail
cd "$(dirname "$0")/../.." || exit
git rev-parse --is-inside-work-tree || exit # without git there would be no files to look at

status=0
lint() {
  printf '== %s\n' "${*:1:3}"
  "$@" || status=1
}

mapfile -t cpp_files < <(git ls-files '*.cpp' '*.hpp')
mapfile -t pages < <(git ls-files '*.md' ':!docs/reference/benchmark-results.md') # generated
mapfile -t shell_files < <(git grep --files-with-matches --max-count=1 '^#!/usr/bin/env bash' -- tools .ci)

lint .venv/bin/ruff check .
lint .venv/bin/ruff format --check .
lint .venv/bin/mypy
lint .venv/bin/python tools/lib/prose.py "${pages[@]}"
lint .venv/bin/clang-format --dry-run -Werror "${cpp_files[@]}"
lint shellcheck --external-sources --check-sourced --source-path=. "${shell_files[@]}"
exit "$status"
