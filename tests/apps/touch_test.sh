#!/usr/bin/env bash
# The main job: a server with the scripted hand, a client that sends a scan over TCP and one over UDP, contact is felt.
set -euo pipefail
hapticd=$1
source_dir=$2
. "$(dirname "$0")/server.sh"

for name in "Phantom@tcp://$address" "Phantom@$address"; do
  "$hapticd" touch "$source_dir/testdata/meshes/bunny.obj" --server "$name" --seconds 6 >"$work/out"
  cat "$work/out"
  awk '/peak force/ { if ($3 > 0.1) felt = 1 } END { exit !felt }' "$work/out"
done
kill -TERM "$server"
wait "$server"
grep -q 'ticks' "$work/log"
