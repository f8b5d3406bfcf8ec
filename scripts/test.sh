#!/usr/bin/env bash
# Installs missing packages, builds, and runs the tests: optimised, under ASan+UBSan, and those with threads under TSan.
#   scripts/test.sh                 all tests
#   scripts/test.sh --quick         the optimised build only
#   scripts/test.sh --quick ROOM    the optimised tests of one folder below tests/, e.g. scene or realtime/render
#   scripts/test.sh --long          all tests at full size (12 million segments and the like), clang-tidy, a build by clang
# The last line is 'N passed, N failed', followed by ', N skipped' where tests were skipped. Logs: build/PRESET/test*.log
set -euo pipefail
cd "$(dirname "$0")/.."

usage() { sed -n '3,6s/^# *//p' "$0"; exit 2; }
presets=(release asan tsan)
room=""
long=""
while [ $# -gt 0 ]; do
  case "$1" in
    --quick)
      presets=(release)
      if [[ $# -gt 1 && $2 != -* ]]; then room=$2; shift; fi ;;
    --long) long=yes; export HAPTICD_LONG=1 ;;
    *) usage ;;
  esac
  shift
done
if [ -n "$room" ] && [ ! -d "tests/$room" ] && [ ! -d "src/$room" ]; then
  echo "there is no room '$room'; the rooms are the folders below tests/" >&2
  exit 2
fi
# A room whose folder below tests/ has no CMakeLists.txt has its tests in programs of the folder above: those that list
# sources of it.
programs=()
if [ -n "$room" ] && [ ! -e "tests/$room/CMakeLists.txt" ]; then
  inner=${room##*/}
  room=${room%/*}
  [ -e "tests/$room/CMakeLists.txt" ] || { echo "tests/ has no folder for '$room'" >&2; exit 2; }
  mapfile -t programs < <(tr '\n' ' ' <"tests/$room/CMakeLists.txt" | grep -oE 'hapticd_test\([^)]*\)' | grep -F " $inner/" |
                          sed -E 's/hapticd_test\(([^ ]+) .*/\1/')
  [ "${#programs[@]}" -gt 0 ] || { echo "no test program of tests/$room has sources of '$inner'" >&2; exit 2; }
fi

kAllowedFlaky=2  # of one part
jobs=$(nproc)
total_passed=0
total_failed=0
total_skipped=0
flaky=()
summary=()

# A part is a preset, or 'asan-computing': the tests of asan that wait for nothing, which run beside those of tsan.
preset_of() { echo "${1%-*}"; }
log_of() { echo "build/$(preset_of "$1")/test${1#"$(preset_of "$1")"}.log"; }

# Arguments for ctest, by part.
filter_of() {
  case "$1" in
    release) [ "${#programs[@]}" = 0 ] || (IFS='|'; echo "-R ^(${programs[*]})[.]") ;;
    asan) echo "-LE apps|computing" ;;
    asan-computing) echo "-L computing" ;;
    tsan) echo "-L threads" ;;
  esac
}

targets_of() {
  case "$1" in
    asan) echo all_tests ;;
    tsan) echo threads_tests ;;
    release)
      case "$room" in
        "" | apps | examples | install | python | web) echo all ;;
        *)
          if [ "${#programs[@]}" -gt 0 ]; then printf '%s_test\n' "${programs[@]}"; return; fi
          echo "tests/$room/all"
          # Tests of the whole program, run by scripts, are no dependency that the build knows.
          if grep -rqs 'bin/hapticd"' "build/release/tests/$room" --include=CTestTestfile.cmake; then echo hapticd; fi ;;
      esac ;;
  esac
}

# build PRESET: prints every tenth step, so that a log stays readable.
build() {
  if [ -z "$room" ] || [ ! -e "build/$1/build.ninja" ]; then
    cmake --preset "$1" >"build/$1.configure.log" 2>&1 || { cat "build/$1.configure.log"; return 1; }
  fi
  # shellcheck disable=SC2046
  cmake --build "build/$1" --parallel "$jobs" --target $(targets_of "$1") |
    awk 'NR % 10 == 1 || !/^\[[0-9]+\/[0-9]+\] (Building|Linking)/'
}

