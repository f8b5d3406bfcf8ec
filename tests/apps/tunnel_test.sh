#!/usr/bin/env bash
# A server that asks for TLS: a client without it is refused, one through the tunnel touches a scan, with the token that the
# tunnel presents for it. No token appears in a log.
set -euo pipefail
hapticd=$1
source_dir=$2
work=$(mktemp -d)
token=0123456789abcdef-secret
(umask 077 && printf 'owner %s\n' "$token" >"$work/tokens" && printf '%s\n' "$token" >"$work/token")
cat >"$work/server.toml" <<TOML
listen = "127.0.0.1:0"
http = "off"
allow_no_rt = true
tls = "generated"
tls_loopback = true
tokens = "$work/tokens"
socket = "$work/server.sock"
TOML
"$hapticd" serve --config "$work/server.toml" >"$work/log" 2>&1 &
server=$!
tunnel=
observers=
trap 'kill $server $tunnel $observers 2>/dev/null || true; rm -rf "$work"' EXIT
await() {  # FILE PATTERN: prints what the pattern captures
  local found
  for _ in $(seq 300); do
    found=$(sed -nE "s/.*$2.*/\1/p" "$1" | head -1)
    [ -n "$found" ] && { echo "$found"; return; }
    sleep 0.1
  done
  cat "$1" >&2
  return 1
}
address=$(await "$work/log" 'listening on ([0-9.]+:[0-9]+)')
fingerprint=$(await "$work/log" 'SHA-256 ([0-9A-F:]{95})')
refused() {
  local status=0
  "$@" >"$work/out" 2>&1 || status=$?
  [ "$status" = 1 ] || { echo "status $status of $*"; cat "$work/out"; exit 1; }
}
refused "$hapticd" stop "Phantom@tcp://$address"
grep -q "before it answered; a server that asks for TLS needs 'hapticd tunnel'" "$work/out" || { cat "$work/out"; exit 1; }
# A token crosses no network in clear text; this address is nobody's.
refused timeout 5 "$hapticd" stop "Phantom@tcp://192.0.2.1" --token-file "$work/token"
grep -q 'would cross the network to 192.0.2.1:3883 unencrypted' "$work/out" || { cat "$work/out"; exit 1; }
refused "$hapticd" tunnel "$address"
grep -q 'give --fingerprint' -i "$work/out"
chmod 0644 "$work/token"
refused "$hapticd" tunnel "$address" --fingerprint "$fingerprint" --token-file "$work/token"
grep -q 'chmod 0600' "$work/out"
chmod 0600 "$work/token"
refused timeout 20 "$hapticd" tunnel "$address" --port 0 --fingerprint "$(tr 0-9A-F 1-9A-F0 <<<"$fingerprint")"
grep -q "another certificate, with the fingerprint $fingerprint" "$work/out" || { cat "$work/out"; exit 1; }
refused timeout 20 "$hapticd" tunnel 127.0.0.1:1 --port 0 --fingerprint "$fingerprint"
grep -q 'cannot connect' "$work/out" || { cat "$work/out"; exit 1; }
printf 'eightabc\n' >"$work/short"
chmod 0600 "$work/short"
refused "$hapticd" tunnel "$address" --fingerprint "$fingerprint" --token-file "$work/short"
grep -q "the token in '$work/short' has 8 characters" "$work/out" || { cat "$work/out"; exit 1; }

"$hapticd" tunnel "$address" --port 0 --fingerprint "$fingerprint" --token-file "$work/token" >"$work/tunnel" 2>&1 &
tunnel=$!
local=$(await "$work/tunnel" 'tcp:\/\/([0-9.]+:[0-9]+);')
"$hapticd" touch "$source_dir/testdata/meshes/bunny.obj" --server "Phantom@tcp://$local" --seconds 4 >"$work/out"
awk '/peak force/ { if ($3 > 0.1) force = 1 } END { exit !force }' "$work/out" || { cat "$work/out" "$work/log"; exit 1; }

