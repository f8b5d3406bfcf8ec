#!/usr/bin/env bash
# Draws what was felt: the mesh seen from the front, the way of the hand, of the proxy, and the forces, as SVG.
#   scripts/draw_stroke.sh MESH.obj SIZE_MM FELT.csv > stroke.svg
# with FELT.csv from 'hapticd render --mesh MESH.obj --size-mm SIZE_MM'; the README's picture is
#   hapticd render --mesh testdata/meshes/bunny.obj --size-mm 73 --hand examples/hands/bunny_outline.csv --out felt.csv --raw
set -euo pipefail
[ $# = 3 ] || { sed -n '2,5s/^# *//p' "$0"; exit 2; }
awk -v scale=9 -v size="$2" '
  function x(mm) { return sprintf("%.1f", (mm - min_x) * scale + 30) }
  function y(mm) { return sprintf("%.1f", (max_y - mm) * scale + 30) }
  function fit(   i, extent, z_min, z_max) {  # as --size-mm does: centred, with this largest extent
    extent = max_x - min_x; if (max_y - min_y > extent) extent = max_y - min_y
    for (i = 1; i <= n; i++) { if (i == 1 || vz[i] < z_min) z_min = vz[i]; if (i == 1 || vz[i] > z_max) z_max = vz[i] }
    if (z_max - z_min > extent) extent = z_max - z_min
    for (i = 1; i <= n; i++) { vx[i] = (vx[i] - (min_x + max_x) / 2) * size / extent; vy[i] = (vy[i] - (min_y + max_y) / 2) * size / extent }
    i = (max_x - min_x) / 2 * size / extent; min_x = -i; max_x = i
    i = (max_y - min_y) / 2 * size / extent; min_y = -i; max_y = i
  }
  FNR == NR && $1 == "v" { n++; vx[n] = $2; vy[n] = $3; vz[n] = $4
    if (n == 1 || $2 < min_x) min_x = $2; if (n == 1 || $2 > max_x) max_x = $2
    if (n == 1 || $3 < min_y) min_y = $3; if (n == 1 || $3 > max_y) max_y = $3; next }
  FNR == NR && $1 == "f" { m++; for (i = 2; i <= 4; i++) { split($i, part, "/"); corner[m, i] = part[1] }; next }
  FNR == NR { next }
  FNR == 1 { fit() }
  FNR == 1 { count = split($0, name, ","); for (i = 1; i <= count; i++) at[name[i]] = i; FS = ","; next }
  { k++; split($0, c, ",")
    hx[k] = c[at["hip_x_m"]] * 1000; hy[k] = c[at["hip_y_m"]] * 1000; px[k] = c[at["proxy_x_m"]] * 1000; py[k] = c[at["proxy_y_m"]] * 1000
    fx[k] = c[at["force_x_N"]]; fy[k] = c[at["force_y_N"]]; touching[k] = c[at["touching"]] }
  END {
    min_x -= 4; max_x += 4; min_y -= 2; max_y += 4
    printf "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %d %d\" font-family=\"sans-serif\" font-size=\"15\">\n", (max_x - min_x) * scale + 60, (max_y - min_y) * scale + 60
    print "<rect width=\"100%\" height=\"100%\" fill=\"#fbfaf7\"/><g fill=\"#8fa3b5\" fill-opacity=\"0.10\" stroke=\"#6b7f92\" stroke-opacity=\"0.25\" stroke-width=\"0.5\">"
    for (j = 1; j <= m; j++) { a = corner[j, 2]; b = corner[j, 3]; d = corner[j, 4]
      printf "<path d=\"M%s %sL%s %sL%s %sz\"/>", x(vx[a]), y(vy[a]), x(vx[b]), y(vy[b]), x(vx[d]), y(vy[d]) }
    print "</g><g stroke=\"#d9722e\" stroke-width=\"1.6\" stroke-opacity=\"0.8\">"
    for (j = 1; j <= k; j += 60) if (touching[j])
      printf "<line x1=\"%s\" y1=\"%s\" x2=\"%s\" y2=\"%s\"/>", x(px[j]), y(py[j]), x(px[j] + fx[j] * 3), y(py[j] + fy[j] * 3)
    print "</g>"
    printf "<polyline fill=\"none\" stroke=\"#555\" stroke-dasharray=\"5 4\" points=\""; for (j = 1; j <= k; j += 10) printf "%s,%s ", x(hx[j]), y(hy[j]); print "\"/>"
    printf "<polyline fill=\"none\" stroke=\"#1c6bb0\" stroke-width=\"3\" points=\""; for (j = 1; j <= k; j += 10) printf "%s,%s ", x(px[j]), y(py[j]); print "\"/>"
    print "<g transform=\"translate(24 30)\"><text fill=\"#1c6bb0\">proxy: stays on the surface</text><text y=\"20\" fill=\"#555\">hand: presses into it</text><text y=\"40\" fill=\"#d9722e\">force on the hand</text></g></svg>"
  }' "$1" "$3"
