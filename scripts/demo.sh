#!/usr/bin/env bash
# The main job from two parts: a server with a simulated hand, and a client that sends it a real scan over TCP and watches
# what the hand feels. Installs what is missing, builds, runs for about ten seconds, prints what was felt, cleans up.
#   scripts/demo.sh [MESH]           another mesh (OBJ, STL, PLY, glTF) instead of the bunny
#   scripts/demo.sh --keep [MESH]    leaves the server running with the mesh in it, and says where to see it in a browser
set -euo pipefail
cd "$(dirname "$0")/.."

keep=""
mesh=testdata/meshes/bunny.obj
for argument in "$@"; do
  case "$argument" in
    --keep) keep=yes ;;
    -*) sed -n '2,5s/^# *//p' "$0"; exit 2 ;;
    *) mesh=$argument ;;
  esac
done

scripts/install_packages.sh
cmake --preset release >/dev/null
cmake --build build/release --parallel "$(nproc)" --target hapticd

program=build/release/bin/hapticd
log=build/demo.log
if [ -n "$keep" ]; then
  http=127.0.0.1:8080
  (exec 3<>/dev/tcp/127.0.0.1/8080) 2>/dev/null && http=127.0.0.1:0  # somebody has it: any free port
  # setsid: it outlives this script and its terminal.
  setsid "$program" serve --http "$http" --allow-no-rt </dev/null >"$log" 2>&1 &
else
  "$program" serve --listen 127.0.0.1:0 --http off --allow-no-rt --seconds 60 >"$log" 2>&1 &
fi
server=$!
stop() { kill "$server" 2>/dev/null || true; wait "$server" 2>/dev/null || true; }
trap stop EXIT

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
"$program" touch "$mesh" --server "Phantom@tcp://$address" --seconds 10 || status=$?

if [ -n "$keep" ] && [ "$status" = 0 ]; then
  trap - EXIT
  echo
  echo "The server goes on; it writes to $log."
  echo "  see it:   open $(sed -nE 's/.*viewer: (http[^ ]+).*/\1/p' "$log" | head -1) in a browser, and drag the hand over the mesh"
  echo "  touch:    $program touch FILE --server Phantom@$address"
  echo "  watch:    $program watch Phantom@$address"
  echo "  stop it:  kill $server"
  exit 0
fi

kill -TERM "$server"
wait "$server" || true
trap - EXIT
echo
echo "the server says:"
sed 's/^/  /' "$log"
exit "$status"
