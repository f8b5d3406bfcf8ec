#!/usr/bin/env bash
# End to end: a server with the scripted hand gets a scan from a client over TCP and from one over UDP; both report contact.
set -euo pipefail
hapticd=$1
source_dir=$2
. "$(dirname "$0")/server.sh"

for name in "Phantom@tcp://$address" "Phantom@$address"; do
  "$hapticd" touch "$source_dir/testdata/meshes/bunny.obj" --server "$name" --seconds 6 >"$work/out"
  cat "$work/out"
  awk '/peak force/ { if ($3 > 0.1) force = 1 } END { exit !force }' "$work/out"
done
kill -TERM "$server"
wait "$server"
grep -q 'ticks' "$work/log"
