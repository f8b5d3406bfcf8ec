# For shell tests: a server with the simulated hand on a free port, until the test ends. Source it with $hapticd set, and
# $serve_options for more than a server without a page. Sets $work (a directory that is removed at the end; an existing $work is
# used), $server (the process id) and $address, and has the function await.
[ -v serve_options ] || serve_options=(--http off)
work=${work:-$(mktemp -d)}
export XDG_RUNTIME_DIR=$work # for its socket, which a server that is killed leaves
: >"$work/log" # so that it exists before the server writes to it
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
await() { # TEXT LOG: until the log in $work has the text; fails after 30 s
  for _ in $(seq 300); do
    grep -qF -- "$1" "$work/$2" && return
    sleep 0.1
  done
  cat "$work/$2"
  return 1
}