# A client without a role hears why.
"$hapticd" tunnel "$address" --port 0 --fingerprint "$fingerprint" >"$work/observers" 2>&1 &
observers=$!
refused "$hapticd" record "Phantom@$(await "$work/observers" '(tcp:\/\/[0-9.]+:[0-9]+);')" --server --detach
grep -q ': Recording_Control refused: ' "$work/out" || { cat "$work/out"; exit 1; }

# A call-back client is refused in words.
refused timeout 10 "$hapticd" stop "Phantom@$local"
grep -q 'carries tcp:// only' "$work/tunnel" || { cat "$work/tunnel"; exit 1; }

# It ends as the other commands do that run until they are told to.
kill "$observers"
wait "$observers"

# A server without TLS is called so.
"$hapticd" serve --listen 127.0.0.1:0 --http off --allow-no-rt >"$work/plain" 2>&1 &
plain=$!
trap 'kill $server $tunnel $plain 2>/dev/null || true; rm -rf "$work"' EXIT
refused timeout 20 "$hapticd" tunnel "$(await "$work/plain" 'listening on ([0-9.]+:[0-9]+)')" --port 0 --fingerprint "$fingerprint"
grep -q 'the peer speaks no TLS' "$work/out" || { cat "$work/out"; exit 1; }
kill "$plain"

# Behind a tunnel that does not reach its server, the tunnel is not what is missing.
"$hapticd" tunnel "unix:$work/server.sock" --port 0 >"$work/nowhere" 2>&1 &
nowhere=$!
trap 'kill $server $tunnel $nowhere 2>/dev/null || true; rm -rf "$work"' EXIT
behind=$(await "$work/nowhere" '(tcp:\/\/[0-9.]+:[0-9]+);')
mv "$work/server.sock" "$work/moved.sock"
refused "$hapticd" stop "Phantom@$behind"
grep -q "needs 'hapticd tunnel', and a tunnel prints why it reaches no server" "$work/out" || { cat "$work/out"; exit 1; }
for _ in 1 2 3; do refused "$hapticd" stop "Phantom@$behind"; done
[ "$(grep -c '^hapticd: client disconnected: .*server.sock: No such file' "$work/nowhere")" = 1 ] || { cat "$work/nowhere"; exit 1; }
mv "$work/moved.sock" "$work/server.sock"

# Without the token, the Unix socket of this user is the owner's.
"$hapticd" stop "Phantom@unix:$work/server.sock" | grep -q 'forces are off'
"$hapticd" stop --rearm "Phantom@unix:$work/server.sock" | grep -q 'forces ramp in'
! grep -q "$token" "$work/log" "$work/tunnel" || { echo "a token in a log"; exit 1; }

# A server is looked for at the address that its name has now: this one has all of 127.0.0.0/8.
private=(unshare --user --map-root-user --mount sh -c 'mount --bind "$1" /etc/hosts && shift && exec "$@"' sh "$work/hosts")
echo "127.0.0.1 lab.example" >"$work/hosts"
if "${private[@]}" true 2>/dev/null; then
  kill "$server" "$tunnel"
  wait "$server"
  sed -i 's/127.0.0.1:0/0.0.0.0:0/' "$work/server.toml"
  "$hapticd" serve --config "$work/server.toml" >"$work/everywhere" 2>&1 &
  server=$!
  port=$(await "$work/everywhere" 'listening on [0-9.]+:([0-9]+)')
  fingerprint=$(await "$work/everywhere" 'SHA-256 ([0-9A-F:]{95})')
  "${private[@]}" "$hapticd" tunnel "lab.example:$port" --port 0 --fingerprint "$fingerprint" --token-file "$work/token" >"$work/roaming" 2>&1 &
  tunnel=$!
  roaming=$(await "$work/roaming" '(tcp:\/\/[0-9.]+:[0-9]+);')
  "$hapticd" stop "Phantom@$roaming" >/dev/null
  there=$(printf '0200007F:%04X' "$port")
  ! grep -q "$there" /proc/net/tcp || exit 1
  echo "127.0.0.2 lab.example" >"$work/hosts"
  for _ in $(seq 100); do
    "$hapticd" stop "Phantom@$roaming" >/dev/null
    ! grep -q "$there" /proc/net/tcp || break
  done
  grep -q "$there" /proc/net/tcp || { cat "$work/roaming"; exit 1; }
fi
