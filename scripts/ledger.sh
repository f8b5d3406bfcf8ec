# Sourced by judge.sh and soak.sh: runs a program for hours on all processors, with seeds that were not run before, and
# appends a row to a ledger in docs/ledgers.md. The caller defines usage().

# read_hours ARGUMENTS...: sets jobs and seconds.
read_hours() {
  local hours=
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
}

# build_for_ledger TARGET NAME SOURCES...: brings TARGET up to date; sets commit, and work to build/NAME/COMMIT.
build_for_ledger() {
  local target=$1 name=$2
  shift 2
  cmake --preset release >/dev/null
  cmake --build build/release --target "$target" -- -j "$jobs"
  commit=$(git rev-parse --short=10 HEAD)
  [ -z "$(git status --porcelain --untracked-files=no -- "$@")" ] || commit+="+changes"
  work=build/$name/$commit
  mkdir -p "$work"
}

# run_jobs FUNCTION: calls 'FUNCTION FIRST_SEED' once for each job; its output goes to $work/JOB.log. Every run has a block
# of 2^30 seeds of its own, and every job a sixteenth of it.
run_jobs() {
  local base job pids=()
  base=$(date +%s)
  for ((job = 0; job < jobs; ++job)); do
    "$1" $(((base << 30) + (job << 26))) >"$work/$job.log" 2>&1 &
    pids+=($!)
  done
  for pid in "${pids[@]}"; do wait "$pid" || true; done
}

# append_row LEDGER ROW: LEDGER is what the comment at its end calls it. Fails when ROW ends in other than 0 findings.
append_row() {
  local line
  line="| $(date -u +%Y-%m-%d) | $commit | $2 |"
  echo "$line"
  sed -i "s%^<!-- end of the ledger of $1 -->\$%${line//%/\\%}\n&%" docs/ledgers.md
  [ "${2##* }" = 0 ]
}
