#!/usr/bin/env bash
# documented_test.sh HAPTICD SOURCE: the pages name every command, option and key of the configuration with its default, and no
# others; the options of their examples exist, and the program reads their TOML.
set -euo pipefail
hapticd=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$2"
bad=0
differ() {  # TEXT: prints the difference between $work/program and $work/page, sorted
  sort -u -o "$work/program" "$work/program"
  sort -u -o "$work/page" "$work/page"
  { diff "$work/program" "$work/page" || true; } | sed -nE "s|^< |$1 lacks |p; s|^> |$1 has, but not the program: |p" >"$work/diff"
  [ ! -s "$work/diff" ] || { cat "$work/diff"; bad=1; }
}

# The long options of a command, each with the default that its --help shows.
options_of() {
  "$hapticd" "$1" --help | awk '
    /^Options:/ { on = 1; next }
    on && /^$/ { exit }
    on && /^  -/ {
      value = match($0, /=[^ ]+/) ? substr($0, RSTART + 1, RLENGTH - 1) : ""
      n = split($1, names, ",")
      for (i = 1; i <= n; ++i) if (names[i] ~ /^--/ && names[i] != "--help") print names[i], value
    }'
}

# The rows of the tables of a section: what stands in backquotes in the first cell, then the second cell.
rows_of() {  # PAGE HEADING
  awk -v heading="$2" '
    /^#/ { on = index($0 " ", heading) == 1 }
    on && /^\| `/ {
      split($0, cells, " \\| ")
      cell = cells[1]
      while (match(cell, /`[^`]*`/)) {
        split(substr(cell, RSTART + 1, RLENGTH - 2), words, " ")
        print words[1], cells[2]
        cell = substr(cell, RSTART + RLENGTH)
      }
    }' "$1"
}

"$hapticd" --help | awk '/^Subcommands:/ { on = 1; next } on && NF { print $1 }' | grep -vx '' >"$work/commands"
grep -v '^serve$' "$work/commands" >"$work/program"
sed -nE 's/^### `hapticd ([a-z-]+).*/\1/p' docs/commands.md >"$work/page"
differ docs/commands.md
while read -r command; do
  page=docs/commands.md heading="### \`hapticd $command"
  [ "$command" != serve ] || { page=docs/configuration.md heading="## Flags of \`hapticd serve"; }
  options_of "$command" >"$work/options"
  cut -d' ' -f1 "$work/options" >"$work/program"
  rows_of "$page" "$heading" | grep -E '^--' >"$work/rows" || true
  cut -d' ' -f1 "$work/rows" >"$work/page"
  differ "$page, $command:"
  while read -r option value; do
    row=$(grep -E -- "^$option( |$)" "$work/rows" || true)
    [[ $row == *"$value"* ]] || { echo "$page, $command: $option has the default $value, but: $row"; bad=1; }
  done <"$work/options"
done <"$work/commands"

# hapticd COMMAND ... --option, in one line of a page.
grep -hoE 'hapticd [a-z-]+ [^`|#]*' README.md docs/*.md python/*.md | while read -r _ command words; do
  grep -qx -- "$command" "$work/commands" || continue
  [ -s "$work/options.$command" ] || { options_of "$command" && echo --help; } >"$work/options.$command"
  for word in $words; do
    [[ $word =~ ^--[a-zA-Z][a-zA-Z-]*$ ]] || continue
    grep -qE -- "^$word( |$)" "$work/options.$command" || echo "a page has hapticd $command $word"
  done
done >"$work/unknown"
[ ! -s "$work/unknown" ] || { cat "$work/unknown"; bad=1; }

# Keys with their tables and defaults; evdev has those that only some drivers have, too.
"$hapticd" serve --device evdev --check-config |
  awk '/^\[/ { gsub(/[][]/, ""); table = $0; next } / = / { print table "." $1, substr($0, index($0, "=") + 2) }' >"$work/keys"
cut -d' ' -f1 "$work/keys" >"$work/program"
: >"$work/rows"
for section in '.## The server' 'limits.## `[limits]`' 'compat.## `[compat]`' 'device.## Each `[[device]]`'; do
  rows_of docs/configuration.md "${section#*.} " | grep -vE '^(\[|name )' | sed "s/^/${section%%.*}./" >>"$work/rows"
done
cut -d' ' -f1 "$work/rows" >"$work/page"
differ 'docs/configuration.md:'
while read -r key value; do
  [[ $key != device.driver && $key != device.isolate ]] || continue
  value=${value#[} value=${value%]}
  grep -E "^$key " "$work/rows" | grep -qF -- "$value" ||
    { echo "docs/configuration.md: $key is $value by default, but: $(grep -E "^$key " "$work/rows")"; bad=1; }
done <"$work/keys"

# TOML of the pages: configurations, and profiles of wheels.
awk -v work="$work" '
  FNR == 1 { on = 0 }
  /^ *```toml/ { on = 1; file = work "/block" ++n ".toml"; print "# " FILENAME ":" FNR >file; next }
  /^ *```/ { on = 0 }
  on { print >file }' README.md docs/*.md
blocks=0
for block in "$work"/block*.toml; do
  blocks=$((blocks + 1))
  file=$block
  if grep -q '^force_N' "$block"; then
    file=$work/wheel.toml
    printf '[[device]]\ndriver = "evdev"\nwheel_profile = "%s"\n' "$block" >"$file"
  fi
  "$hapticd" serve --config "$file" --check-config >"$work/out" 2>"$work/error" ||
    { echo "$(head -n 1 "$block"): $(cat "$work/error")"; bad=1; }
done
[ "$blocks" -ge 4 ] || { echo "only $blocks blocks of TOML were found"; bad=1; }
exit "$bad"
