#!/usr/bin/env bash
# Fails when a file includes a room that its library does not name in DEPENDS (the arrows of docs/architecture.md),
# or when realtime code includes a header that can lock, block or print.
set -euo pipefail
cd "$(dirname "$0")/.."

declare -A deps          # library -> rooms it may include
declare -A library_of    # folder with a CMakeLists.txt -> its library

while IFS= read -r file; do
  # hapticd_library(NAME ... DEPENDS a b c ... LIBS|PRIVATE_LIBS|SOURCES ...): flattened to one line for each library.
  while read -r name rest; do
    library_of[$(dirname "$file")]=$name
    deps[$name]=" $rest "
  done < <(sed 's/#.*//' "$file" | tr '\n' ' ' | grep -o 'hapticd_library([^)]*)' |
           sed 's/hapticd_library(//; s/)//' |
           awk '{ keep = 0; out = $1
                  for (i = 2; i <= NF; i++) {
                    if ($i == "DEPENDS") { keep = 1; continue }
                    if ($i ~ /^(SOURCES|LIBS|PRIVATE_LIBS)$/) { keep = 0; continue }
                    if (keep) out = out " " $i
                  }
                  print out }')
done < <(find src -name CMakeLists.txt)

owner() {  # the library whose folder holds this path
  local dir
  dir=$(dirname "$1")
  while [ "$dir" != . ] && [ "$dir" != / ]; do
    if [ -n "${library_of[$dir]:-}" ]; then echo "${library_of[$dir]}"; return; fi
    dir=$(dirname "$dir")
  done
}

bad=0
while IFS=: read -r file line include; do
  target=$(echo "$include" | sed 's/.*"\(.*\)".*/\1/')
  [ -e "src/$target" ] || continue
  from=$(owner "$file")
  to=$(owner "src/$target")
  if [ "$from" != "$to" ] && [[ "${deps[$from]:-}" != *" $to "* ]]; then
    echo "$file:$line: '$from' may not include '$target' ('$to' is not in its DEPENDS)"
    bad=1
  fi
done < <(grep -rnE '^[[:space:]]*#include "' src --include='*.h' --include='*.cpp')

if grep -rnE '^[[:space:]]*#include <(mutex|shared_mutex|condition_variable|future|iostream|fstream|sstream|spdlog/.*|boost/.*)>' src/realtime; then
  echo "realtime code may not include the headers above: they lock, block or print"
  bad=1
fi
[ "$bad" = 0 ] && echo "includes: every arrow is a declared one"
exit "$bad"
