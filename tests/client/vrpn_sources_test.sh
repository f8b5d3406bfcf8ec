#!/usr/bin/env bash
# Compiles sources that are written for VRPN with our headers: each standard from C++11 with one of the compilers that are
# there, or with --all, with each. Headers of classes that this library does not have name those classes.
#   vrpn_sources_test.sh SOURCE_DIRECTORY [--all]
set -euo pipefail
root=$1
include=$root/include/hapticd/vrpn

check() {  # COMPILER STANDARD
  command -v "$1" >/dev/null || return 0
  echo "$1, C++$2"
  "$1" -std=c++"$2" -fsyntax-only -Wall -I "$include" -I "$root/include" "$root/tests/client/vrpn_sources.cpp"
}
if [ "${2:-}" = --all ]; then
  for compiler in g++ clang++; do
    for standard in 11 14 17 20; do check $compiler $standard; done
  done
else
  check g++ 11
  check clang++ 14
  check clang++ 17
  check g++ 20
fi

headers=(vrpn_{Imager,Sound,FunctionGenerator,EndpointContainer}.h)
errors=$(printf '#include <%s>\n' "${headers[@]}" | g++ -std=c++11 -fsyntax-only -x c++ -I "$include" - 2>&1) && exit 1
for header in "${headers[@]}"; do
  grep -q "$header" <<<"$errors" || { echo "$header has no #error: $errors"; exit 1; }
done
[ "$(grep -Ec 'error: #error "vrpn_[A-Za-z_]+.*build this source with VRPN itself' <<<"$errors")" = "${#headers[@]}" ] || { echo "$errors"; exit 1; }
