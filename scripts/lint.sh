#!/usr/bin/env bash
# Checks the sources without running them. Needs a configured build/release.
#   scripts/lint.sh            the format of all files, and --changed
#   scripts/lint.sh --changed  clang 19 and clang-tidy (.clang-tidy) on the sources changed since the last tag (or 20 commits), without
#                              precompiled headers; only the last 2 changed, so that it ends in half a minute
#   scripts/lint.sh --names    the names of all sources, in three minutes; needs a configured build/asan
#   scripts/lint.sh --tidy     clang-tidy on all sources; takes most of an hour
#   scripts/lint.sh --clang    compiles everything with clang 19, one source at a time
set -euo pipefail
cd "$(dirname "$0")/.."
kMostChanged=2
database=build/lint
jobs=${HAPTICD_LINT_JOBS:-$(nproc)}

# Writes compile_commands.json with one entry for each source, also where CMake compiles several as one file, and without
# precompiled headers.
write_database() {
  mkdir -p "$database"
  awk '
    function entry(file,   text) {
      if (file in written) return
      written[file] = 1
      text = command
      sub(/ -o [^ ]+ -c [^ ]+"?,?$/, "", text)
      printf "%s\n{%s,\n%s -c %s\",\n  \"file\": \"%s\"}", (count++ ? "," : "["), directory, text, file, file
    }
    /^  "directory"/ { directory = $0; sub(/,$/, "", directory) }
    /^  "command"/ {
      command = $0
      gsub(/ -Winvalid-pch| -include [^ ]*cmake_pch\.hxx/, "", command)
      gsub(/ -Wno-(restrict|stringop-overflow|subobject-linkage)| --param=[^ ]*/, "", command)  # of GCC
      sub(/ -Wall/, " -Wno-deprecated-declarations&", command)  # which the library of GCC uses
    }
    /^  "file"/ {
      file = $0; sub(/^  "file": "/, "", file); sub(/",?$/, "", file)
      if (file !~ /\/Unity\/unity_[0-9]+_cxx\.cxx$/) { if (file ~ /\.cpp$/) entry(file); next }
      while ((getline line < file) > 0) if (line ~ /^#include "/) { sub(/^#include "/, "", line); sub(/"$/, "", line); entry(line) }
      close(file)
    }
    END { print "\n]" }' build/release/compile_commands.json >"$database/compile_commands.json"
}

# Sources of the database below the folders that hold C++.
all_sources() { sed -nE "s|^  \"file\": \"$PWD/((src\|include\|apps\|bench\|tests\|fuzz\|examples)/.*)\"\}.*|\1|p" "$database/compile_commands.json"; }

changed_sources() {
  local since
  since=$(git describe --tags --abbrev=0 2>/dev/null || git rev-parse --verify -q HEAD~20 || git rev-parse HEAD)
  { git diff --name-only HEAD -- '*.cpp'; git log --pretty= --name-only --diff-filter=d "$since..HEAD" -- '*.cpp'; } |
    awk '!seen[$0]++' | grep -Fx -f <(all_sources) | head -n "$kMostChanged" || true
}

# tidy FILE...: fails on errors of clang and on what .clang-tidy makes an error; prints warnings.
tidy() {
  printf '%s\0' "$@" | xargs -0 -n 1 -P "$jobs" clang-tidy-19 -p "$database" --quiet 2>"$database/tidy.log" ||
    { echo "lint: clang-tidy found errors in the files above"; return 1; }
  echo "lint: clang-tidy found no error in $# files"
}

changed() {
  command -v clang-tidy-19 >/dev/null || { echo "lint: clang-tidy-19 is missing (packages.txt, section lint)"; exit 77; }
  write_database
  local files
  mapfile -t files < <(changed_sources)
  [ "${#files[@]}" -gt 0 ] || { echo "lint: no source has changed"; return 0; }
  tidy "${files[@]}"
}

# The build by clang compiles several sources as one file: each header is read a hundred times, not five hundred.
names() {
  sed -nE 's|^  "file": "(.*\.cxx)",?$|\1|p; s|^  "file": "(.*\.cpp)",?$|\1|p' build/asan/compile_commands.json |
    xargs -n 1 -P "$jobs" clang-tidy-19 -p build/asan --quiet --checks='-*,readability-identifier-naming' 2>build/asan/names.log ||
    { echo "lint: the names above are not as .clang-tidy asks"; return 1; }
  echo "lint: all names are as .clang-tidy asks"
}

case "${1:-}" in
  "")
    status=0
    scripts/format.sh --check || status=1
    changed || status=1
    exit "$status" ;;
  --changed) changed ;;
  --names) names ;;
  --tidy)
    write_database
    mapfile -t files < <(all_sources)
    tidy "${files[@]}" ;;
  --clang)
    cmake --preset clang >/dev/null
    cmake --build build/clang --parallel "$jobs" ;;
  *) sed -n '3,8s/^# *//p' "$0"; exit 2 ;;
esac
