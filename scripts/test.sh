#!/usr/bin/env bash
# Installs what is missing, builds, and passes the tests: optimised, under ASan+UBSan, and under TSan what has threads.
#   scripts/test.sh            the whole of it
#   scripts/test.sh --quick    the optimised build alone
#   scripts/test.sh --long     with full sizes (12 million segments and the like)
set -euo pipefail
cd "$(dirname "$0")/.."

presets=(release asan tsan)
for argument in "$@"; do
  case "$argument" in
    --quick) presets=(release) ;;
    --long) export HAPTICD_LONG=1 ;;
    *) sed -n '2,5s/^# *//p' "$0"; exit 2 ;;
  esac
done

scripts/install_packages.sh
scripts/check_includes.sh

jobs=$(nproc)
total_passed=0
total_failed=0
for preset in "${presets[@]}"; do
  echo "== $preset"
  cmake --preset "$preset" >/dev/null
  only=()
  case "$preset" in
    release) target=all ;;
    asan) target=all_tests; only=(-LE apps) ;;
    tsan) target=threads_tests; only=(-L threads) ;;
  esac
  # Ninja's progress in steps of ten, so that a log stays readable.
  cmake --build "build/$preset" --parallel "$jobs" --target "$target" | awk 'NR % 10 == 1 || !/^\[[0-9]+\/[0-9]+\] (Building|Linking)/'
  log="build/$preset/test.log"
  # One thread builds the index where threads are watched: TBB is not instrumented.
  [ "$preset" = tsan ] && export HAPTICD_EMBREE="threads=1,user_threads=1"
  export TSAN_OPTIONS="suppressions=$PWD/scripts/tsan.supp" ASAN_OPTIONS="detect_leaks=1" LSAN_OPTIONS="suppressions=$PWD/scripts/lsan.supp:print_suppressions=0"
  status=0
  ctest --test-dir "build/$preset" --output-on-failure "${only[@]}" --parallel "$jobs" 2>&1 | tee "$log" || status=$?
  unset HAPTICD_EMBREE
  failed=$(sed -nE 's/.*, ([0-9]+) tests? failed out of ([0-9]+).*/\1/p' "$log" | tail -1)
  total=$(sed -nE 's/.*tests? failed out of ([0-9]+).*/\1/p' "$log" | tail -1)
  total_failed=$((total_failed + ${failed:-0}))
  total_passed=$((total_passed + ${total:-0} - ${failed:-0}))
  [ "$status" = 0 ] || [ "${failed:-0}" != 0 ] || total_failed=$((total_failed + 1))
done

echo "$total_passed passed, $total_failed failed"
[ "$total_failed" = 0 ] && [ "$total_passed" -gt 0 ]
