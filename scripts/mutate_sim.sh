#!/usr/bin/env bash
# Makes the changes of scripts/sim_mutations.txt one at a time and requires hapticd-sim to find each within a minute of
# processor time.
#   scripts/mutate_sim.sh [--only PATTERN] [--cpu SECONDS]   the entries whose name matches; 60 s for each
# What a change leaves unused is no error. Works in a clone of the last commit, in MUTATE_WORK if that is set (kept for the next run), and prints a table.
set -euo pipefail
cd "$(dirname "$0")/.."
source_dir=$PWD
list=$source_dir/scripts/sim_mutations.txt
only=
cpu=60
while [ $# -gt 0 ]; do
  case "$1" in
    --only) only=${2:?"--only needs a pattern"}; shift ;;
    --cpu) cpu=${2:?"--cpu needs seconds"}; shift ;;
    *) sed -n '2,/^set/p' "$0" | sed '$d; s/^# \{0,1\}//'; exit 2 ;;
  esac
  shift
done
. scripts/mutations.sh
prepare_clone "$source_dir"

[ -e "$work/build/build.ninja" ] || (cd "$tree" && cmake --preset release -B "$work/build" -DHAPTICD_WEB=OFF -DHAPTICD_WERROR=OFF >/dev/null)
build_clone hapticd-sim || { tail -20 "$work/build.log"; exit 2; }

found=0 missed=0
while IFS= read -r name; do
  [[ -z $name || $name == \#* ]] && continue
  read -r file
  IFS= read -r old
  IFS= read -r new
  [[ $old == -* && $new == +* ]] || { echo "$list: '$name' is not an entry of four lines"; exit 2; }
  [[ -z $only || $name =~ $only ]] || continue
  change_once "${old:1}" "${new:1}" "$tree/$file" >"$work/changed" ||
    { echo "'$name': ${old:1} must stand in $file exactly once"; exit 2; }
  cp "$work/changed" "$tree/$file"
  if ! build_clone hapticd-sim; then
    result="does not compile"
    missed=$((missed + 1))
  else
    # A change can also end the process or make it run for ever.
    status=0
    timeout $((20 * cpu)) "$work/build/bin/hapticd-sim" --seeds 1-100000 --cpu "$cpu" --first >"$work/run.log" 2>&1 || status=$?
    if [ "$status" = 0 ]; then
      result="NOT FOUND"
      missed=$((missed + 1))
    else
      result="found: $({ grep -m1 'finding: ' "$work/run.log" || echo "exit status $status"; } | sed 's/ *finding: //' | cut -c1-110)"
      found=$((found + 1))
    fi
  fi
  echo "$name | $result | $(tail -1 "$work/run.log" 2>/dev/null | grep -oE '^[0-9.]+ s' || true)"
  git -C "$tree" checkout -q -- "$file"
done <"$list"
echo "$found found, $missed not"
[ "$missed" = 0 ]
