#!/usr/bin/env bash
# A recording as users make it: recorded, cut, re-rendered, changed, exported, replayed.
set -euo pipefail
hapticd=$1
source_dir=$2
work=$(mktemp -d)
stock=${VRPN_CLIENTS:-} # where VRPN's own client programs are
serve_options=(--http off --record "$work/my.haptics")
source "$source_dir/tests/apps/server.sh"

"$hapticd" record "Phantom@tcp://$address" "$work/heard.vrpn" --seconds 3 >/dev/null &
heard=$!
"$hapticd" record "Phantom@tcp://$address" "$work/heard.csv" --seconds 3 >/dev/null &
rows=$!
"$hapticd" touch "$source_dir/testdata/meshes/bunny.obj" --server "Phantom@tcp://$address" --seconds 4 >"$work/touch.txt"
wait "$heard"
wait "$rows"
"$hapticd" mark "n$(printf 'ä%.0s' $(seq 30))" --server "Phantom@tcp://$address" >/dev/null # a figure shows 40 bytes of it
[ "$(wc -l <"$work/heard.csv")" -gt 50 ]
cp "$work/my.haptics" "$work/live.haptics" # while it is written
for type in 'vrpn_Button States' 'hapticd Guard_State' 'vrpn_Tracker Pos_Quat' 'vrpn_ForceDevice Force'; do
  grep -qaF "$type" "$work/heard.vrpn" || { echo "no '$type' in the log of a client"; exit 1; }
done
kill -INT "$server"
wait "$server" || true
grep -q 'recorded [0-9]* ticks' "$work/log"

# The same forces.
"$hapticd" render --session "$work/my.haptics" --report "$work/same.html" --out "$work/same.csv" >"$work/same.txt"
grep -q 'ticks in every bit: all of them' "$work/same.txt"
awk -F, 'NR > 1 { if ($3 != $4 || $5 != $6) { print "line " NR ": " $0; exit 1 } touching += $5 > 0 } END { exit !(touching > 100) }' "$work/same.csv"
# A copy of a file that is still being written is read up to its last whole block, with a remark.
status=0
"$hapticd" render --session "$work/live.haptics" >"$work/live.txt" 2>"$work/live.err" || status=$?
[ "$status" = 3 ]
grep -q 'in every bit: all of them' "$work/live.txt"
grep -qE 'cut|no end' "$work/live.err"
# Other surfaces change forces, and the report shows it.
"$hapticd" render --session "$work/my.haptics" --stiffness 100 --report "$work/soft.html" >"$work/soft.txt"
grep -q 'changed     stiffness 100 N/m' "$work/soft.txt"
awk '/^force/ { exit !($4 > 0) }' "$work/soft.txt"
grep -q '<polyline class="now"' "$work/soft.html"

# Figures are XML, whatever the names.
cp "$work/my.haptics" "$work/"$'\xff.haptics'
"$hapticd" plot "$work/"$'\xff.haptics' --out "$work/my.svg" >/dev/null
iconv -f UTF-8 "$work/my.svg" >/dev/null
grep -q '>nä*</text>' "$work/my.svg"

# For other programs.
"$hapticd" export "$work/my.haptics" --to csv -o "$work/my.csv"
[ "$(wc -l <"$work/my.csv")" -gt 200 ]
[ "$(head -1 "$work/my.csv" | tr ',' '\n' | wc -l)" = "$(tail -1 "$work/my.csv" | tr ',' '\n' | wc -l)" ]
# Exports and client recordings are hands, as they are.
for hand in my heard; do
  "$hapticd" render --mesh "$source_dir/testdata/meshes/bunny.obj" --size-mm 73 --hand "$work/$hand.csv" --out "$work/felt.csv" --force >/dev/null 2>"$work/error.txt"
  [ ! -s "$work/error.txt" ] || { cat "$work/error.txt"; exit 1; }
done
"$hapticd" export "$work/my.haptics" --to vrpn -o "$work/my.vrpn"
for part in 'hapticd Marker' 'nääää'; do
  grep -qaF "$part" "$work/my.vrpn" || { echo "no '$part' in the log"; exit 1; }
