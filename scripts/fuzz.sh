#!/usr/bin/env bash
# Fuzzes every parser of bytes from outside with libFuzzer (clang 19), on all processors, and appends a row for each target to
# the ledger in docs/ledgers.md.
#   scripts/fuzz.sh --hours N [--jobs N] [TARGET...]    the hours are shared by the targets; without names: all of them
#   scripts/fuzz.sh --pack [TARGET...]                  minimises the corpora and writes them to testdata/fuzz
#   scripts/fuzz.sh --list                              the targets
# Corpora grow in build/fuzz/corpus, from testdata/fuzz. Findings: build/fuzz/findings, run again by
# 'build/fuzz/bin/TARGET_fuzz FILE'. Exit status 1 with findings.
set -euo pipefail
cd "$(dirname "$0")/.."

usage() { sed -n '2,9s/^# *//p' "$0"; exit 2; }
hours=
jobs=$(nproc)
pack=
targets=()
all() { sed -n 's/^void \([a-z_]*\)(Input input);.*/\1/p' fuzz/targets.h; }
while [ $# -gt 0 ]; do
  case "$1" in
    --hours) hours=${2:?"--hours needs a number"}; shift ;;
    --jobs) jobs=${2:?"--jobs needs a number"}; shift ;;
    --pack) pack=yes ;;
    --list) all; exit ;;
    -*) usage ;;
    *) all | grep -qx "$1" || { echo "there is no target '$1'; see scripts/fuzz.sh --list" >&2; exit 2; }
       targets+=("$1") ;;
  esac
  shift
done
[ -n "$hours$pack" ] || usage
[ "${#targets[@]}" -gt 0 ] || mapfile -t targets < <(all)
seconds=$(awk -v h="${hours:-0}" -v j="$jobs" -v n="${#targets[@]}" 'BEGIN { s = 3600 * h * j / n; print s < 1 ? 1 : int(s) }')

scripts/install_packages.sh build sanitizers
[ -e build/fuzz/build.ninja ] || cmake --preset fuzz
cmake --build build/fuzz -- -j "$jobs" fuzz/wire.dict "${targets[@]/%/_fuzz}"
commit=$(git rev-parse --short=10 HEAD)
[ -z "$(git status --porcelain --untracked-files=no -- src fuzz)" ] || commit+="+changes"
export commit seconds
# Short stacks and a small quarantine: the allocator takes most of the time of a short input.
export ASAN_SYMBOLIZER_PATH=/usr/bin/llvm-symbolizer-19
export ASAN_OPTIONS=detect_leaks=1:malloc_context_size=3:quarantine_size_mb=16 LSAN_OPTIONS="suppressions=$PWD/scripts/lsan.supp:print_suppressions=0"
mkdir -p build/fuzz/{corpus,findings,logs} testdata/fuzz

# A packed corpus holds each input behind its length, four bytes with the highest first.
unpack() {
  [ -e "testdata/fuzz/$1.corpus" ] || return 0
  python3 - "testdata/fuzz/$1.corpus" "build/fuzz/corpus/$1" <<'PYTHON'
import hashlib, pathlib, sys
packed, folder = pathlib.Path(sys.argv[1]).read_bytes(), pathlib.Path(sys.argv[2])
while packed:
    size = int.from_bytes(packed[:4], "big")
    content, packed = packed[4:4 + size], packed[4 + size:]
    (folder / hashlib.sha1(content).hexdigest()).write_bytes(content)
PYTHON
}