# run_ctest PART LOG ARGUMENTS...
run_ctest() {
  local part=$1 log=$2 preset
  preset=$(preset_of "$part")
  shift 2
  export TSAN_OPTIONS="suppressions=$PWD/scripts/tsan.supp:external_symbolizer_path=/usr/bin/llvm-symbolizer-19" ASAN_OPTIONS="detect_leaks=1"
  export LSAN_OPTIONS="suppressions=$PWD/scripts/lsan.supp:print_suppressions=0"
  export ASAN_SYMBOLIZER_PATH=/usr/bin/llvm-symbolizer-19
  # TSan does not know the threads of TBB, which is not instrumented: one thread builds the index.
  [ "$preset" != tsan ] || export HAPTICD_EMBREE="threads=1,user_threads=1"
  # shellcheck disable=SC2046
  ctest --test-dir "build/$preset${room:+/tests/$room}" --output-on-failure "$@" $(filter_of "$part") >"$log" 2>&1
}

# The lists at the end of a log of ctest: 'NUMBER - NAME (STATUS)'.
failed_in() { grep -E '^[[:space:]]+[0-9]+ - .* \([^()]*\)$' "$1" | grep -vE ' \((Skipped|Disabled)\)$' || true; }
skipped_in() { grep -E '^[[:space:]]+[0-9]+ - .* \((Skipped|Disabled)\)$' "$1" || true; }
count() { grep -c . <<<"$1" || true; }
all_in() { sed -nE 's/.*tests? failed out of ([0-9]+).*/\1/p' "$1" | tail -1; }

# judge PART STATUS BUILD_S TEST_S: counts what the first run left. A virtual machine can stall for longer than any
# deadline, so a failed test runs again, alone; if it passes then, it is flaky. Findings of a sanitizer always count.
judge() {
  local part=$1 status=$2 build_s=$3 test_s=$4 log
  log=$(log_of "$1")
  local failed skipped all again still unstable=0
  failed=$(failed_in "$log")
  skipped=$(skipped_in "$log")
  all=$(all_in "$log")
  still=$failed
  if [ -n "$failed" ]; then
    sed -n '/The following tests FAILED/q; p' "$log" | grep -vE ' (Passed|\*\*\*Skipped) +[0-9.]+ sec$' | grep -vE '^ *Start +[0-9]+:' || true
    if grep -qE 'ERROR: [A-Za-z]*Sanitizer|WARNING: ThreadSanitizer|runtime error:' "$log"; then
      echo "== $part: a sanitizer found an error, so no failed test runs again"
    else
      echo "== $part: these tests failed and run again, one at a time:"
      echo "$failed"
      again=0
      run_ctest "$part" "$log.again" --rerun-failed || again=$?
      cat "$log.again"
      still=$(failed_in "$log.again")
      [ "$again" = 0 ] || [ -n "$still" ] || still="  0 - ctest (Failed)"
      while IFS= read -r line; do
        if [ -z "$line" ] || grep -qF -- "$(sed -E 's/ \([^()]*\)$//' <<<"$line") (" <<<"$still"; then continue; fi
        unstable=$((unstable + 1))
        flaky+=("$part: $(sed -E 's/^[[:space:]]*[0-9]+ - (.*) \([^()]*\)$/\1/' <<<"$line")")
      done <<<"$failed"
    fi
  elif [ "$status" != 0 ]; then
    cat "$log"
    still="  0 - ctest (Failed)"
  fi
  local n_failed n_skipped n_passed
  n_failed=$(count "$still")
  if [ "$unstable" -gt "$kAllowedFlaky" ]; then
    echo "== $part: more than $kAllowedFlaky flaky tests: they count as failed"
    n_failed=$((n_failed + unstable))
  fi
  n_skipped=$(count "$skipped")
  n_passed=$((${all:-0} - n_failed - n_skipped))
  [ "$n_passed" -ge 0 ] || n_passed=0
  total_failed=$((total_failed + n_failed))
  total_skipped=$((total_skipped + n_skipped))
  total_passed=$((total_passed + n_passed))
  summary+=("$part: ${all:-0} tests: $n_passed passed, $n_failed failed, $unstable flaky, $n_skipped skipped; waited $build_s s for the build, tests $test_s s")
  [ -z "$still" ] || summary+=("failed:" "$still")
  [ -z "$skipped" ] || summary+=("skipped:" "$skipped")
}

