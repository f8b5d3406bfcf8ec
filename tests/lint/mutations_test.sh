#!/usr/bin/env bash
# mutations_test.sh SOURCE: the text that each entry of the lists of mutations changes stands in its file exactly once.
set -euo pipefail
cd "$1"
. scripts/mutations.sh
stale=0
for list in scripts/mutations.txt scripts/sim_mutations.txt; do
  while IFS= read -r name; do
    [[ -z $name || $name == [\#?]* ]] && continue
    read -r file
    IFS= read -r old
    IFS= read -r new
    [[ $old == -* && $new == +* ]] || { echo "$list: '$name' is not an entry"; exit 1; }
    if ! change_once "${old:1}" "${new:1}" "$file" >/dev/null; then
      echo "$list: '$name': not exactly once in $file: ${old:1}"
      stale=$((stale + 1))
    fi
  done <"$list"
done
[ "$stale" = 0 ]
