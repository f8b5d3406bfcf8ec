#!/usr/bin/env bash
# scripts/configure_programs.sh in a fresh copy of the sources, where the packages of tests, page and benchmarks cannot be found.
#   programs_alone_test.sh SOURCES
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$1"
cp -r CMakeLists.txt CMakePresets.json cmake src include apps bench examples tests scripts packaging web "$work"
cd "$work"
scripts/configure_programs.sh -DHAPTICD_WEB=OFF -DCMAKE_DISABLE_FIND_PACKAGE_GTest=ON -DCMAKE_DISABLE_FIND_PACKAGE_rapidcheck=ON \
  -DCMAKE_DISABLE_FIND_PACKAGE_benchmark=ON
ninja -C build/release -t query hapticd >/dev/null
