#!/usr/bin/env bash
# What another client feels, as lines for programs and as a summary for people.
set -euo pipefail
hapticd=$1
source_dir=$2
work=$(mktemp -d)
"$hapticd" serve --listen 127.0.0.1:0 --allow-no-rt >"$work/log" 2>&1 &
server=$!
trap 'kill "$server" 2>/dev/null || true; rm -rf "$work"' EXIT
address=""
for _ in $(seq 300); do
  address=$(sed -nE 's/.*listening on ([0-9.]+:[0-9]+).*/\1/p' "$work/log" | head -1)
  [ -n "$address" ] && break
  sleep 0.1
done
[ -n "$address" ] || { cat "$work/log"; exit 1; }

"$hapticd" touch "$source_dir/testdata/meshes/bunny.obj" --server "Phantom@$address" --seconds 8 >"$work/touch" &
touch=$!
"$hapticd" watch "Phantom@$address" --csv --rate 200 --seconds 6 >"$work/csv"
wait "$touch"
# Every row has every column, ticks only grow, and something was felt.
awk -F, 'NR == 1 { columns = NF; next }
         NF != columns || $2 <= tick { print "row " NR ": " $0; bad = 1; exit }
         { tick = $2 } $13 * $13 + $14 * $14 + $15 * $15 > 0.01 { felt = 1 }
         END { exit bad || !felt || NR < 100 }' "$work/csv" || { tail -3 "$work/csv"; exit 1; }

"$hapticd" watch "Phantom@tcp://$address" --json --seconds 1 >"$work/json"
grep -qE '^\{"time_s":[0-9.]+,"tick":[0-9]+,.*"force_N":\[[^]]*\],.*\}$' "$work/json"
"$hapticd" watch "Phantom@tcp://$address" --seconds 2 | grep -q 'reports total'
