#!/usr/bin/env bash
# Draws what was felt over time: the size of the force on the hand, and how deep the hand was in the surface, as SVG.
#   scripts/draw_force.sh FELT.csv > force.svg
# with FELT.csv from 'hapticd render'.
set -euo pipefail
[ $# = 1 ] || { sed -n '2,4s/^# *//p' "$0"; exit 2; }
awk -F, -v width=820 -v height=170 '
  function x(s) { return sprintf("%.1f", 60 + (s - t[1]) / (t[n] - t[1]) * width) }
  function y(value, top, row) { return sprintf("%.1f", 40 + row * (height + 50) + (1 - value / top) * height) }
  function above(value) { return int(value) + 1 }
  function panel(row, top, unit, colour, title, value,   i) {
    printf "<g stroke=\"#6b7f92\" stroke-opacity=\"0.3\">"
    for (i = 0; i <= 4; i++) printf "<path d=\"M%s %sH%s\"/>", x(t[1]), y(top * i / 4, top, row), x(t[n])
    print "</g><g fill=\"#555\" font-size=\"13\" text-anchor=\"end\">"
    for (i = 0; i <= 4; i += 2) printf "<text x=\"52\" y=\"%.1f\">%g %s</text>", y(top * i / 4, top, row) + 5, top * i / 4, unit
    printf "</g><polyline fill=\"none\" stroke=\"%s\" stroke-width=\"1.6\" points=\"", colour
    for (i = 1; i <= n; i += 4) printf "%s,%s ", x(t[i]), y(value[i], top, row)
    printf "\"/>\n<text x=\"60\" y=\"%.1f\" fill=\"%s\">%s</text>\n", y(top, top, row) - 10, colour, title
  }
  FNR == 1 { for (i = 1; i <= NF; i++) at[$i] = i; next }
  { n++; t[n] = $at["time_ns"] * 1e-9; force[n] = sqrt($at["force_x_N"]^2 + $at["force_y_N"]^2 + $at["force_z_N"]^2); depth[n] = $at["depth_m"] * 1000
    if (force[n] > most) most = force[n]; if (depth[n] > deepest) deepest = depth[n] }
  END {
    if (n < 2 || t[n] == t[1]) { print "draw_force.sh: no ticks in the file" > "/dev/stderr"; exit 1 }
    printf "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %d %d\" font-family=\"sans-serif\" font-size=\"15\">\n", width + 90, 2 * height + 130
    print "<rect width=\"100%\" height=\"100%\" fill=\"#fbfaf7\"/>"
    panel(0, above(most), "N", "#d9722e", "force on the hand", force)
    panel(1, above(deepest), "mm", "#1c6bb0", "depth of the hand below the surface", depth)
    printf "<g fill=\"#555\" font-size=\"13\" text-anchor=\"middle\">"
    for (s = 0; s <= t[n]; s++) if (s >= t[1]) printf "<text x=\"%s\" y=\"%d\">%g s</text>", x(s), 2 * height + 112, s
    print "</g></svg>"
  }' "$1"
