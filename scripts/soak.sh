#!/usr/bin/env bash
# Simulates the whole server for hours, on all processors, with seeds that were not run before, and appends a row to the
# second ledger in docs/testing.md.
#   scripts/soak.sh --hours N [--jobs N]
# Uses the release build in build/release, which it brings up to date. A finding is run again with
# 'build/release/bin/hapticd-sim --seed SEED --seconds 60 --shrink'. Exit status 1 with findings.
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
cmake --build build/release --target hapticd-sim -- -j "$jobs"
commit=$(git rev-parse --short=10 HEAD)
[ -z "$(git status --porcelain --untracked-files=no -- src tests)" ] || commit+="+changes"
work=build/soak/$commit
mkdir -p "$work"

# Every run gets a block of 2^30 seeds of its own, and every job a sixteenth of it.
base=$(date +%s)
pids=()
for ((job = 0; job < jobs; ++job)); do
  first=$(((base << 30) + (job << 26)))
  nice -n 10 build/release/bin/hapticd-sim --seeds "$first-$((first + (1 << 26) - 1))" --seconds 60 --cpu "$seconds" \
    >"$work/$job.log" 2>&1 &
  pids+=($!)
done
for pid in "${pids[@]}"; do wait "$pid" || true; done

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
line="| $(date -u +%Y-%m-%d) | $commit | $row |"
echo "$line"
sed -i "s%^<!-- end of the ledger of simulations -->\$%${line//%/\\%}\n&%" docs/testing.md
[ "${row##* }" = 0 ]
