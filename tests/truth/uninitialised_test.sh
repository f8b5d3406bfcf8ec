#!/usr/bin/env bash
# Fails when the renderer reads memory that nobody wrote. ASan does not see that, and the same program may well give the
# same forces each time. Memcheck follows scenes of many kinds, and two in which a ball climbs out of a corner.
#   uninitialised_test.sh HAPTICD_JUDGE
set -euo pipefail
command -v valgrind >/dev/null || { echo "valgrind is missing (packages.txt has it): not examined"; exit 77; }
# One thread, and the instructions that every x86-64-v2 machine has.
export HAPTICD_EMBREE="isa=sse4.2,threads=1,user_threads=1"
program=$1
judge() { valgrind --quiet --leak-check=no --error-exitcode=1 "$program" --no-shrink "$@"; }
judge --seed 1 --ticks 20000
for seed in 3507 15857; do judge --kind valleys --seed $seed --ticks 1; done
