#!/usr/bin/env bash
# The main job from two parts: a server with a simulated hand, and a client that sends it a real scan over TCP and watches
# what the hand feels. Installs what is missing, builds, runs for about ten seconds, prints what was felt, cleans up.
#   scripts/demo.sh [MESH]        another mesh (OBJ, STL, PLY, glTF) instead of the bunny
set -euo pipefail
cd "$(dirname "$0")/.."

mesh=${1:-testdata/meshes/bunny.obj}
scripts/install_packages.sh
cmake --preset release >/dev/null
cmake --build build/release --parallel "$(nproc)" --target hapticd

log=$(mktemp)
build/release/bin/hapticd serve --listen 127.0.0.1:0 --allow-no-rt --seconds 60 >"$log" 2>&1 &
server=$!
trap 'kill "$server" 2>/dev/null || true; wait "$server" 2>/dev/null || true; rm -f "$log"' EXIT

address=""
for _ in $(seq 100); do
  address=$(sed -nE 's/.*listening on ([0-9.]+:[0-9]+).*/\1/p' "$log" | head -1)
  [ -n "$address" ] && break
  kill -0 "$server" 2>/dev/null || break
  sleep 0.1
done
if [ -z "$address" ]; then
  echo "the server did not start:"
  cat "$log"
  exit 1
fi

status=0
build/release/bin/hapticd touch "$mesh" --server "Phantom@tcp://$address" --seconds 10 || status=$?

kill -TERM "$server"
wait "$server" || true
echo
echo "the server says:"
sed 's/^/  /' "$log"
exit "$status"
