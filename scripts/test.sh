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

# failed_in LOG, all_in LOG: what ctest's last lines say.
failed_in() { sed -nE 's/.*, ([0-9]+) tests? failed out of [0-9]+.*/\1/p' "$1" | tail -1; }
all_in() { sed -nE 's/.*tests? failed out of ([0-9]+).*/\1/p' "$1" | tail -1; }

# run_tests BUILD LOG CTEST_ARGUMENTS...: a virtual machine may stand still for longer than any deadline, so what fails gets
# a second chance with the machine to itself, and is named. A finding of a sanitizer gets none.
run_tests() {
  local build=$1 log=$2 status=0
  shift 2
  ctest --test-dir "$build" --output-on-failure --parallel "$jobs" "$@" 2>&1 | tee "$log" || status=$?
  failed=$(failed_in "$log")
  all=$(all_in "$log")
  if [ "${failed:-0}" != 0 ] && ! grep -qE 'ERROR: [A-Za-z]*Sanitizer|WARNING: ThreadSanitizer|runtime error:' "$log"; then
    echo "== failed at first, now one at a time:"
    grep -E '^[[:space:]]+[0-9]+ - ' "$log"
    status=0
    ctest --test-dir "$build" --output-on-failure --rerun-failed 2>&1 | tee "$log.again" || status=$?
    failed=$(failed_in "$log.again")
  fi
  # No count is a failure, too.
  [ "$status" = 0 ] || [ "${failed:-0}" != 0 ] || failed=1
  total_failed=$((total_failed + ${failed:-0}))
  total_passed=$((total_passed + ${all:-0} - ${failed:-0}))
}

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
  # One thread builds the index where threads are watched: TBB is not instrumented.
  [ "$preset" = tsan ] && export HAPTICD_EMBREE="threads=1,user_threads=1"
  export TSAN_OPTIONS="suppressions=$PWD/scripts/tsan.supp" ASAN_OPTIONS="detect_leaks=1" LSAN_OPTIONS="suppressions=$PWD/scripts/lsan.supp:print_suppressions=0"
  run_tests "build/$preset" "build/$preset/test.log" "${only[@]}"
  unset HAPTICD_EMBREE
done

echo "$total_passed passed, $total_failed failed"
[ "$total_failed" = 0 ] && [ "$total_passed" -gt 0 ]
