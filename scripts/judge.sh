#!/usr/bin/env bash
# Judges the renderer on random scenes for hours, on all processors, with seeds that were not judged before, and appends a row
# to the ledger in docs/ledgers.md.
#   scripts/judge.sh --hours N [--jobs N]
# Uses the release build in build/release, which it brings up to date. Findings: build/judge/COMMIT/, replayed by
# 'build/release/bin/hapticd_judge --replay FILE'. Exit status 1 with findings.
set -euo pipefail
cd "$(dirname "$0")/.."
usage() { sed -n '2,6s/^# *//p' scripts/judge.sh; exit 2; }
. scripts/ledger.sh

read_hours "$@"
build_for_ledger hapticd_judge judge src tests/truth
judge() { nice -n 10 build/release/bin/hapticd_judge --seconds "$seconds" --seed "$1" --findings 100 --out "$work"; }
run_jobs judge

row=$(cat "$work"/*.log | awk '
  / per tick$/ { if (match($0, /seeds [0-9]+ to [0-9]+/)) seeds = seeds (seeds ? ", " : "") substr($0, RSTART + 6, RLENGTH - 6) }
  /^judged / { ticks += $2; trials += $5; findings += $7 }
  END { if (ticks == 0) exit 1; printf "%s | %.3g | %d | %d", seeds, ticks, trials, findings }') || {
  echo "no judge came to its end; see $work/*.log" >&2
  exit 1
}
append_row "the judge" "$row"
