#!/usr/bin/env bash
# Commands for a server whose device has a fault, here an Inverse3 whose service has ended: what it says of the device is
# no refusal.
set -euo pipefail
hapticd=$1
source_dir=$2
. "$(dirname "$0")/server.sh"

# On another address, the port of the server above is free.
inverse3=127.0.0.9:${address##*:}
printf '[compat]\nhaply = "%s"\n' "$inverse3" >"$work/service.toml"
"$hapticd" serve --config "$work/service.toml" --listen 127.0.0.2:0 --http off --allow-no-rt >"$work/service.log" 2>&1 &
service=$!
trap 'kill "$server" "$service" 2>/dev/null || true; rm -rf "$work"' EXIT
await 'listening on' service.log
export XDG_STATE_HOME=$work
"$hapticd" serve --device "haply:$inverse3" --listen 127.0.0.3:0 --http off --allow-no-rt --record "$work/felt.haptics" >"$work/device.log" 2>&1 &
device=$!
trap 'kill "$server" "$service" "$device" 2>/dev/null || true; rm -rf "$work"' EXIT
await 'listening on' device.log
name=Phantom@tcp://$(sed -nE 's/.*listening on ([0-9.:]+).*/\1/p' "$work/device.log")
kill "$service"
await 'Connection refused' device.log

"$hapticd" mark "trial 3 begins" --server "$name" >"$work/out" 2>"$work/err" || { cat "$work/out" "$work/err"; exit 1; }
grep -q 'marked "trial 3 begins"' "$work/out"
"$hapticd" mark $'red\e[31mtext' --server "$name" >/dev/null 2>&1
"$hapticd" touch "$source_dir/testdata/meshes/bunny.obj" --server "$name" --seconds 1 >"$work/out" 2>"$work/err" ||
  { cat "$work/out" "$work/err"; exit 1; }
grep -q '^summary' "$work/out"
grep -q 'the device gives no force: .*Connection refused' "$work/err"
kill "$device"
wait "$device"
"$hapticd" info "$work/felt.haptics" >"$work/info"
grep -q 'marker .*trial 3 begins' "$work/info"
grep -q 'marker .*red.*text' "$work/info"
! grep -q $'\e' "$work/info" || exit 1
