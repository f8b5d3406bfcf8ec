#!/usr/bin/env bash
# Changes the laws one at a time and requires a test to fail for each. scripts/mutations.txt holds the list, in entries of
#
#   law: what is changed
#   path of the file
#   -the text as it stands there, exactly once
#   +what it becomes
#   ?test program, and the tests that must fail
#
# scripts/mutate.sh [--only PATTERN] runs all entries, or those whose law or test matches, in a clone of the last commit.
# After a run of all entries in which each was caught it writes docs/mutations.md. MUTATE_WORK=DIR keeps clone and build
# there for the next run, which skips entries that were caught before and whose file is unchanged. Takes about half an hour.
set -euo pipefail
cd "$(dirname "$0")/.."
source_dir=$PWD
list=$source_dir/scripts/mutations.txt
only=
case "${1:-}" in
  "") ;;
  --only) only=${2:?"--only needs a pattern"} ;;
  *) sed -n '2,/^set/p' "$0" | sed '$d; s/^# \{0,1\}//'; exit 2 ;;
esac

. scripts/mutations.sh
prepare_clone "$source_dir"
touch "$work/caught"

names=() files=() olds=() news=() programs=() filters=() keys=() todo=()
while IFS= read -r name; do
  [[ -z $name || $name == \#* ]] && continue
  read -r file
  IFS= read -r old
  IFS= read -r new
  read -r test
  [[ $old == -* && $new == +* && $test == \?*' '* ]] || { echo "$list: '$name' is not an entry of five lines"; exit 2; }
  [[ -z $only || "$name $test" =~ $only ]] || continue
  names+=("$name") files+=("$file") olds+=("${old:1}") news+=("${new:1}")
  test=${test:1}
  programs+=("${test%% *}") filters+=("${test#* }")
  key=$(printf '%s\n' "$name" "$file" "$old" "$new" "$test" "$(git -C "$tree" rev-parse "HEAD:$file")" | sha1sum)
  keys+=("$key")
  grep -qxF -- "$key" "$work/caught" || todo+=($((${#names[@]} - 1)))
done <"$list"
[ "${#names[@]}" != 0 ] || { echo "no entry of $list matches '$only'"; exit 2; }

run() { (cd "$work" && timeout 300 "build/bin/$1" --gtest_filter="$2" >run.log 2>&1); }

[ -e "$work/build/build.ninja" ] || cmake -G Ninja -S "$tree" -B "$work/build" -DCMAKE_BUILD_TYPE=Release -DHAPTICD_WERROR=OFF -DCMAKE_CXX_FLAGS_RELEASE="-O1 -DNDEBUG" >/dev/null
mapfile -t needed < <(for i in "${todo[@]}"; do echo "${programs[i]}"; done | sort -u)
echo "${#names[@]} changes, ${#todo[@]} to try; building ${needed[*]} without any ..."
[ "${#todo[@]}" = 0 ] || build_clone "${needed[@]}" || { tail -20 "$work/build.log"; exit 2; }

declare -A broken  # tests that say nothing
for i in "${todo[@]}"; do
  if ! run "${programs[i]}" "${filters[i]}" || ! grep -q '  PASSED  \] [1-9]' "$work/run.log"; then
    broken[${programs[i]} ${filters[i]}]=1
  fi
done

missed=()
for i in "${todo[@]}"; do
  target=$tree/${files[i]}
  verdict=
  if [ -n "${broken[${programs[i]} ${filters[i]}]:-}" ]; then
    verdict="without the change the test does not pass, or there is none"
  elif ! change_once "${olds[i]}" "${news[i]}" "$target" >"$work/changed"; then
    verdict="the old text does not stand in ${files[i]} exactly once"
  else
    cp "$work/changed" "$target"
    if ! build_clone "${programs[i]}"; then
      verdict="does not build: $(grep -m1 'error' "$work/build.log" || tail -1 "$work/build.log")"
    elif run "${programs[i]}" "${filters[i]}"; then
      verdict="SURVIVED"
    fi
    git -C "$tree" checkout -q -- "${files[i]}"
    # Seen as changed again, whatever the resolution of file times.
    touch "$target"
  fi
  if [ -z "$verdict" ]; then
    echo "caught    ${names[i]}"
    echo "${keys[i]}" >>"$work/caught"
  else
    echo "NOT CAUGHT ${names[i]}: $verdict"
    missed+=("$i")
  fi
done

echo "${#names[@]} changes, $((${#names[@]} - ${#missed[@]})) caught"
[ "${#missed[@]}" = 0 ] || exit 1
[ -z "$only" ] || exit 0

{
  echo "# Mutations"
  echo
  echo "Written by \`scripts/mutate.sh\`. It makes each of these ${#names[@]} changes to the sources, one at a time, and requires"
  echo "the named test to fail: each law with its sign, unit or factor changed."
  echo
  echo "| law | change in | before | after | caught by |"
  echo "|---|---|---|---|---|"
  for i in "${!names[@]}"; do
    cell() { printf '%s' "$1" | sed 's/|/\\|/g; s/^ *//; s/ *$//'; }
    echo "| $(cell "${names[i]}") | \`${files[i]#src/}\` | \`$(cell "${olds[i]}")\` | \`$(cell "${news[i]}")\` | \`${programs[i]}\` $(cell "${filters[i]//\*/}") |"
  done
} >"$source_dir/docs/mutations.md"
echo "written: docs/mutations.md"
