#!/usr/bin/env bash
# Measures how fast hapticd is, against yardsticks on this machine. Stop other programs first.
#   scripts/bench.sh             all benchmarks in short windows, under ten minutes
#   scripts/bench.sh --full      longer, about 25 minutes; writes the figures into docs/performance.md
#   scripts/bench.sh --long      the longest, most of an hour; writes them as well
#   scripts/bench.sh NAME...     only these (hapticd bench --list); docs/performance.md stays as it is
# Results as JSON, CSV and drawings: build/bench/
set -euo pipefail
cd "$(dirname "$0")/.."

length=()
names=()
for argument in "$@"; do
  case "$argument" in
    --full | --long) length=("$argument") ;;
    -*) sed -n '2,7s/^# *//p' "$0"; exit 2 ;;
    *) names+=("$argument") ;;
  esac
done

scripts/install_packages.sh build viewer bench
scripts/configure_programs.sh >/dev/null
cmake --build build/release --parallel "$(nproc)" --target hapticd hapticd-bench | awk 'NR % 10 == 1 || !/^\[[0-9]+\/[0-9]+\] (Building|Linking)/'
out=build/bench
rm -rf "$out"
build/release/bin/hapticd bench --out "$out" "${length[@]}" "${names[@]}"
echo "results: $out"

# The script replaces the text between the two marks; the rest of the page is written by hand.
if [ "${#length[@]}" -gt 0 ] && [ "${#names[@]}" = 0 ]; then
  page=docs/performance.md
  awk -v figures="$out/results.md" '
    /<!-- figures: begin -->/ { print; print ""; while ((getline line < figures) > 0) print line; print ""; skip = 1; next }
    /<!-- figures: end -->/ { skip = 0 }
    !skip { print }' "$page" >"$page.new"
  mv "$page.new" "$page"
  cp "$out"/figures/*.svg docs/figures/
  echo "written: $page"
fi
