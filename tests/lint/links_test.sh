#!/usr/bin/env bash
# links_test.sh SOURCE: the relative links of all pages lead to files, and their anchors to headings.
set -euo pipefail
cd "$1"
git rev-parse --git-dir >/dev/null 2>&1 || exit 77 # the tree of an archive
git ls-files --cached --others --exclude-standard '*.md' | xargs awk '
  function slug(text) {
    gsub(/`/, "", text)
    while (match(text, /\[[^]]*\]\([^)]*\)/)) {
      link = substr(text, RSTART + 1, RLENGTH - 1)
      text = substr(text, 1, RSTART - 1) substr(link, 1, index(link, "]") - 1) substr(text, RSTART + RLENGTH)
    }
    text = tolower(text)
    gsub(/[^a-z0-9_ -]/, "", text)
    gsub(/ /, "-", text)
    return text
  }
  # The file that a link of a page leads to, without "." and "..".
  function resolved(page, link,   n, parts, i, depth, path) {
    sub(/[^\/]*$/, "", page)
    n = split(page link, parts, "/")
    for (i = 1; i <= n; ++i) {
      if (parts[i] == "..") --depth
      else if (parts[i] != "." && parts[i] != "") kept[++depth] = parts[i]
    }
    for (i = 1; i <= depth; ++i) path = path (i > 1 ? "/" : "") kept[i]
    return path
  }
  FNR == 1 { fenced = 0 }
  /^ *```/ { fenced = !fenced; next }
  fenced { next }
  /^#+ / { heading = $0; sub(/^#+ /, "", heading); anchors[FILENAME "#" slug(heading)] = 1 }
  {
    line = $0
    while (match(line, /\]\([^) ]+\)/)) {
      link = substr(line, RSTART + 2, RLENGTH - 3)
      line = substr(line, RSTART + RLENGTH)
      if (link ~ /^[a-z]+:/) continue
      ++links
      anchor = index(link, "#") ? substr(link, index(link, "#") + 1) : ""
      sub(/#.*/, "", link)
      file = link == "" ? FILENAME : resolved(FILENAME, link)
      places[links] = FILENAME ":" FNR
      files[links] = file
      wanted[links] = anchor
    }
  }
  END {
    for (i = 1; i <= links; ++i) {
      command = "test -e \"" files[i] "\""
      if (!(files[i] in exists)) exists[files[i]] = system(command) == 0
      if (!exists[files[i]]) { print places[i] ": there is no " files[i]; bad = 1 }
      else if (wanted[i] != "" && files[i] ~ /\.md$/ && !((files[i] "#" wanted[i]) in anchors)) {
        print places[i] ": " files[i] " has no heading #" wanted[i]
        bad = 1
      }
    }
    if (links < 300) { print "only " links " links were found"; bad = 1 }
    exit bad
  }'
