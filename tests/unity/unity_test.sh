#!/usr/bin/env bash
# The C# client of unity/ against a real server, by Mono, whose language and library Unity has. Skipped (77) without Mono.
set -euo pipefail
hapticd=$1
source_dir=$2
if ! command -v mcs >/dev/null || ! command -v mono >/dev/null; then
  echo "skipped: Mono is not installed; apt-get install mono-mcs mono-runtime"
  exit 77
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$hapticd" --version | grep -qF "hapticd $(sed -n 's/.*"version": "\(.*\)".*/\1/p' "$source_dir/unity/package.json") " ||
  { echo "unity/package.json has another version than hapticd"; exit 1; }
# The client alone, which needs no Unity.
mcs -langversion:7 -warnaserror -target:library -out:"$work/Client.dll" "$source_dir"/unity/Runtime/{Wire,Values,HapticClient}.cs
mcs -langversion:7 -warnaserror -nowarn:649 -out:"$work/Tests.exe" "$source_dir"/unity/Runtime/*.cs "$source_dir"/tests/unity/*.cs
source "$source_dir/tests/apps/server.sh"
mono --debug "$work/Tests.exe" "$address"
