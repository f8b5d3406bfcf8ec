# For tests in shell: a server with the simulated hand, on a port of its own, until the test ends. Source it with
# $hapticd set. Gives $work (a directory that goes with the test, its own if it has one), $server (the process) and
# $address.
work=${work:-$(mktemp -d)}
: >"$work/log" # there from the start, however late the server is
"$hapticd" serve --listen 127.0.0.1:0 --http off --allow-no-rt >"$work/log" 2>&1 &
server=$!
trap 'kill "$server" 2>/dev/null || true; rm -rf "$work"' EXIT
address=""
for _ in $(seq 300); do
  address=$(sed -nE 's/.*listening on ([0-9.]+:[0-9]+).*/\1/p' "$work/log" | head -1)
  [ -n "$address" ] && break
  sleep 0.1
done
[ -n "$address" ] || { cat "$work/log"; exit 1; }
