#!/usr/bin/env bash
# Stop and re-arm from the command line while a scan is touched: the force is zero after a stop and returns after a re-arm.
set -euo pipefail
hapticd=$1
source_dir=$2
. "$(dirname "$0")/server.sh"

"$hapticd" stop "Phantom@$address" | grep -q 'forces are off'
"$hapticd" touch "$source_dir/testdata/meshes/bunny.obj" --server "Phantom@$address" --seconds 4 >"$work/stopped"
awk '/peak force/ { if ($3 != 0) force = 1 } END { exit force }' "$work/stopped" || { cat "$work/stopped"; exit 1; }
"$hapticd" stop --rearm "Phantom@tcp://$address" | grep -q 'forces ramp in'
"$hapticd" touch "$source_dir/testdata/meshes/bunny.obj" --server "Phantom@$address" --seconds 6 >"$work/rearmed"
awk '/peak force/ { if ($3 > 0.1) force = 1 } END { exit !force }' "$work/rearmed" || { cat "$work/rearmed"; exit 1; }
grep -q 'stops the forces' "$work/log"

# As touch and mark name the server: a stop does not fail at the word.
"$hapticd" stop --server "Phantom@tcp://$address" | grep -q 'forces are off'
"$hapticd" stop --rearm --server "Phantom@tcp://$address" | grep -q 'forces ramp in'
"$hapticd" watch --server "Phantom@tcp://$address" --seconds 0.2 | grep -q '^summary'
status=0
"$hapticd" stop "Phantom@tcp://$address" --server "Phantom@$address" >"$work/out" 2>&1 || status=$?
[ "$status" = 2 ] && grep -q 'more than once' "$work/out" || { cat "$work/out"; exit 1; }

status=0
"$hapticd" stop "Phantom@127.0.0.1:1" >"$work/out" 2>&1 || status=$?
[ "$status" = 1 ]

# Another server has the same port on another address: each stop and re-arm acts on the one that it names.
port=${address##*:}
"$hapticd" serve --listen "127.0.0.2:$port" --http off --allow-no-rt >"$work/other.log" 2>&1 &
other=$!
trap 'kill "$server" "$other" 2>/dev/null || true; rm -rf "$work"' EXIT
await 'listening on' other.log
stops() { grep -c 'stops the forces' "$work/$1" || true; }
before=$(stops log)
"$hapticd" stop "Phantom@127.0.0.2:$port" | grep -q 'forces are off'
[ "$(stops log)" = "$before" ]
[ "$(stops other.log)" = 1 ]
"$hapticd" stop "Phantom@127.0.0.1:$port" | grep -q 'forces are off'
[ "$(stops log)" = $((before + 1)) ]
[ "$(stops other.log)" = 1 ]

# The user of a server whose socket is elsewhere names it, as the refusal says.
printf 'socket = "%s/custom.sock"\n' "$work" >"$work/custom.toml"
"$hapticd" serve --config "$work/custom.toml" --listen 127.0.0.5:0 --http off --allow-no-rt >"$work/custom.log" 2>&1 &
custom=$!
trap 'kill "$server" "$other" "$custom" 2>/dev/null || true; rm -rf "$work"' EXIT
await 'listening on' custom.log
address=$(sed -nE 's/.*listening on ([0-9.:]+).*/\1/p' "$work/custom.log")
"$hapticd" stop "Phantom@$address" | grep -q "forces are off until an operator or the server's user re-arms"
status=0
"$hapticd" stop --rearm "Phantom@$address" >"$work/out" 2>&1 || status=$?
[ "$status" = 1 ] && grep -q "or the server's user on its machine: 'hapticd stop --rearm NAME@host', or NAME@unix:PATH if its socket is elsewhere" "$work/out" ||
  { cat "$work/out"; exit 1; }
"$hapticd" stop --help | grep -q 'NAME@unix:PATH'
"$hapticd" stop --rearm "Phantom@unix:$work/custom.sock" | grep -q 'forces ramp in'
kill "$custom"

# A replay has no force to stop, although the recording has a stop, which comes round again and again.
"$hapticd" serve --listen 127.0.0.3:0 --http off --allow-no-rt --record "$work/own.haptics" --seconds 4 >"$work/recorded.log" 2>&1 &
recorded=$!
trap 'kill "$server" "$other" "$recorded" 2>/dev/null || true; rm -rf "$work"' EXIT
await 'listening on' recorded.log
"$hapticd" stop "Phantom@$(sed -nE 's/.*listening on ([0-9.:]+).*/\1/p' "$work/recorded.log" | head -1)" | grep -q 'forces are off'
wait "$recorded"
"$hapticd" replay "$work/own.haptics" --loop --listen "127.0.0.3:$port" --http off >"$work/replay.log" 2>&1 &
replay=$!
trap 'kill "$server" "$other" "$replay" 2>/dev/null || true; rm -rf "$work"' EXIT
await 'listening on' replay.log
for _ in 1 2 3; do
  status=0
  "$hapticd" stop "Phantom@127.0.0.3:$port" >"$work/out" 2>&1 || status=$?
  [ "$status" = 1 ] && grep -q "Phantom@127.0.0.3:$port refused: .*Stop_Forces refused: this server replays a recording, which has no force" "$work/out" || { cat "$work/out"; exit 1; }
  ! grep -q 'forces are off' "$work/out"
  sleep 0.5
done

# On a full server, and with a token that is wrong: what is told is what became of the forces. Here the user of the server
# stops it, who needs no token.
printf '[limits]\nconnections = 1\n' >"$work/full.toml"
"$hapticd" serve --config "$work/full.toml" --listen 127.0.0.4:0 --http off --allow-no-rt >"$work/full.log" 2>&1 &
full=$!
trap 'kill "$server" "$other" "$replay" "$full" 2>/dev/null || true; rm -rf "$work"' EXIT
await 'listening on' full.log
port=$(sed -nE 's/.*listening on 127.0.0.4:([0-9]+).*/\1/p' "$work/full.log" | head -1)
"$hapticd" watch "Phantom@tcp://127.0.0.4:$port" --seconds 30 >"$work/watched" 2>&1 &
watch=$!
trap 'kill "$server" "$other" "$replay" "$full" "$watch" 2>/dev/null || true; rm -rf "$work"' EXIT
await 'connected from' full.log
"$hapticd" stop "Phantom@tcp://127.0.0.4:$port" >"$work/out" 2>&1 || { cat "$work/out" "$work/full.log"; exit 1; }
grep -q 'forces are off' "$work/out"
"$hapticd" stop --rearm "Phantom@127.0.0.4:$port" >"$work/out" 2>&1 || { cat "$work/out" "$work/full.log"; exit 1; }
grep -q 're-armed' "$work/out"
echo 0123456789abcdef0123456789abcdef >"$work/wrong"
chmod 600 "$work/wrong"
"$hapticd" stop "Phantom@127.0.0.4:$port" --token-file "$work/wrong" >"$work/out" 2>&1 || { cat "$work/out" "$work/full.log"; exit 1; }
grep -q 'forces are off' "$work/out"
grep -q 'Identify refused' "$work/out"
