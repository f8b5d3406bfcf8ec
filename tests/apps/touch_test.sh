#!/usr/bin/env bash
# The main job: a server with the scripted hand, a client that sends a scan over TCP and one over UDP, contact is felt.
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

for name in "Phantom@tcp://$address" "Phantom@$address"; do
  "$hapticd" touch "$source_dir/testdata/meshes/bunny.obj" --server "$name" --seconds 6 >"$work/out"
  cat "$work/out"
  awk '/peak force/ { if ($3 > 0.1) felt = 1 } END { exit !felt }' "$work/out"
done
kill -TERM "$server"
wait "$server"
grep -q 'ticks' "$work/log"
