#!/usr/bin/env bash
# Two devices at one server. The second is a recorded hand in a process of its own, and away while its file is.
set -euo pipefail
hapticd=$1
work=$(mktemp -d)
export XDG_STATE_HOME=$work XDG_RUNTIME_DIR=$work
printf 't_s,x_m,y_m,z_m\n0,0,0,0\n1,0.01,0,0\n' >"$work/hand.csv"
cat >"$work/two.toml" <<END
allow_no_rt = true
http = "off"
[[device]]
name = "Left"
[[device]]
name = "Right arm"
driver = "replay"
isolate = true
hand = "hand.csv"
END
cd "$work"

# Which of them is at fault is said.
mv hand.csv away.csv
status=0
"$hapticd" serve --config two.toml --check-config >out 2>&1 || status=$?
[ "$status" = 2 ]
grep -q "^hapticd: two.toml:9: device 'Right arm': hand: hand.csv: cannot be read as a hand file" out || { cat out; exit 1; }
status=0
HAPTICD_HDAPI_LIB=$work/none.so "$hapticd" serve --device openhaptics --in-process --name Left --listen 127.0.0.1:0 --http off --allow-no-rt >out 2>&1 || status=$?
[ "$status" = 1 ]
grep -q "^hapticd: device 'Left': .*none.so" out || { cat out; exit 1; }
mv away.csv hand.csv

: >log
"$hapticd" serve --config two.toml --listen 127.0.0.1:0 >log 2>&1 &
server=$!
trap 'kill "$server" 2>/dev/null || true; rm -rf "$work"' EXIT
await() { # TEXT: until the log has it; fails after 30 s
  for _ in $(seq 300); do
    grep -qF -- "$1" log && return
    sleep 0.1
  done
  cat log
  return 1
}
await 'listening on'
address=$(sed -nE 's/.*listening on ([0-9.:]+).*/\1/p' log)
await "of 'Right arm': paced by the device"
mv hand.csv away.csv
pkill -KILL -P "$server" -f device-host
await "device 'Right arm': the device does not open: hand.csv"

# The device that works is recorded as often as anybody wants.
for i in 1 2 3 4 5 6; do
  "$hapticd" record "Left@$address" --server "$i.haptics" --seconds 0.2 >out 2>&1 || { cat out log; exit 1; }
done

# One that is away is stopped all the same, and stays so when it is back.
"$hapticd" stop "Right arm@$address" >out 2>err || { cat out err log; exit 1; }
grep -q 'forces are off' out
grep -q 'the device gives no force: .*hand.csv' err
"$hapticd" record "Left@$address" --server back.haptics --detach >out
"$hapticd" mark away --server "Left@$address" >out 2>err
[ ! -s err ] || { cat err; exit 1; } # a fault of the other one is none of this one
mv away.csv hand.csv
await "device 'Right arm': works again"
"$hapticd" watch "Right arm@$address" --json --seconds 1 >ticks
active=$(sed -nE '$s/.*"guard_active":([0-9]+).*/\1/p' ticks)
[ $((active >> 13 & 1)) = 1 ] || { cat ticks log; exit 1; }
"$hapticd" stop "Right arm@$address" --rearm >out 2>err || { cat out err log; exit 1; }
"$hapticd" mark back --server "Left@$address" >out
sleep 1
"$hapticd" record "Left@$address" --server --end >out
kill "$server"
wait "$server"

# Seconds count from the first tick of the recording, whichever device is shown.
"$hapticd" info back.haptics >info
away=$(sed -nE 's/^marker +([0-9.]+) s: away/\1/p' info)
for device in "Left" "Right arm"; do
  "$hapticd" plot back.haptics --device "$device" --out "$device.svg" >"$device.txt"
done
grep -q "ticks of 'Left' from 0.000 s" Left.txt || { cat Left.txt; exit 1; }
begin=$(sed -nE "s/.*ticks of 'Right arm' from ([0-9.]+) s.*/\1/p" "Right arm.txt")
awk "BEGIN { exit !($begin > $away) }" || { cat info "Right arm.txt"; exit 1; }
grep -q '>back<' "Right arm.svg"
! grep -q '>away<' "Right arm.svg" || exit 1
"$hapticd" render --session back.haptics >out || { cat out; exit 1; }
