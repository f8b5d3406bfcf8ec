#!/usr/bin/env bash
# Judges the renderer on random scenes for hours, on all processors, with seeds that were not judged before, and appends a row
# to the ledger in docs/testing.md.
#   scripts/judge.sh --hours N [--jobs N]
# Uses the release build in build/release, which it brings up to date. Findings: build/judge/COMMIT/, replayed by
# 'build/release/bin/hapticd_judge --replay FILE'. Exit status 1 with findings.
set -euo pipefail
cd "$(dirname "$0")/.."

usage() { sed -n '2,6s/^# *//p' "$0"; exit 2; }
hours=
jobs=$(nproc)
while [ $# -gt 0 ]; do
  case "$1" in
    --hours) hours=${2:?"--hours needs a number"}; shift ;;
    --jobs) jobs=${2:?"--jobs needs a number"}; shift ;;
    *) usage ;;
  esac
  shift
done
[ -n "$hours" ] || usage
seconds=$(awk -v h="$hours" 'BEGIN { printf "%.0f", 3600 * h }')

[ -e build/release/build.ninja ] || cmake --preset release
cmake --build build/release --target hapticd_judge -- -j "$jobs"
commit=$(git rev-parse --short=10 HEAD)
[ -z "$(git status --porcelain --untracked-files=no -- src tests/truth)" ] || commit+="+changes"
work=build/judge/$commit
mkdir -p "$work"

# Every run gets a block of 2^30 seeds of its own, and every job a sixteenth of it.
base=$(date +%s)
pids=()
for ((job = 0; job < jobs; ++job)); do
  nice -n 10 build/release/bin/hapticd_judge --seconds "$seconds" --seed $(((base << 30) + (job << 26))) \
    --findings 100 --out "$work" >"$work/$job.log" 2>&1 &
  pids+=($!)
done
for pid in "${pids[@]}"; do wait "$pid" || true; done

row=$(cat "$work"/*.log | awk '
  / per tick$/ { if (match($0, /seeds [0-9]+ to [0-9]+/)) seeds = seeds (seeds ? ", " : "") substr($0, RSTART + 6, RLENGTH - 6) }
  /^judged / { ticks += $2; trials += $5; findings += $7 }
  END { if (ticks == 0) exit 1; printf "%s | %.3g | %d | %d", seeds, ticks, trials, findings }') || {
  echo "no judge came to its end; see $work/*.log" >&2
  exit 1
}
line="| $(date -u +%Y-%m-%d) | $commit | $row |"
echo "$line"
sed -i "s%^<!-- end of the ledger of the judge -->\$%${line//%/\\%}\n&%" docs/testing.md
[ "${row##* }" = 0 ]
