# Sourced by mutate.sh and mutate_sim.sh: the clone that is changed, and the changes.

# prepare_clone SOURCE: sets work and tree, a clone of the last commit of SOURCE. In MUTATE_WORK, if set, both stay for the next run.
prepare_clone() {
  if [ -n "${MUTATE_WORK:-}" ]; then
    work=$MUTATE_WORK
    mkdir -p "$work"
  else
    work=$(mktemp -d)
    trap 'rm -rf "$work"' EXIT
  fi
  tree=$work/tree
  [ -d "$tree" ] || git clone -q "$1" "$tree"
  git -C "$tree" fetch -q "$1" HEAD
  git -C "$tree" reset -q --hard FETCH_HEAD
}

# change_once OLD NEW FILE: prints FILE with the one place where OLD stands changed to NEW; fails unless there is exactly one.
change_once() {
  OLD=$1 NEW=$2 awk '
    { text = text $0 "\n" }
    END { old = ENVIRON["OLD"]; at = index(text, old); rest = substr(text, at + length(old))
          if (at == 0 || index(rest, old) != 0) exit 1
          printf "%s%s%s", substr(text, 1, at - 1), ENVIRON["NEW"], rest }' "$3"
}

# build_clone TARGETS...: in $work/build; output in $work/build.log.
build_clone() { ninja -C "$work/build" "${MUTATE_JOBS:--j2}" "$@" >"$work/build.log" 2>&1; }
