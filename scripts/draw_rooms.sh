#!/usr/bin/env bash
# Draws which room may include which, from the DEPENDS of the CMakeLists.txt below src/. Fails when there is a ring.
#   scripts/draw_rooms.sh > docs/figures/rooms.svg
#   scripts/draw_rooms.sh --check      fails when docs/figures/rooms.svg is out of date
#   scripts/draw_rooms.sh --dot        for Graphviz: scripts/draw_rooms.sh --dot | dot -Tsvg > rooms.svg
# A direct arrow is omitted where a longer path leads to the same room. What a room may include is decided by DEPENDS alone.
set -euo pipefail
cd "$(dirname "$0")/.."

# The value of ${HAPTICD_DRIVER_ROOMS}, as src/device/CMakeLists.txt computes it.
driver_rooms() { sed -n 's/^set(HAPTICD_DRIVERS \(.*\))$/\1/p' src/device/CMakeLists.txt | sed 's/[^ ][^ ]*/device_&/g'; }

rooms() {  # one line for each library: NAME DEPENDENCY...
  find src -name CMakeLists.txt -print0 | sort -z | xargs -0 sed 's/#.*//' | tr '\n' ' ' | grep -o 'hapticd_library([^)]*)' |
    sed "s/hapticd_library(//; s/)//; s/\${HAPTICD_DRIVER_ROOMS}/$(driver_rooms)/" |
    awk '{ keep = 0; line = $1
           for (i = 2; i <= NF; i++) {
             if ($i == "DEPENDS") { keep = 1; continue }
             if ($i ~ /^(SOURCES|LIBS|PRIVATE_LIBS)$/) { keep = 0; continue }
             if (keep) line = line " " $i
           }
           print line }' | sort
}

