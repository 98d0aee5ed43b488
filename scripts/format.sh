#!/usr/bin/env bash
# Formats the project's C++ files in place; with --check only tells which are not formatted.
# One pinned version: others format differently.
set -euo pipefail
cd "$(dirname "$0")/.."

clang_format=clang-format-14
if ! command -v $clang_format >/dev/null; then
  echo "format.sh: $clang_format is not installed (scripts/setup.sh does it)" >&2
  exit 1
fi
mode=(-i)
[ "${1:-}" = --check ] && mode=(--dry-run --Werror)
find . \( -path './build*' -o -path './.?*' \) -prune -o \( -name '*.h' -o -name '*.cc' \) -print0 |
  xargs -0 -r $clang_format "${mode[@]}"
