#!/usr/bin/env bash
# Fails when the renderer reads memory that nobody wrote. ASan does not see that, and the same program may well give the
# same forces each time.
#   uninitialised_test.sh TRUTH_TEST
set -euo pipefail
command -v valgrind >/dev/null || { echo "valgrind is missing (packages.txt has it): not examined"; exit 77; }
# One thread, and the instructions that every x86-64-v2 machine has.
export HAPTICD_EMBREE="isa=sse4.2,threads=1,user_threads=1"
exec valgrind --quiet --leak-check=no --error-exitcode=1 "$1" --gtest_filter='Renderer.forces_do_not_depend*'