# The smallest inputs that together cover all that the corpus covers; no corpus takes more than 320 kB.
pack() {
  local small=build/fuzz/small/$1
  rm -rf "$small"
  mkdir -p "$small"
  "build/fuzz/bin/${1}_fuzz" -merge=1 -max_len="$(longest "$1")" "$small" "build/fuzz/corpus/$1" >"build/fuzz/logs/$1.merge" 2>&1
  python3 - "$small" "testdata/fuzz/$1.corpus" "$([[ $1 == mesh_file || $1 == whole_server ]] && echo 60 || echo 100000)" <<'PYTHON'
import pathlib, sys
inputs = sorted((p.read_bytes() for p in pathlib.Path(sys.argv[1]).iterdir()), key=lambda b: (len(b), b))
packed = b""
for content in inputs[:int(sys.argv[3])]:
    if len(packed) + len(content) + 4 <= 320_000:
        packed += len(content).to_bytes(4, "big") + content
pathlib.Path(sys.argv[2]).write_bytes(packed)
PYTHON
  echo "$1: $(find "$small" -type f | wc -l) inputs, $(stat -c %s "testdata/fuzz/$1.corpus") bytes"
}

# Inputs beyond this length reach nothing that shorter ones do not reach, and slow down the search.
longest() {
  case "$1" in
    udp_request) echo 128 ;;
    wire_* | web_socket) echo 768 ;;
    remote_input | isolation_block) echo 2048 ;;
    *) echo 4096 ;;
  esac
}

# One target: its row. The CPU seconds are those of the fuzzer itself and of the readers that it starts.
run() {
  local target=$1 log=build/fuzz/logs/$1.log before after executions last
  before=$(find build/fuzz/findings -name "$target-*" | wc -l)
  TIMEFORMAT='cpu %U %S'
  { time nice -n 19 "build/fuzz/bin/${target}_fuzz" -dict=build/fuzz/fuzz/wire.dict -max_len="$(longest "$target")" \
      -max_total_time="$seconds" -timeout=25 -report_slow_units=25 -rss_limit_mb=3000 -print_final_stats=1 \
      -artifact_prefix="build/fuzz/findings/$target-" "build/fuzz/corpus/$target" >"$log" 2>&1 || true; } 2>"$log.time"
  after=$(find build/fuzz/findings -name "$target-*" | wc -l)
  executions=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
  awk -v date="$(date -u +%Y-%m-%d)" -v commit="$commit" -v target="$target" -v executions="${executions:-0}" \
      -v inputs="$(find "build/fuzz/corpus/$target" -type f | wc -l)" -v findings=$((after - before)) '
    FNR == NR { cpu = $2 + $3; next }
    match($0, /cov: [0-9]+/) {
      now = substr($0, RSTART + 5, RLENGTH - 5) + 0
      at = substr($1, 2) + 0
      if (now > coverage) { coverage = now; last = at }
    }
    END {
      rate = (cpu > 0) ? executions / cpu : 0
      share = (executions > 0) ? 100 * last / executions : 0
      printf "| %s | %s | %s | %d | %.0f | %.1f | %d | %.0f %% | %d | %d |\n", date, commit, target, executions,
             rate, cpu, coverage, share, inputs, findings
    }' "$log.time" "$log" >"build/fuzz/logs/$target.row"
  cat "build/fuzz/logs/$target.row"
}

for target in "${targets[@]}"; do
  mkdir -p "build/fuzz/corpus/$target"
  unpack "$target"
done
if [ -n "$pack" ]; then
  for target in "${targets[@]}"; do pack "$target"; done
  exit 0
fi

export -f run longest
rm -f build/fuzz/logs/*.row
printf '%s\n' "${targets[@]}" | xargs -P "$jobs" -I{} bash -c 'run {}'

# Before the line that marks the end of the ledger.
for target in "${targets[@]}"; do cat "build/fuzz/logs/$target.row"; done >build/fuzz/logs/rows
awk '/^<!-- end of the fuzzing ledger -->$/ { while ((getline row < "build/fuzz/logs/rows") > 0) print row } { print }' \
  docs/ledgers.md >build/fuzz/logs/ledgers.md
cp build/fuzz/logs/ledgers.md docs/ledgers.md
grep -q . build/fuzz/logs/rows && ! grep -vq '| 0 |$' build/fuzz/logs/rows