mkdir -p build
if [ -z "$room" ]; then
  scripts/install_packages.sh build viewer test python ros2 lint package sanitizers
  scripts/check_includes.sh
else
  scripts/install_packages.sh build test python ros2
fi

# From here on this process takes only the processor time that the tests leave, for many of them watch what happens within
# milliseconds; a compiler of the same priority beside them makes them fail.
give_way() { chrt --idle --pid 0 "$BASHPID" || renice 19 "$BASHPID" >/dev/null; }

# build_beside_tests PRESET
build_beside_tests() {
  give_way
  build "$1"
}

# The tests of threads leave half of the processors' time.
compute_beside_tests() {
  give_way
  run_ctest asan-computing "$(log_of asan-computing)" --parallel "$jobs"
}

# wait_for_build PRESET PROCESS
wait_for_build() {
  local status=0
  wait "$2" || status=$?
  echo "== $1: built beside the tests"
  cat "build/$1.build.log"
  return "$status"
}

builder=""
computing=""
trap 'for group in $builder $computing; do kill -- "-$group" 2>/dev/null || true; done' EXIT
echo "== release: building"
SECONDS=0
build release
build_s=$SECONDS
for i in "${!presets[@]}"; do
  preset=${presets[i]}
  next=${presets[i + 1]:-}
  builder=""
  if [ -n "$next" ]; then
    set -m  # a process group of its own, which the trap above ends with the script
    build_beside_tests "$next" >"build/$next.build.log" 2>&1 &
    builder=$!
    set +m
  fi
  if [ "$preset" = tsan ]; then
    set -m
    compute_beside_tests &
    computing=$!
    set +m
  fi
  echo "== $preset: testing"
  test_start=$SECONDS
  status=0
  parallel=$((jobs + 1))
  # With no build beside them, there is time for more: most tests of threads wait.
  [ -n "$next" ] || [ "$preset" != tsan ] || parallel=$((2 * jobs + 1))
  run_ctest "$preset" "$(log_of "$preset")" --parallel "$parallel" || status=$?
  test_s=$((SECONDS - test_start))
  judge "$preset" "$status" "$build_s" "$test_s"
  if [ -n "$computing" ]; then
    status=0
    wait "$computing" || status=$?
    computing=""
    judge asan-computing "$status" 0 "$((SECONDS - test_start))"
  fi
  if [ -n "$builder" ]; then
    build_start=$SECONDS
    wait_for_build "$next" "$builder"
    builder=""
    build_s=$((SECONDS - build_start))
  fi
done

if [ -n "$long" ]; then
  for check in tidy clang; do
    if scripts/lint.sh "--$check"; then
      total_passed=$((total_passed + 1))
    else
      total_failed=$((total_failed + 1))
      summary+=("failed: scripts/lint.sh --$check")
    fi
  done
fi

echo
printf '%s\n' "${summary[@]}"
[ "${#flaky[@]}" = 0 ] || printf 'flaky: %s\n' "${flaky[@]}"
echo "$total_passed passed, $total_failed failed$([ "$total_skipped" = 0 ] || echo ", $total_skipped skipped")"
[ "$total_failed" = 0 ] && [ "$total_passed" -gt 0 ]