draw() {  # svg | dot
  rooms | awk -v format="$1" '
    { name[++rooms] = $1; id[$1] = rooms; for (i = 2; i <= NF; i++) wanted[rooms, ++count[rooms]] = $i }

    # The longest chain of dependencies below a room; a ring ends the run.
    function levelOf(n,   i, below, most) {
      if (visiting[n]) { print "ring through the room " name[n] > "/dev/stderr"; failed = 1; exit 1 }
      if (n in level) return level[n]
      visiting[n] = 1
      most = -1
      for (i = 1; i <= count[n]; i++) { below = levelOf(id[wanted[n, i]]); if (below > most) most = below }
      visiting[n] = 0
      return level[n] = most + 1
    }
    # Whether b is below a by a way of two or more arrows.
    function isIndirect(a, b,   i, next_room) {
      for (i = 1; i <= count[a]; i++) {
        next_room = id[wanted[a, i]]
        if (next_room != b && reaches(next_room, b)) return 1
      }
      return 0
    }
    function reaches(a, b,   i, key) {
      key = a SUBSEP b
      if (key in known) return known[key]
      if (a == b) return 1
      for (i = 1; i <= count[a]; i++) if (reaches(id[wanted[a, i]], b)) return known[key] = 1
      return known[key] = 0
    }
    function label(n,   text) { text = name[n]; sub(/^server_/, "server/", text); sub(/^device_/, "device/", text); return text }
    function place(n, row) { rowOf[n] = row; at[row, ++size[row]] = n; order[n] = size[row] }
    # Sorts a row by the mean place of the neighbours in the row above (up = 1) or below it.
    function arrange(row, up,   i, j, k, n, other, sum, number, key) {
      for (i = 1; i <= size[row]; i++) {
        n = at[row, i]; sum = number = 0
        for (k = 1; k <= links; k++) {
          if (up && tail[k] != "" && head[k] == n) other = tail[k]
          else if (!up && tail[k] == n) other = head[k]
          else continue
          sum += order[other] / (size[rowOf[other]] + 1); number++
        }
        weight[n] = number ? sum / number : order[n] / (size[row] + 1)
      }
      for (i = 2; i <= size[row]; i++) {
        key = at[row, i]
        for (j = i - 1; j >= 1 && weight[at[row, j]] > weight[key]; j--) at[row, j + 1] = at[row, j]
        at[row, j + 1] = key
      }
      for (i = 1; i <= size[row]; i++) order[at[row, i]] = i
    }
    function width(n) { return n > rooms ? 14 : 7.4 * length(label(n)) + 18 }

    END {
      if (failed) exit 1
      for (n = 1; n <= rooms; n++)
        for (i = 1; i <= count[n]; i++)
          if (!(wanted[n, i] in id)) { print name[n] " depends on " wanted[n, i] ", which is no room" > "/dev/stderr"; exit 1 }
      for (n = 1; n <= rooms; n++) { levelOf(n); if (level[n] > top) top = level[n] }
      if (format == "dot") {
        print "digraph rooms {\n  node [shape=box]"
        for (n = 1; n <= rooms; n++) for (i = 1; i <= count[n]; i++)
          if (!isIndirect(n, id[wanted[n, i]])) printf "  \"%s\" -> \"%s\"\n", label(n), label(id[wanted[n, i]])
        print "}"
        exit
      }
      for (n = 1; n <= rooms; n++) place(n, level[n])
      nodes = rooms
      # An arrow over several rows goes through a point in each row between.
      for (n = 1; n <= rooms; n++) for (i = 1; i <= count[n]; i++) {
        target = id[wanted[n, i]]
        if (isIndirect(n, target)) continue
        arrows++
        above = n
        for (row = level[n] - 1; row > level[target]; row--) {
          place(++nodes, row); tail[++links] = above; head[links] = nodes; above = nodes
        }
        tail[++links] = above; head[links] = target
      }
      for (pass = 1; pass <= 24; pass++) {
        for (row = top - 1; row >= 0; row--) arrange(row, 1)
        for (row = 1; row <= top; row++) arrange(row, 0)
      }
      for (row = top - 1; row >= 0; row--) arrange(row, 1)

      for (row = 0; row <= top; row++) {
        x = 0
        for (i = 1; i <= size[row]; i++) { n = at[row, i]; middle[n] = x + width(n) / 2; x += width(n) + 16 }
        length_of[row] = x - 16; if (length_of[row] > widest) widest = length_of[row]
      }
      for (row = 0; row <= top; row++) for (i = 1; i <= size[row]; i++) middle[at[row, i]] += (widest - length_of[row]) / 2
      # Moves each point towards its neighbours as far as its own row leaves room.
      for (pass = 1; pass <= 60; pass++) for (row = 0; row <= top; row++) for (i = 1; i <= size[row]; i++) {
        n = at[row, i]; sum = number = 0
        for (k = 1; k <= links; k++) {
          if (head[k] == n) { sum += middle[tail[k]]; number++ }
          if (tail[k] == n) { sum += middle[head[k]]; number++ }
        }
        if (!number) continue
        goal = sum / number
        least = i > 1 ? middle[at[row, i - 1]] + (width(at[row, i - 1]) + width(n)) / 2 + 16 : width(n) / 2
        most = i < size[row] ? middle[at[row, i + 1]] - (width(at[row, i + 1]) + width(n)) / 2 - 16 : widest - width(n) / 2
        if (goal < least) goal = least
        if (goal > most) goal = most
        if (least <= most) middle[n] = goal
      }
      step = 74
      printf "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"-12 -12 %d %d\" font-family=\"sans-serif\" font-size=\"13\">\n", widest + 24, top * step + 58
      print "<!-- Written by scripts/draw_rooms.sh from the DEPENDS of the rooms. -->"
      print "<defs><marker id=\"arrow\" viewBox=\"0 0 8 8\" refX=\"8\" refY=\"4\" markerWidth=\"7\" markerHeight=\"7\" orient=\"auto\"><path d=\"M0 0L8 4L0 8z\" fill=\"#6b7f92\"/></marker></defs>"
      print "<rect x=\"-12\" y=\"-12\" width=\"100%\" height=\"100%\" fill=\"#fbfaf7\"/>"
      print "<g fill=\"none\" stroke=\"#6b7f92\" stroke-width=\"1.2\">"
      for (k = 1; k <= links; k++) {
        if (tail[k] > rooms) continue
        y = (top - rowOf[tail[k]]) * step + 30
        path = sprintf("M%.1f %.1f", middle[tail[k]], y)
        n = tail[k]
        for (j = k; ; j++) {
          down = (top - rowOf[head[j]]) * step
          path = path sprintf("C%.1f %.1f %.1f %.1f %.1f %.1f", middle[n], y + 18, middle[head[j]], down - 18, middle[head[j]], down)
          n = head[j]
          if (n <= rooms) break
          y = down + 30
          path = path sprintf("L%.1f %.1f", middle[n], y)
        }
        printf "<path d=\"%s\" marker-end=\"url(#arrow)\"/>\n", path
      }
      print "</g><g text-anchor=\"middle\" fill=\"#22303c\">"
      for (n = 1; n <= rooms; n++) {
        colour = name[n] ~ /^server/ ? "#dce8f5" : name[n] ~ /^device/ ? "#e6f0dc" : name[n] ~ /^(render|servo|realtime)$/ ? "#f7e0cf" : "#ffffff"
        printf "<rect x=\"%.1f\" y=\"%d\" width=\"%.1f\" height=\"30\" rx=\"4\" fill=\"%s\" stroke=\"#6b7f92\"/>", middle[n] - width(n) / 2, (top - level[n]) * step, width(n), colour
        printf "<text x=\"%.1f\" y=\"%d\">%s</text>\n", middle[n], (top - level[n]) * step + 20, label(n)
      }
      printf "</g></svg>\n"
      printf "rooms: %d rooms, %d arrows, %d rows, no ring\n", rooms, arrows, top + 1 > "/dev/stderr"
    }'
}

case "${1:-}" in
  "") draw svg ;;
  --dot) draw dot ;;
  --check) draw svg | cmp -s - docs/figures/rooms.svg || { echo "docs/figures/rooms.svg is out of date: scripts/draw_rooms.sh > docs/figures/rooms.svg"; exit 1; } ;;
  *) sed -n '2,6s/^# *//p' "$0"; exit 2 ;;
esac
