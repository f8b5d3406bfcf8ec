#!/usr/bin/env bash
# The server on a machine that gives it little: small stacks, few descriptors, no temporary folder, other standard streams.
set -euo pipefail
hapticd=$1
source_dir=$2
work=$(mktemp -d)
trap 'kill "${server:-}" 2>/dev/null || true; rm -rf "$work"' EXIT

serves() { # serves HOW COMMAND...: a server that COMMAND starts with these arguments ticks, records and ends in order
  local how=$1 status=0
  shift
  rm -f "$work/r.haptics"
  "$@" "$hapticd" serve --listen 127.0.0.1:0 --http off --allow-no-rt "${device[@]}" --record "$work/r.haptics" --seconds 0.5 >"$work/log" 2>&1 || status=$?
  [ "$status" = 0 ] && "$hapticd" info "$work/r.haptics" | grep -q '^  ticks     [1-9]' || { cat "$work/log"; echo "$how: status $status"; exit 1; }
}
limited() { (ulimit "$1" "$2"; shift 2; exec "$@"); }
device=(--device openhaptics --isolate)
export HAPTICD_HDAPI_LIB=$3
for stack_kB in 256 1024; do serves "isolated, stack of $stack_kB kB" limited -s "$stack_kB"; done
serves "isolated, 24 descriptors" limited -n 24
device=(--device simulated)
for stack_kB in 256 1024; do serves "stack of $stack_kB kB" limited -s "$stack_kB"; done
serves "20 descriptors" limited -n 20
serves "no core" limited -c 0
serves "umask 0" bash -c 'umask 0; exec "$@"' -
[ "$(stat -c %a "$work/r.haptics")" = 644 ]
serves "umask 077" bash -c 'umask 077; exec "$@"' -
[ "$(stat -c %a "$work/r.haptics")" = 600 ]
serves "empty environment" env -i
serves "no temporary folder" env TMPDIR=/nowhere XDG_RUNTIME_DIR=/nowhere XDG_STATE_HOME=/nowhere HOME=/nowhere
serves "standard streams closed" bash -c 'exec 0<&- 1>&- 2>&-; exec "$@"' -

# What Embree calls an unknown error is a lack of memory for its threads: the text names the limit. Where it begins depends on
# the machine.
"$hapticd" export "$work/r.haptics" --to csv --out "$work/hand.csv" --force >/dev/null
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n' >"$work/one.obj"
for kB in $(seq 200000 4000 228000); do
  limited -v "$kB" "$hapticd" render --mesh "$work/one.obj" --hand "$work/hand.csv" --out "$work/felt.csv" --force >"$work/said" 2>&1 || true
  ! grep Embree "$work/said" | grep -v "raise the limit" || exit 1
done

export XDG_RUNTIME_DIR=$work
# What is printed to a closed standard output is lost, which a script must hear of.
"$hapticd" serve --listen 127.0.0.1:0 --http off --allow-no-rt >"$work/log" 2>&1 &
server=$!
for _ in $(seq 600); do grep -q 'listening on' "$work/log" && break; sleep 0.05; done
address=$(sed -nE 's/.*listening on ([0-9.:]+).*/\1/p' "$work/log")
"$hapticd" stop "Phantom@tcp://$address" >/dev/null
for options in "" --rearm "--rearm --json"; do
  status=0
  "$hapticd" stop "Phantom@tcp://$address" $options >&- 2>"$work/said" || status=$?  # unquoted: two options
  [ "$status" = 1 ] && grep -q "cannot write to standard output" "$work/said" || { cat "$work/said"; echo "status $status of stop $options"; exit 1; }
done

# What is in the place of the server's own Unix socket stays, and is named with one remedy.
taken=$XDG_RUNTIME_DIR/hapticd/${address##*:}.sock
kill "$server"
wait "$server" || true
: >"$taken"
"$hapticd" serve --listen "$address" --http off --allow-no-rt --seconds 0.2 >"$work/log" 2>&1 || { cat "$work/log"; exit 1; }
[ -f "$taken" ] && [ "$(grep -o 'choose another path' "$work/log" | wc -l)" = 1 ] || { cat "$work/log"; exit 1; }

# The log names each port that it opens.
printf '[compat]\nhaply = "127.0.0.1:0"\n' >"$work/haply.toml"
"$hapticd" serve --config "$work/haply.toml" --listen 127.0.0.1:0 --http off --allow-no-rt --seconds 0.2 >"$work/log" 2>&1 || { cat "$work/log"; exit 1; }
grep -qE 'Haply devices: ws://127\.0\.0\.1:[1-9][0-9]*$' "$work/log" || { cat "$work/log"; exit 1; }
