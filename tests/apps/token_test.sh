#!/usr/bin/env bash
# Where tokens are required, each command that changes something says at once that it was refused, and takes a token.
set -euo pipefail
hapticd=$1
source_dir=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
token=0123456789abcdef-secret
(umask 077 && printf 'owner %s\n' "$token" >"$work/tokens" && printf '%s\n' "$token" >"$work/token")
printf 'tokens = "%s"\nhttp = "off"\n' "$work/tokens" >"$work/config.toml"
serve_options=(--config "$work/config.toml")
cd "$work"  # the server records there
. "$source_dir/tests/apps/server.sh"

refused() {  # ARGUMENT...
  local status=0
  "$hapticd" "$@" >out 2>&1 || status=$?
  [ "$status" = 1 ] && grep -q 'refused: your role is observer' out || { echo "not refused: $*"; cat out; exit 1; }
}
touch=(touch "$source_dir/testdata/meshes/bunny.obj" --server "Phantom@tcp://$address" --seconds 1)
refused "${touch[@]}"
! grep -q '^sent ' out || { echo 'it says that it sent what was refused'; cat out; exit 1; }
! grep -q '^summary' out || { echo 'it watches what it could not send'; cat out; exit 1; }
"$hapticd" "${touch[@]}" --token-file token >out 2>&1 || { cat out; exit 1; }

record=(record "Phantom@tcp://$address" --server --seconds 1)
refused "${record[@]}"
"$hapticd" "${record[@]}" --token-file token | grep -q 'recorded [1-9]'

"$hapticd" stop "Phantom@tcp://$address" --token-file token | grep -q 'forces are off'
"$hapticd" stop --rearm "Phantom@tcp://$address" --token-file token | grep -q 're-armed'
! grep -q "$token" log || { echo 'a token in the log'; exit 1; }
