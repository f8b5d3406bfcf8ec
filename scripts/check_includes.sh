#!/usr/bin/env bash
# Checks the arrows and seams of docs/architecture.md:
#   - a file in src/ includes only rooms that its library names in DEPENDS, and those names form no ring;
#   - include/ includes nothing but include/; src/ nothing from apps/, bench/, fuzz/, examples/ or tests/; apps/, bench/ and
#     examples/ nothing from each other or from tests/, except `hapticd bench` the options of the suite that it runs;
#     examples/ only include/, and only tests/examples/ includes them;
#   - realtime code includes no header that can lock, block or print;
#   - only src/base starts threads, opens files, reads clocks or random numbers, or sleeps.
set -euo pipefail
cd "$(dirname "$0")/.."

# Includes against the arrows that are still to be removed: the file and what it includes.
arrow_exceptions() {
  cat <<'LIST'
LIST
}

# Hardware access: the node of an input device, and the standard input that a vendor's library must not read. And the list of
# the system calls that a confined process may make, which names some. These stay.
hardware_exceptions() {
  cat <<'LIST'
src/device/evdev/event_device.cpp
src/device/openhaptics/hd_scheduler.cpp
src/mesh_io/confined_process.cpp
LIST
}

# Files that still reach past src/base.
seam_exceptions() {
  cat <<'LIST'
LIST
}

{
  arrow_exceptions | sed 's/^/allowed /'
  # Libraries: "library FOLDER NAME DEPENDS...", from hapticd_library(NAME ... DEPENDS ... LIBS|PRIVATE_LIBS|SOURCES ...).
  find src -name CMakeLists.txt | while IFS= read -r file; do
    sed 's/#.*//' "$file" | tr '\n' ' ' | grep -o 'hapticd_library([^)]*)' | sed "s|hapticd_library(|library ${file%/CMakeLists.txt} |; s|)||"
  done
  # Files: what an include can name.
  find src include apps bench fuzz examples tests -name '*.h' -o -name '*.hpp' | sed 's/^/file /'
  # Includes: "include FILE:LINE:TEXT".
  grep -rnE '^[[:space:]]*#[[:space:]]*include "' src include apps bench fuzz examples tests --include='*.h' --include='*.cpp' | sed 's/^/include /'
} | awk '
  function fail(text) { print text; bad = 1 }
  function area(path) { sub(/\/.*/, "", path); return path }
  function room(path) {  # the library whose folder holds this file
    while (sub(/\/[^\/]*$/, "", path)) if (path in library) return library[path]
    return ""
  }
  function resolve(from, target,   folder) {
    folder = from; sub(/[^\/]*$/, "", folder)
    if ((folder target) in file) return folder target
    if (("src/" target) in file) return "src/" target
    if (("include/" target) in file) return "include/" target
    if (("include/hapticd/vrpn/" target) in file) return "include/hapticd/vrpn/" target
    if (("tests/" target) in file) return "tests/" target
    if (target in file) return target
    return ""
  }
  # Depth first; path is the rooms on the way here.
  function visit(name, path,   i, n, list) {
    if (state[name] == "done") return
    if (state[name] == "open") { fail("ring among the rooms:" path " " name); return }
    state[name] = "open"
    n = split(depends[name], list, " ")
    for (i = 1; i <= n; i++) visit(list[i], path " " name)
    state[name] = "done"
  }
  BEGIN {
    above["src"] = " apps bench fuzz examples tests "
    above["include"] = " src apps bench fuzz examples tests "
    above["apps"] = " bench fuzz examples tests "
    above["bench"] = " apps fuzz examples tests "
    above["examples"] = " src apps bench fuzz tests "
    above["fuzz"] = " apps bench examples "
    above["tests"] = " examples "
  }
  $1 == "library" {
    library[$2] = $3
    keep = 0
    for (i = 4; i <= NF; i++) {
      if ($i == "DEPENDS") { keep = 1; continue }
      if ($i ~ /^(SOURCES|LIBS|PRIVATE_LIBS)$/) { keep = 0; continue }
      if (keep) depends[$3] = depends[$3] " " $i
    }
    depends[$3] = depends[$3] " "
    next
  }
  $1 == "allowed" { allowed[$2 " " $3] = 1; next }
  $1 == "file" { file[$2] = 1; next }
  {
    line = substr($0, 9)
    split(line, part, ":")
    from = part[1]
    target = line; sub(/^[^"]*"/, "", target); sub(/".*/, "", target)
    to = resolve(from, target)
    if (to == "") next
    if (from ~ /^tests\/examples\// && area(to) == "examples") next
    if (from == "apps/bench.cpp" && to == "bench/options.h") next
    if (index(above[area(from)], " " area(to) " ")) fail(from ":" part[2] ": " area(from) "/ may not include " to)
    if (area(from) != "src" || area(to) != "src") next
    a = room(from); b = room(to)
    if ((from " " to) in allowed) { seen[from " " to] = 1; next }
    if (a != b && !index(depends[a], " " b " "))
      fail(from ":" part[2] ": \"" a "\" may not include " to " (\"" b "\" is not in its DEPENDS)")
  }
  END {
    for (folder in library) visit(library[folder], "")
    for (arrow in allowed) print "includes: to do: " arrow (arrow in seen ? "" : " is gone: delete its exception in scripts/check_includes.sh")
    if (!bad) print "includes: every arrow is a declared one, and there is no ring"
    exit bad
  }' && bad=0 || bad=1

if grep -rnE '^[[:space:]]*#include <(mutex|shared_mutex|condition_variable|future|iostream|fstream|sstream|spdlog/.*|boost/.*)>' src/realtime; then
  echo "realtime code may not include the headers above: they lock, block or print"
  bad=1
fi

# The seams. The types std::thread::id and std::this_thread::get_id() start no thread.
seam='std::j?thread|std::async|(^|[^[:alnum:]_>.])::open\(|fopen\(|std::[io]?fstream|clock_gettime|(steady|system)_clock::now|std::time\(|random_device|getrandom|sleep_for'
{
  hardware_exceptions | sed 's/^/hardware /'
  seam_exceptions | sed 's/^/exception /'
  grep -rnE "$seam" src --include='*.h' --include='*.cpp' | grep -v '^src/base/' | sed 's/^/use /'
} | SEAM=$seam awk '
  BEGIN { seam = ENVIRON["SEAM"] }
  $1 == "hardware" { listed[$2] = stays[$2] = 1; next }
  $1 == "exception" { listed[$2] = 1; next }
  {
    where = $2; sub(/:.*/, "", where)
    shown = substr($0, 5)
    text = shown; sub(/^[^:]*:[^:]*:/, "", text); sub(/\/\/.*/, "", text)
    gsub(/std::j?thread::(id|hardware_concurrency)/, "", text)
    if (text !~ seam) next
    if (where in listed) { used[where]++; next }
    print shown
    bad = 1
  }
  END {
    for (where in listed) {
      if (where in used && where in stays) continue
      if (where in used) { todo++; uses += used[where] }
      else print "seams: " where " is clean now: delete its exception in scripts/check_includes.sh"
    }
    if (bad) print "seams: only src/base may do what the lines above do"
    else if (todo) print "seams: to do: " uses " places in the " todo " files that scripts/check_includes.sh lists"
    else print "seams: only src/base starts threads, opens files, reads clocks or random numbers"
    exit bad
  }' || bad=1
exit "$bad"
