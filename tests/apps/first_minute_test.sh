#!/usr/bin/env bash
# The first minute of a new user without any rights: serve runs with the simulated hand and names one remedy, a real device
# does not start; demo serves its page with the bunny in it; self-test passes; manual writes pages that man accepts.
set -euo pipefail
hapticd=$1
source_dir=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export HOME=$work

# As a user without realtime rights, also where the tests run as root.
cp "$hapticd" "$work/hapticd"
chmod 755 "$work" "$work/hapticd"
user=()
[ "$(id -u)" != 0 ] || user=(setpriv --reuid=65534 --regid=65534 --clear-groups)
without_rights() { (ulimit -r 0; ulimit -l 64; exec "${user[@]}" "$work/hapticd" "$@"); }

without_rights serve --listen 127.0.0.1:0 --http off --seconds 0.5 >"$work/log" 2>&1 || { cat "$work/log"; exit 1; }
cat "$work/log"
[ "$(grep -c 'Remedy: ' "$work/log")" = 1 ]
grep -q "Ticks may be late .* Remedy: .*group\|Remedy: sudo usermod -aG hapticd" "$work/log"

printf 't_s,x_m,y_m,z_m\n0,0,0,0\n1,0,0,0\n' >"$work/hand.csv"
status=0
without_rights serve --listen 127.0.0.1:0 --http off --device replay --hand "$work/hand.csv" --seconds 0.5 >"$work/log" 2>&1 || status=$?
cat "$work/log"
[ "$status" = 1 ]
grep -q -- '--allow-no-rt' "$work/log"
grep -q 'hapticd' "$work/log"
without_rights serve --listen 127.0.0.1:0 --http off --device replay --hand "$work/hand.csv" --seconds 0.5 --allow-no-rt

# As in a container; the addresses that it prints are those of this machine.
without_rights demo --listen 127.0.0.1:0 --http 0.0.0.0:0 >"$work/demo" 2>&1 &
demo=$!
for _ in $(seq 600); do grep -q 'First contact' "$work/demo" && break; kill -0 "$demo" || break; sleep 0.1; done
cat "$work/demo"
grep -q 'First contact' "$work/demo"
port=$(sed -nE 's#.*http://127.0.0.1:([0-9]+)/.*#\1#p' "$work/demo")
exec 3<>"/dev/tcp/127.0.0.1/$port"
printf 'GET /api/state HTTP/1.1\r\nHost: localhost:%s\r\nConnection: close\r\n\r\n' "$port" >&3
grep -qa '"triangles":3674' <&3
kill -TERM "$(pgrep -P "$demo" hapticd || echo "$demo")"
wait "$demo"

without_rights demo --port 0 --http off --seconds 1 >"$work/demo"
! grep -n browser "$work/demo" || exit 1
grep -q '^  watch: ' "$work/demo"

without_rights self-test --seconds 0.2

"$hapticd" --version | head -1 | grep -qE '^hapticd [0-9]+\.[0-9]+\.[0-9]+ \(.+\)$'
"$hapticd" manual "$work/share"
: >"$work/file"
for folder in "$work/file" /proc; do # where nothing can be written, not even by root
  ! "$hapticd" manual "$folder" 2>"$work/said" || exit 1
  grep -q "^hapticd: cannot write '$folder/man/man1/hapticd.1': .*; name a folder that can be written" "$work/said" || { cat "$work/said"; exit 1; }
done
for command in $("$hapticd" --help | sed -nE '/^Subcommands/,$ s/^  ([a-z-]+) .*/\1/p'); do
  [ "$command" = device-host ] || [ -s "$work/share/man/man1/hapticd-$command.1" ] || { echo "no page of $command"; exit 1; }
done
for page in $(command -v man >/dev/null && echo "$work"/share/man/man1/*.1); do
  [ -z "$(man --warnings -l "$page" 2>&1 >/dev/null)" ] || { man --warnings -l "$page" 2>&1 >/dev/null | head; exit 1; }
done
grep -qFx '[OPTIONS] [server]' "$work/share/man/man1/hapticd-stop.1"
# Lines of an option stay lines, a page has no empty part, and the documents are where the package has them.
grep -qFx .br "$work/share/man/man1/hapticd-serve.1"
! grep -A1 -x '.SH OPTIONS' "$work/share/man/man1/hapticd-bench.1" | grep -qx '.SH SEE ALSO' || exit 1
grep -qF -- '\-\-full' "$work/share/man/man1/hapticd-bench.1"
for page in "$work"/share/man/man1/*.1; do tail -1 "$page" | grep -qx /usr/share/doc/hapticd-doc; done
grep -qF "NAME@host[:port], NAME@tcp://host[:port] or NAME@unix:PATH" "$work/share/fish/vendor_completions.d/hapticd.fish"
grep -qF "Simulated device\: '\\''script'\\'' strokes the objects of the scene \[script\]" "$work/share/zsh/vendor-completions/_hapticd"
completes() { # completes WORD...: what bash offers for the last word, one a line
  (cd "$work/files" && . "$work/share/bash-completion/completions/hapticd" && COMP_WORDS=(hapticd "$@") COMP_CWORD=$# && _hapticd && printf '%s\n' "${COMPREPLY[@]}")
}
mkdir "$work/files"
touch "$work/files/my mesh.obj"
completes touch m | grep -qx 'my mesh.obj'
[ "$(completes serve --po)" = --port ]
[ "$(completes bench --fu)" = --full ]
[ "$(completes help wat)" = watch ]
