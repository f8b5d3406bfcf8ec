#!/usr/bin/env bash
# Checks that every row of docs/hazards.md names tests, in its last column, and that each of them exists.
set -euo pipefail
cd "$(dirname "$0")/.."

{
  grep -rhozE '\bTEST(_F|_P)?\([[:space:]]*[A-Za-z0-9_]+,[[:space:]]*[A-Za-z0-9_]+[[:space:]]*\)' tests --include='*.cpp' --include='*.h' |
  tr -d '\n ' | tr '\0' '\n' | sed -E 's/^TEST(_F|_P)?\(//; s/\)$//; s/,/./'
  ls tests/web/*_test.mjs tests/web/unit/*.test.mjs | sed -E 's!.*/!web.!; s![._]test.mjs$!!'  # as ctest names them
} |
  awk '
    FNR == NR { test[$0] = 1; tests++; next }
    !/^\| / || /^\| hazard / { next }
    {
      n = split($0, cell, /[[:space:]]*\|[[:space:]]*/)
      hazard = cell[2]; shown = cell[n - 1]
      rows++
      named = 0
      while (match(shown, /`[A-Za-z0-9_]+\.[A-Za-z0-9_]+`/)) {
        name = substr(shown, RSTART + 1, RLENGTH - 2)
        shown = substr(shown, RSTART + RLENGTH)
        named++
        if (!(name in test)) { print "docs/hazards.md: \047" hazard "\047: there is no test " name; bad = 1 }
      }
      all += named
      if (n != 7) { print "docs/hazards.md: \047" hazard "\047: a row has five cells"; bad = 1 }
      if (!named) { print "docs/hazards.md: \047" hazard "\047: no test shows what acts"; bad = 1 }
    }
    END {
      if (tests < 100 || rows < 10) { print "docs/hazards.md: too few tests or rows were found: " tests + 0 ", " rows + 0; bad = 1 }
      if (!bad) print "hazards: " rows " rows name " all " tests"
      exit bad
    }' - docs/hazards.md
