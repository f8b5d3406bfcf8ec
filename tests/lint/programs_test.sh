#!/usr/bin/env bash
# programs_test.sh SOURCE COMPILER: the whole C++ programs of the pages compile against the public headers, without warnings.
set -euo pipefail
cd "$1"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
awk -v work="$work" '
  /^```cpp/ { text = ""; page = FILENAME; line = FNR; on = 1; next }
  /^```/ && on {
    on = 0
    sub(/.*\//, "", page)
    if (text ~ /int main\(/) printf "%s", text >(work "/" page "_" line ".cpp")
  }
  on { text = text $0 "\n" }' docs/*.md README.md
programs=("$work"/*.cpp)
[ "${#programs[@]}" -ge 2 ] || { echo "only ${#programs[@]} programs were found"; exit 1; }
for program in "${programs[@]}"; do
  "$2" -std=c++20 -Wall -Wextra -Werror -fsyntax-only -Iinclude "$program"
done
