#!/usr/bin/env bash
# Compares the binary interface of the shared libraries with the committed lists in abi/: exported symbols, and sizes of
# public structs.
#   abi_test.sh LIBHAPTICD LIBHAPTICD_VRPN LAYOUT_PROGRAM [--update]
set -euo pipefail
lists=$(cd "$(dirname "$0")" && pwd)/abi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

symbols() {  # without addresses, and without the node of the version script itself
  nm -DC --defined-only "$1" | sed -E 's/^[0-9a-f]* *//; s/@@?[A-Z0-9_]+$//' | grep -vE '^A ' | LC_ALL=C sort
}
symbols "$1" >"$work/libhapticd.txt"
symbols "$2" >"$work/libhapticd_vrpn.txt"
"$3" >"$work/layout.txt"

bad=0
# T, W, V, ...: kind of symbol. Nothing may be exported that is not of the interface.
if grep -vE '^[A-Z] (typeinfo for |typeinfo name for |vtable for )?hapticd::' "$work/libhapticd.txt" ||
   grep -vE '^[A-Z] (typeinfo for |typeinfo name for |vtable for |VTT for |construction vtable for |(non-)?virtual thunk to )?vrpn_' "$work/libhapticd_vrpn.txt"; then
  echo "the symbols above do not belong to the public interface: hide them (src/client/libhapticd.map)"
  bad=1
fi
if grep -E 'Impl|hapticd::(client|wire|net|base|detail)::' "$work/libhapticd.txt"; then
  echo "the symbols above are internal: hide them (HAPTICD_HIDDEN in include/hapticd/export.h)"
  bad=1
fi

if [ "${4:-}" = --update ]; then
  cp "$work"/*.txt "$lists"
  exit "$bad"
fi
for list in libhapticd libhapticd_vrpn layout; do
  if ! diff -u --label "committed $list.txt" --label "built $list.txt" "$lists/$list.txt" "$work/$list.txt"; then
    bad=1
    changed=1
  fi
done
if [ -n "${changed:-}" ]; then
  echo "The binary interface has changed. If that is intended:"
  echo "  1. tests/install/abi_test.sh $1 $2 $3 --update, and commit tests/install/abi/"
  echo "  2. if a line was removed or changed, also raise HAPTICD_ABI in src/client/CMakeLists.txt: programs that"
  echo "     were linked before no longer work"
fi
exit "$bad"
