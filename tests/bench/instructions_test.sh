#!/usr/bin/env bash
# Fails when one round of a tick, of encoding, of decoding or of publishing takes over 10 % more instructions than it did: a
# guard that no other work on the machine disturbs.
#   instructions_test.sh PROGRAM REFERENCE            compares
#   instructions_test.sh PROGRAM REFERENCE --write    takes the present figures as the reference
set -euo pipefail
program=$1
reference=$2
skipped=77 # ctest's SKIP_RETURN_CODE
command -v valgrind >/dev/null || { echo "valgrind is missing (packages.txt has it): not counted"; exit "$skipped"; }
# One thread, and the instructions that every x86-64-v2 machine has.
export HAPTICD_EMBREE="isa=sse4.2,threads=1,user_threads=1"

# instructions WHAT ROUNDS: of the whole process.
instructions() {
  valgrind --tool=callgrind --callgrind-out-file=/dev/null "$program" "$1" "$2" 2>&1 >/dev/null |
    sed -nE 's/.*Collected : ([0-9]+).*/\1/p'
}

# The difference of two runs is free of the set-up.
of_one_round() {
  local few many
  few=$(instructions "$1" 1000)
  many=$(instructions "$1" 2000)
  [ -n "$few" ] && [ -n "$many" ] || { echo "callgrind gave no figure for $1" >&2; return 1; }
  echo $(((many - few) / 1000))
}

if [ "${3:-}" = --write ]; then
  for what in contact slide tap encode decode poses; do echo "$what $(of_one_round "$what")"; done | tee "$reference"
  exit 0
fi
failed=0
while read -r what before; do
  now=$(of_one_round "$what")
  change=$(((now - before) * 1000 / before))
  echo "$what: $now instructions, reference $before ($((change / 10)) %)"
  if [ "$change" -gt 100 ]; then
    echo "  over 10 % more than the reference; if that is wanted: $0 $program $reference --write"
    failed=1
  fi
done <"$reference"
exit "$failed"
