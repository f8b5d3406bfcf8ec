#!/usr/bin/env bash
# `hapticd bench` runs the suite beside it with all arguments, and says what is missing where there is none.
#   suite_test.sh HAPTICD
set -euo pipefail
hapticd=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

"$hapticd" bench --list | tee "$work/list"
grep -q '^tick  ' "$work/list"
"$hapticd" bench --help | grep -q -- '--full'
"$hapticd" --help | grep -q '^ *bench '

status=0
"$hapticd" bench nosuchthing 2>"$work/error" || status=$?
[ "$status" = 2 ]
grep -q "there is no benchmark 'nosuchthing'" "$work/error"

ln "$hapticd" "$work/hapticd" 2>/dev/null || cp "$hapticd" "$work/hapticd"
status=0
"$work/hapticd" bench --list 2>"$work/error" || status=$?
cat "$work/error"
[ "$status" = 1 ]
grep -q "$work/hapticd-bench: No such file" "$work/error"
