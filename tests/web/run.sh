#!/usr/bin/env bash
# Runs a test of the viewer: run.sh WEB_DIR TEST.mjs [HAPTICD]. With HAPTICD it drives a browser. When node, its packages
# or the browser are missing, it prints the reason and returns 77 (skipped).
set -euo pipefail
web=$1
shift

skip() {
  echo "skipped: $1"
  exit 77
}

node=$(command -v node || command -v nodejs || true)
[ -n "$node" ] || skip "node is missing; install nodejs and npm"
[ -d "$web/node_modules/esbuild" ] || skip "$web has no packages; build hapticd with -DHAPTICD_WEB=ON, or run 'npm ci' there"
if [ $# -gt 1 ]; then
  [ -x "${HAPTICD_CHROMIUM:-/usr/bin/chromium}" ] || skip "chromium is missing; install it or set HAPTICD_CHROMIUM"
  [ -d "$web/node_modules/playwright-core" ] || skip "$web has no playwright-core"
fi
HAPTICD_WEB_DIR=$web exec "$node" "$@"
