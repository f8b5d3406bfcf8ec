#!/usr/bin/env bash
# Configures build/release for the programs alone: the tests need packages that the programs do not. A build that exists keeps its
# choice of tests and of unity files, so that nothing is compiled again.
#   scripts/configure_programs.sh [ARGUMENT OF CMAKE...]
set -euo pipefail
cd "$(dirname "$0")/.."

# cached NAME ELSE
cached() { [ ! -e build/release/CMakeCache.txt ] && echo "$2" || sed -n "s/^$1:.*=//p" build/release/CMakeCache.txt; }
exec cmake --preset release -DHAPTICD_TESTS="$(cached HAPTICD_TESTS OFF)" -DHAPTICD_UNITY="$(cached HAPTICD_UNITY ALL)" "$@"
