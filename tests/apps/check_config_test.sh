#!/usr/bin/env bash
# hapticd serve --check-config: the output is valid input; an error is named and ends with status 2.
set -euo pipefail
hapticd=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

fails_with() {  # TEXT ARGUMENT...
  local text=$1 status=0
  shift
  "$hapticd" serve --check-config "$@" >out.txt 2>error.txt || status=$?
  if [ "$status" != 2 ] || ! grep -qF -- "$text" error.txt || [ -s out.txt ]; then
    echo "expected status 2 and '$text', got status $status and: $(cat error.txt out.txt)"
    exit 1
  fi
}

printf 'listen = ":4000"\n\n[[device]]\nname = "Left"\nreport_rate_Hz = 250\n' >left.toml
"$hapticd" serve --config left.toml --name Right --check-config >effective.toml
grep -qx 'listen = "127.0.0.1:4000"' effective.toml
grep -qx 'names = \["Right"\]' effective.toml
grep -qx 'report_rate_Hz = 250' effective.toml
"$hapticd" serve --config effective.toml --check-config >again.toml
cmp effective.toml again.toml

printf '# lab\nvrpn_OpenHaptics A 1 500 1 0.02 Default PHANToM\nvrpn_Dial D 1\nvrpn_Phantom B 0 60 Second\n' >vrpn.cfg
"$hapticd" serve --config vrpn.cfg --device simulated --check-config >effective.toml
grep -q '^# vrpn.cfg:3: "vrpn_Dial" is not supported by this server' effective.toml
[ "$(grep -cx 'driver = "simulated"' effective.toml)" = 2 ]
"$hapticd" serve --config effective.toml --check-config >again.toml
grep -v '^#' effective.toml | cmp - again.toml

printf '\n[[device]]\nreport_rate_Hz = 2000\n' >bad.toml
fails_with "bad.toml:3: device 'Phantom': report_rate_Hz must be between 0.1 and 1000, got 2000" --config bad.toml
printf 'vrpn_Phantom P 1 fast X\n' >bad.cfg
fails_with 'bad.cfg:1: report_rate_Hz is "fast", expected a number' --config bad.cfg
fails_with "unknown driver 'hal'" --device hal
# What only the driver understands is checked without opening a device.
fails_with "device 'Phantom': " --hand nosuch.csv
fails_with "nosuch.csv" --hand nosuch.csv
fails_with "device 'Phantom': " --hand .
printf '\n[[device]]\nhand = "nosuch.csv"\n' >hand.toml
fails_with "hand.toml:3: device 'Phantom': hand: nosuch.csv: cannot be read" --config hand.toml
printf '[[device]]\ndriver = "evdev"\nwheel_profile = "wheel.toml"\n' >evdev.toml
printf 'force_N = 4\naxis = 2\n' >wheel.toml
fails_with "device 'Phantom': wheel_profile: wheel.toml:2: unknown key 'axis'; did you mean 'axes'?" --config evdev.toml
printf '\ntokens = "nosuch"\n' >tokens.toml
fails_with "tokens.toml:2: tokens: cannot read 'nosuch'" --config tokens.toml
printf '\ntls = "%s/nosuch.pem"\ntls_key = "%s/nosuch.key"\n' "$work" "$work" >tls.toml
fails_with "tls.toml:3: TLS: cannot read the key '$work/nosuch.key'" --config tls.toml
(umask 077 && : >empty.key)
printf '\ntls = "%s/nosuch.pem"\ntls_key = "%s/empty.key"\n' "$work" "$work" >tls.toml
fails_with "tls.toml:2: TLS: cannot use the certificate '$work/nosuch.pem'" --config tls.toml
fails_with "hardware is 'x', expected the number" --device forcedimension:x
fails_with "has no hardware to choose from" --device simulated:left
fails_with "the driver 'evdev' is led by its own hand" --device evdev --hand script.csv
fails_with "--device: is empty" --device ''
fails_with "is the port of listen" --listen 127.0.0.1:4000 --http 127.0.0.1:4000
fails_with 'replay needs a recorded hand: hand = "FILE.csv"' --device replay
fails_with "--name needs a name, got the option --check-config" --name --check-config

"$hapticd" serve --config hand.toml --device evdev --check-config | grep -qx 'hand = "script"'

# The isolation in effect, as the driver decides it; another driver decides anew.
"$hapticd" serve --device openhaptics --check-config >effective.toml
grep -qx 'isolate = true' effective.toml
"$hapticd" serve --config effective.toml --check-config | cmp effective.toml -
"$hapticd" serve --config effective.toml --device simulated --check-config >simulated.toml
! grep -q '^isolate = ' simulated.toml || exit 1
"$hapticd" serve --device evdev --check-config | grep -qx 'isolate = false'

printf 'seconds = 5\n' >seconds.toml
"$hapticd" serve --config seconds.toml --seconds 0 --check-config | grep -qx 'seconds = 0'
