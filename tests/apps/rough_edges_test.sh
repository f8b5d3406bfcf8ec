#!/usr/bin/env bash
# Messages and files of a user who mistypes, repeats and overwrites.
set -euo pipefail
hapticd=$1
source_dir=$2
http=127.0.0.1:0
. "$(dirname "$0")/server.sh"

refused() { # refused STATUS TEXT COMMAND...: the status, and the text in what it prints
  local wanted=$1 text=$2 status=0
  shift 2
  "$@" >"$work/said" 2>&1 || status=$?
  [ "$status" = "$wanted" ] && grep -qF -- "$text" "$work/said" || { cat "$work/said"; echo "status $status of: $*"; exit 1; }
}
refused 2 "did you mean 'serve'?" "$hapticd" serv
refused 2 "unknown command 'xyzzyx'; 'hapticd --help'" "$hapticd" xyzzyx
refused 2 "nothing to render" "$hapticd" render
refused 2 "excludes" "$hapticd" touch "$source_dir/testdata/meshes/bunny.obj" --true-size --size-mm 3
refused 1 "hapticd devices" "$hapticd" serve --device openhaptics --listen 127.0.0.1:0 --http off

# Nothing is overwritten without --force.
"$hapticd" record "Phantom@tcp://$address" "$work/own.csv" --seconds 0.3
refused 1 "exists: choose another name, or overwrite it by --force" "$hapticd" record "Phantom@tcp://$address" "$work/own.csv" --seconds 0.3
"$hapticd" record "Phantom@tcp://$address" "$work/own.csv" --seconds 0.3 --force
recording=$source_dir/testdata/recordings/all_commands_law2.haptics
"$hapticd" export "$recording" --to csv -o "$work/out.csv"
refused 1 "--force" "$hapticd" export "$recording" --to csv -o "$work/out.csv"
"$hapticd" export "$recording" --to csv -o "$work/out.csv" --force

"$hapticd" info "$recording" >"$work/info"
grep -q '^device      ' "$work/info" && grep -q '^  force     at most [0-9.]* N' "$work/info" && grep -q '^command     SetVertices, 4 times' "$work/info" ||
  { cat "$work/info"; exit 1; }

# A smaller mesh replaces a larger one in its object; another object stays.
printf 'v 0 0 0\nv 30 0 0\nv 0 30 0\nf 1 2 3\n' >"$work/one.obj"
touch_mesh() { "$hapticd" touch "$@" --server "Phantom@tcp://$address" --seconds 0.2 >"$work/out" 2>&1 || { cat "$work/out"; exit 1; }; }
touch_mesh "$source_dir/testdata/meshes/bunny.obj"
touch_mesh "$work/one.obj" --object 1
touch_mesh "$work/one.obj" --true-size
grep -q ' 1 triangle,' "$work/out"
grep -q '^30 x 30 x 0 mm, centred' "$work/out"
web=$(sed -nE 's#.*viewer: http://127.0.0.1:([0-9]+)/.*#\1#p' "$work/log")
triangles() { # of objects 0 and 1
  exec 3<>"/dev/tcp/127.0.0.1/$web"
  printf 'GET /api/state HTTP/1.1\r\nHost: localhost:%s\r\nConnection: close\r\n\r\n' "$web" >&3
  grep -oaE '"triangles":[0-9]+' <&3 | tr '\n' ' '
}
becomes() { for _ in $(seq 100); do [ "$(triangles)" = "$1" ] && return; sleep 0.1; done; echo "got $(triangles), not $1"; exit 1; }
becomes '"triangles":1 "triangles":1 '
touch_mesh "$source_dir/testdata/meshes/bunny.obj" --replace
becomes '"triangles":3674 '
"$hapticd" serve --listen 127.0.0.1:0 --http off --port 0 --seconds 0.2 --verbose >"$work/second" 2>&1
