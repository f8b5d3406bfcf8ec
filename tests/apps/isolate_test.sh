#!/usr/bin/env bash
# A driver in its own process, with a mock of the vendor's library: when that process is killed, the server continues
# and logs the reason.
set -euo pipefail
hapticd=$1
export HAPTICD_HDAPI_LIB=$3
work=$(mktemp -d)
: >"$work/log"
"$hapticd" serve --listen 127.0.0.1:0 --http off --device openhaptics --isolate --enable-forces --allow-no-rt --seconds 60 >"$work/log" 2>&1 &
server=$!
trap 'kill "$server" 2>/dev/null || true; rm -rf "$work"' EXIT

# until COMMAND...: waits for it to succeed.
until_ok() {
  for _ in $(seq 300); do
    "$@" >/dev/null 2>&1 && return 0
    sleep 0.1
  done
  cat "$work/log"
  return 1
}

until_ok grep -q 'listening on' "$work/log"
until_ok pgrep -P "$server" -f device-host
pkill -KILL -P "$server" -f device-host
until_ok grep -q "device 'Phantom': .*driver's process" "$work/log"
kill -0 "$server"
kill -TERM "$server"
wait "$server"
grep -q 'ticks' "$work/log"
