# For tests in shell: a server on a port of its own, until the test ends. Source it with $hapticd and ${serve_options[@]} set. Gives
# $work (a directory that goes with the test), $server (the process) and $address.
work=${work:-$(mktemp -d)}
: >"$work/log"
"$hapticd" serve --listen 127.0.0.1:0 --allow-no-rt "${serve_options[@]}" >"$work/log" 2>&1 &
server=$!
trap 'kill "$server" 2>/dev/null || true; rm -rf "$work"' EXIT
address=""
for _ in $(seq 300); do
  address=$(sed -nE 's/.*listening on ([0-9.]+:[0-9]+).*/\1/p' "$work/log" | head -1)
  [ -n "$address" ] && break
  sleep 0.1
done
[ -n "$address" ] || { cat "$work/log"; exit 1; }
