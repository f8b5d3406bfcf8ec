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

# A folder that cannot be written is refused before the measurement, not after it: a long one takes an hour.
: > "$work/file"
for folder in "$work/file" "$work/file/results"; do
  status=0
  "$hapticd" bench tick --out "$folder" >"$work/output" 2>"$work/error" || status=$?
  [ "$status" = 1 ]
  grep -q "^hapticd bench: cannot write to '$folder': Not a directory; name a folder" "$work/error"
  [ ! -s "$work/output" ]
done

# A benchmark that cannot be measured, here for want of descriptors, is no success; what there is, is written.
status=0
(ulimit -n 10; exec "$hapticd" bench fanout --out "$work/new/results") >"$work/output" 2>"$work/error" || status=$?
cat "$work/output" "$work/error"
[ "$status" = 1 ]
grep -q "NOT MEASURED: " "$work/output"
grep -q "NOT MEASURED: " "$work/new/results/results.md"

for what in --list "--list --json" --help; do
  status=0
  "$hapticd" bench $what >/dev/full 2>"$work/error" || status=$?  # unquoted: two options
  [ "$status" = 1 ]
  grep -qE "^hapticd( bench)?: cannot write to standard output" "$work/error"
done

ln "$hapticd" "$work/hapticd" 2>/dev/null || cp "$hapticd" "$work/hapticd"
status=0
"$work/hapticd" bench --list 2>"$work/error" || status=$?
cat "$work/error"
[ "$status" = 1 ]
grep -q "$work/hapticd-bench: No such file" "$work/error"

# What was typed reaches it.
printf '#!/bin/sh\nprintf "<%%s>" "$@"\n' >"$work/hapticd-bench"
chmod +x "$work/hapticd-bench"
all=$("$work/hapticd" bench tick --json --list deform --full --long '--out=-a folder')
[ "$all" = '<tick><deform><--list><--json><--full><--long><--out><-a folder>' ] || { echo "$all"; exit 1; }
[ "$("$work/hapticd" bench)" = '<>' ]
