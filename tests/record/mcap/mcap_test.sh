#!/usr/bin/env bash
# What `hapticd export --to mcap` writes, read by the reader of MCAP's own authors. Skipped (77) without node or npm.
set -euo pipefail
hapticd=$1
source_dir=$2
here=$source_dir/tests/record/mcap
if ! command -v node >/dev/null || ! command -v npm >/dev/null; then
  echo "skipped: node and npm are not installed; apt-get install nodejs npm"
  exit 77
fi
work=$(mktemp -d)
cp "$here"/package.json "$here"/package-lock.json "$here"/read_mcap.mjs "$work"
if ! (cd "$work" && npm ci --no-audit --no-fund --ignore-scripts >npm.log 2>&1); then
  tail -3 "$work/npm.log"
  rm -rf "$work"
  echo "skipped: npm could not fetch @mcap/core"
  exit 77
fi
serve_options=(--http off --record "$work/my.haptics")
source "$source_dir/tests/apps/server.sh"
"$hapticd" touch "$source_dir/testdata/meshes/bunny.obj" --server "Phantom@tcp://$address" --seconds 3 >"$work/touch.txt"
"$hapticd" mark 'trial "3" begins' --server "Phantom@tcp://$address"
kill -INT "$server"
wait "$server" || true
"$hapticd" export "$work/my.haptics" --to mcap -o "$work/my.mcap"
"$hapticd" export "$work/my.haptics" --to csv -o "$work/my.csv"
cd "$work"
node read_mcap.mjs my.mcap my.csv
