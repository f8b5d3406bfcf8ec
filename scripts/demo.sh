#!/usr/bin/env bash
# A first touch: starts a server with a simulated hand and a client that sends it a scanned mesh over TCP, and prints the
# forces and contacts that the client received. Installs missing packages, builds hapticd, and runs for about ten seconds.
#   scripts/demo.sh [MESH]           another mesh (OBJ, STL, PLY, glTF) instead of the bunny
#   scripts/demo.sh --keep [MESH]    keeps the server running with the mesh in it, and prints the address of its page
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

# The page needs Node.js and packages from the npm registry; only --keep shows it. A build that has it keeps it.
web=OFF
if [ -n "$keep" ] || grep -qs '^HAPTICD_WEB:.*=ON' build/release/CMakeCache.txt; then web=ON; fi
scripts/install_packages.sh build $([ "$web" = OFF ] || echo viewer)
SECONDS=0
scripts/configure_programs.sh -DHAPTICD_WEB="$web" >/dev/null
cmake --build build/release --parallel "$(nproc)" --target hapticd
echo "the build took $SECONDS s"

program=build/release/bin/hapticd
log=build/demo.log
if [ -n "$keep" ]; then
  http=127.0.0.1:8080
  (exec 3<>/dev/tcp/127.0.0.1/8080) 2>/dev/null && http=127.0.0.1:0  # taken: any free port
  # setsid: the server outlives this script and its terminal.
  setsid "$program" serve --http "$http" </dev/null >"$log" 2>&1 &
else
  "$program" serve --listen 127.0.0.1:0 --http off --seconds 60 >"$log" 2>&1 &
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
  echo "The server is still running; its log is $log."
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
echo "log of the server:"
sed 's/^/  /' "$log"
exit "$status"
