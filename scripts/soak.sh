#!/usr/bin/env bash
# Simulates the whole server for hours, on all processors, with seeds that were not run before, and appends a row to the
# ledger of simulations in docs/ledgers.md.
#   scripts/soak.sh --hours N [--jobs N]
# Uses the release build in build/release, which it brings up to date. A finding is run again with
# 'build/release/bin/hapticd-sim --seed SEED --seconds 60 --shrink'. Exit status 1 with findings.
set -euo pipefail
cd "$(dirname "$0")/.."
usage() { sed -n '2,6s/^# *//p' scripts/soak.sh; exit 2; }
. scripts/ledger.sh

read_hours "$@"
build_for_ledger hapticd-sim soak src tests
simulate() {
  nice -n 10 build/release/bin/hapticd-sim --seeds "$1-$(($1 + (1 << 26) - 1))" --seconds 60 --cpu "$seconds"
}
run_jobs simulate

row=$(cat "$work"/*.log | awk '
  /^seed / { seed = $2; sub(":", "", seed); if (first == "") first = seed }
  / s simulated, / {
    runs += $1; simulated += $3; findings += $(NF - 2)
    for (i = 2; i <= NF; i++) if ($i == "faults,") faults += $(i - 1)
  }
  END { if (runs == 0) exit 1; printf "%d from %s | %.1f | %d | %d", runs, first, simulated / 3600, faults, findings }') || {
  echo "no simulation came to its end; see $work/*.log" >&2
  exit 1
}
append_row simulations "$row"
