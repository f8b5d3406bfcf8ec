#!/usr/bin/env bash
# Recordings of a server that several programs begin and end.
set -euo pipefail
hapticd=$1
source_dir=$2
work=$(mktemp -d)
printf 'socket = "%s/server.sock"\n' "$work" >"$work/server.toml"
serve_options=(--http off --config "$work/server.toml")
cd "$work" # where the server writes them
. "$source_dir/tests/apps/server.sh"

ends() { # ends STATUS PID FILE
  local status=0
  wait "$2" || status=$?
  [ "$status" = "$1" ] || { cat "$3"; echo "status $status"; exit 1; }
}

# One that another program ends: the first one learns of it, and does not end what is recorded then. Shorter than wanted: an error.
for seconds in 0 1000; do
  "$hapticd" record "Phantom@tcp://$address" --server "a$seconds.haptics" --seconds "$seconds" >first 2>&1 &
  first=$!
  await "recording to a$seconds.haptics" first
  "$hapticd" record "Phantom@tcp://$address" --server --end >second
  grep -q "recorded .* in a$seconds.haptics" second || { cat second; exit 1; }
  "$hapticd" record "Phantom@tcp://$address" --server "b$seconds.haptics" --detach >/dev/null
  await 'another client ended it: recorded ' first
  ends $((seconds > 0)) "$first" first
  "$hapticd" record "Phantom@tcp://$address" --server --end >second
  grep -q "recorded .* in b$seconds.haptics" second || { cat second; exit 1; }
done

# A connection that breaks does not end it, and the program says how to.
"$hapticd" tunnel "unix:$work/server.sock" --port 0 >tunnel 2>&1 &
tunnel=$!
await 'tcp://' tunnel
local=$(sed -nE 's/.*tcp:\/\/([0-9.]+:[0-9]+);.*/\1/p' tunnel)
"$hapticd" record "Phantom@tcp://$local" --server c.haptics >lost 2>&1 &
lost=$!
await 'recording to c.haptics' lost
kill "$tunnel"
ends 1 "$lost" lost
grep -q "the server records on .*'hapticd record Phantom@tcp://$local --server --end'" lost || { cat lost; exit 1; }
"$hapticd" record "Phantom@tcp://$address" --server --end >second
grep -q 'recorded .* in c.haptics' second || { cat second; exit 1; }
