#!/usr/bin/env bash
# Draws how stiff a wall may be at each servo rate, as SVG: the passivity bound, and the stiffest wall that settled.
#   HAPTICD_STIFFNESS_CSV=stiffness.csv build/release/bin/closed_loop_test --gtest_filter='ClosedLoopLimit.*'
#   scripts/draw_stiffness.sh stiffness.csv > docs/figures/stiffness_against_rate.svg
set -euo pipefail
[ $# = 1 ] || { sed -n '2,4s/^# *//p' "$0"; exit 2; }
awk -F, -v width=620 -v height=340 '
  function place(value, from, to) { return (log(value) - log(from)) / (log(to) - log(from)) }
  function x(rate) { return sprintf("%.1f", 90 + place(rate, rate_Hz[1] / 1.3, rate_Hz[n] * 1.3) * width) }
  function y(k) { return sprintf("%.1f", 40 + (1 - place(k, 1000, 100000)) * height) }
  FNR == 1 { next }
  { n++; rate_Hz[n] = $1; bound[n] = $2; measured[n] = $3 }
  END {
    if (n < 2) { print "draw_stiffness.sh: fewer than two rates in the file" > "/dev/stderr"; exit 1 }
    printf "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %d %d\" font-family=\"sans-serif\" font-size=\"15\">\n", width + 120, height + 110
    print "<rect width=\"100%\" height=\"100%\" fill=\"#fbfaf7\"/>"
    printf "<g stroke=\"#6b7f92\" stroke-opacity=\"0.3\">"
    for (k = 1000; k <= 100000; k *= 10) for (i = 1; i <= 5; i += i == 1 ? 1 : 3)
      if (k * i <= 100000) printf "<path d=\"M90 %sH%d\"/>", y(k * i), 90 + width
    print "</g><g fill=\"#555\" font-size=\"13\" text-anchor=\"end\">"
    for (k = 1000; k <= 100000; k *= 10) printf "<text x=\"82\" y=\"%.1f\">%d N/m</text>", y(k) + 5, k
    print "</g><g fill=\"#555\" font-size=\"13\" text-anchor=\"middle\">"
    for (i = 1; i <= n; i++) printf "<text x=\"%s\" y=\"%d\">%g Hz</text>", x(rate_Hz[i]), height + 62, rate_Hz[i]
    print "</g>"
    printf "<polyline fill=\"none\" stroke=\"#1c6bb0\" stroke-width=\"1.6\" points=\""
    for (i = 1; i <= n; i++) printf "%s,%s ", x(rate_Hz[i]), y(bound[i])
    print "\"/>\n<g fill=\"#d9722e\">"
    for (i = 1; i <= n; i++) printf "<circle cx=\"%s\" cy=\"%s\" r=\"5\"/>", x(rate_Hz[i]), y(measured[i])
    printf "</g>\n<text x=\"90\" y=\"%d\" fill=\"#1c6bb0\">passive: K = 2 b / T, b = 5 N s/m</text>", height + 92
    printf "<text x=\"%d\" y=\"%d\" fill=\"#d9722e\">measured: stiffest wall that settles in a second</text></svg>\n", 390, height + 92
  }' "$1"