done
"$hapticd" export "$work/my.haptics" --to mcap -o "$work/my.mcap"
[ "$(head -c 5 "$work/my.mcap" | tail -c 4)" = MCAP ]
if [ -n "$stock" ]; then
  for log in heard my; do
    timeout 10 stdbuf -oL "$stock/vrpn_print_devices" "Phantom@file://$work/$log.vrpn" >"$work/$log.txt" 2>&1 || true
    [ "$(grep -c 'Tracker.*sensor' "$work/$log.txt")" -gt 20 ] || { head "$work/$log.txt"; exit 1; }
  done
else
  echo "VRPN_CLIENTS is not set: no stock client opened the logs"
fi

# Replayed to clients.
"$hapticd" replay "$work/my.haptics" --port 0 --http off --loop >"$work/replay.log" 2>&1 &
replay=$!
trap 'kill "$replay" 2>/dev/null || true; rm -rf "$work"' EXIT
for _ in $(seq 300); do
  address=$(sed -nE 's/.*listening on ([0-9.]+:[0-9]+).*/\1/p' "$work/replay.log" | head -1)
  [ -n "$address" ] && break
  sleep 0.1
done
"$hapticd" watch "Phantom@tcp://$address" --csv --rate 1000 --seconds 4 >"$work/again.csv"
awk -F, 'NR == 1 { for (i = 1; i <= NF; i++) c[$i] = i; next } $c["depth_m"] > 0 { touching++ } END { exit !(touching > 50) }' "$work/again.csv"

# Errors are plain.
if "$hapticd" serve --listen 127.0.0.1:0 --record "$work/my.haptics" 2>"$work/error.txt" >/dev/null; then exit 1; fi
grep -q 'File exists; name another' "$work/error.txt"
if "$hapticd" render --session "$source_dir/README.md" 2>"$work/error.txt"; then exit 1; fi
grep -q 'is not a recording' "$work/error.txt"
if "$hapticd" record "Phantom@tcp://$address" "$work/x.haptics" 2>"$work/error.txt"; then exit 1; fi
grep -q 'hapticd serve --record' "$work/error.txt"

# A recording without ticks shows nothing.
header=$((12 + $(od -An -tu4 --endian=big -j12 -N4 "$work/my.haptics")))
head -c $((8 + header)) "$work/my.haptics" >"$work/none.haptics"
status=0
"$hapticd" render --session "$work/none.haptics" >/dev/null 2>"$work/error.txt" || status=$?
[ "$status" = 1 ]
grep -q 'no tick could be compared: the recording has none' "$work/error.txt"

# What fails leaves no file, and keeps one that it would have replaced.
mkdir "$work/kept"
kept=$work/kept/file
fails() {
  if "$hapticd" "$@" >/dev/null 2>"$work/error.txt"; then echo "did not fail: $*"; exit 1; fi
}
all_fail() {
  for to in csv mcap vrpn; do fails export "$source_dir/README.md" --to "$to" -o "$kept.$to" "$@"; done
  fails plot "$source_dir/README.md" -o "$kept.svg" "$@"
  fails plot "$work/none.haptics" -o "$kept.svg" "$@"
  fails render --session "$source_dir/README.md" --out "$kept.csv" --report "$kept.html" "$@"
  for type in csv mcap vrpn; do fails record Phantom@tcp://127.0.0.1:1 "$kept.$type" --seconds 1 "$@"; done
}
all_fail
[ -z "$(ls "$work/kept")" ] || { echo "left over:"; ls "$work/kept"; exit 1; }
for type in csv csv.json mcap mcap.json vrpn svg html; do echo good >"$kept.$type"; done
all_fail --force
[ "$(cat "$kept".* | sort | uniq -c | tr -s ' ')" = ' 7 good' ] || { echo "destroyed:"; grep -L '^good$' "$kept".*; exit 1; }
"$hapticd" export "$work/my.haptics" --to csv -o "$kept.csv" --force >/dev/null
cmp "$work/my.csv" "$kept.csv"
cmp "$work/my.csv.json" "$kept.csv.json"
[ -z "$(ls "$work/kept" | grep part)" ]
