#!/usr/bin/env bash
# Formats the C++ sources with clang-format 14 and .clang-format.
#   scripts/format.sh            rewrites the files
#   scripts/format.sh --check    lists the files that differ, and fails if there are any
set -euo pipefail
cd "$(dirname "$0")/.."
find src include apps bench tests fuzz examples \( -name '*.h' -o -name '*.cpp' \) -print0 >build/format.files
command -v clang-format-14 >/dev/null || { echo "format: clang-format-14 is missing (packages.txt, section lint)"; exit 77; }
case "${1:-}" in
  "") xargs -0 clang-format-14 -i <build/format.files ;;
  --check)
    if xargs -0 -n 32 -P "$(nproc)" clang-format-14 --dry-run --Werror <build/format.files 2>build/format.log; then
      echo "format: all files are as clang-format writes them"
    else
      sed -nE 's/^([^:]+):[0-9]+:[0-9]+: error: .*/\1/p' build/format.log | sort | uniq -c
      echo "format: the files above differ; scripts/format.sh formats them"
      exit 1
    fi ;;
  *) sed -n '2,4s/^# *//p' "$0"; exit 2 ;;
esac
