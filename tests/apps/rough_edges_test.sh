#!/usr/bin/env bash
# Messages and files of a user who mistypes, repeats and overwrites.
set -euo pipefail
hapticd=$1
source_dir=$2
serve_options=(--http 127.0.0.1:0)
. "$(dirname "$0")/server.sh"

refused() { # refused STATUS TEXT COMMAND...: the status, and the text in what it prints
  local wanted=$1 text=$2 status=0
  shift 2
  "$@" >"$work/said" 2>&1 || status=$?
  [ "$status" = "$wanted" ] && grep -qF -- "$text" "$work/said" || { cat "$work/said"; echo "status $status of: $*"; exit 1; }
}
refused 2 "did you mean 'serve'?" "$hapticd" serv
refused 2 "unknown command 'xyzzyx'; 'hapticd --help'" "$hapticd" xyzzyx
refused 2 "hapticd: unknown option '--xyzzyx'; 'hapticd --help'" "$hapticd" --xyzzyx
cmp <("$hapticd" help) <("$hapticd" --help)
cmp <("$hapticd" help plot) <("$hapticd" plot --help)
refused 2 "hapticd serve: unknown option '--recrod'; did you mean '--record'?" "$hapticd" serve --recrod x
refused 2 "hapticd record: unknown option '--nothing-alike'; 'hapticd record --help'" "$hapticd" record Phantom@localhost --nothing-alike=3
refused 2 "unknown command 'xyzzyx'; 'hapticd --help'" "$hapticd" help xyzzyx
refused 2 "hapticd touch: unknown option '--nothing-alike'" "$hapticd" touch --nothing-alike
refused 2 "hapticd touch: mesh is required; 'hapticd touch --help'" "$hapticd" touch
refused 2 "hapticd: unknown command ''; 'hapticd --help'" "$hapticd" ''
refused 2 "hapticd: a command is required; 'hapticd --help' lists the commands" "$hapticd"
refused 2 "hapticd serve: unexpected argument 'first'; 'hapticd serve --help'" "$hapticd" serve first second
refused 2 "hapticd serve: unexpected argument 'my.cfg'; use '--config my.cfg'; 'hapticd serve --help'" "$hapticd" serve my.cfg
refused 2 "hapticd watch: unexpected argument 'third'; 'hapticd watch --help'" "$hapticd" watch Phantom@localhost third fourth
refused 2 "hapticd serve: --port needs a value; 'hapticd serve --help'" "$hapticd" serve --port
refused 2 "hapticd serve: --port is given more than once; 'hapticd serve --help'" "$hapticd" serve --port 1 --port 2
refused 2 "hapticd serve: --port: must be an integer from 0 to 65535 without leading zeros, got 'x'; 'hapticd serve --help'" "$hapticd" serve --port x
for number in 0x10 010 1e3 -1 65536 4294967297 99999999999999999999 1.5 ' 1' '1 '; do
  refused 2 "must be an integer from 0 to 65535 without leading zeros, got '$number'" "$hapticd" serve "--port=$number"
done
for number in 0x10 0X1p3 nan inf -1 1e10; do
  refused 2 "must be a number from 0 to 1e+09, got '$number'" "$hapticd" serve "--seconds=$number"
done
refused 2 "hapticd bench: there is no benchmark 'xyzzyx'; hapticd bench --list" "$hapticd" bench xyzzyx
refused 2 "hapticd bench: unknown option '--nothing-alike'; 'hapticd bench --help'" "$hapticd" bench --nothing-alike
refused 2 "hapticd bench: unknown option '--ful'; did you mean '--full'?" "$hapticd" bench --ful
refused 2 "hapticd bench: --json requires --list" "$hapticd" bench --json
# No flag takes a value, neither of a command nor of the program; the man pages tell which options are flags.
"$hapticd" manual "$work/manual"
flags=0
for page in "$work"/manual/man/man1/hapticd*.1; do
  page=${page##*/}
  command=${page%.1} command=${command#hapticd} command=${command#-}
  for flag in $(sed -nE 's/\\-/-/g; s/^\.B (-[A-Za-z], )?(--[a-z-]+)$/\2/p' "$work/manual/man/man1/$page"); do
    for value in 3 no; do
      refused 2 "hapticd${command:+ $command}: $flag takes no value; 'hapticd${command:+ $command} --help'" \
        "$hapticd" $command "$flag=$value"
    done
    flags=$((flags + 1))
  done
done
[ "$flags" -gt 40 ] || { echo "only $flags flags were found"; exit 1; }
refused 2 "nothing to render" "$hapticd" render
refused 2 "excludes" "$hapticd" touch "$source_dir/testdata/meshes/bunny.obj" --true-size --size-mm 3
refused 2 "excludes" "$hapticd" record Phantom@localhost --server --end --seconds 5
refused 2 "must be an integer from 0 to 2147483646" "$hapticd" touch "$source_dir/testdata/meshes/bunny.obj" --object 2147483647
refused 2 "must be an integer from 1 to 65535" "$hapticd" doctor --port 70000
refused 1 "--mesh does not go with --session" "$hapticd" render --mesh "$source_dir/testdata/meshes/bunny.obj" --session "$source_dir/testdata/recordings/all_commands_law2.haptics"
refused 1 "hapticd devices" "$hapticd" serve --device openhaptics --listen 127.0.0.1:0 --http off
refused 1 "no system bus (D-Bus): No such file or directory; install it by 'apt install dbus'" env DBUS_SYSTEM_BUS_ADDRESS=unix:path=/nowhere "$hapticd" list
refused 1 "no system bus" env DBUS_SYSTEM_BUS_ADDRESS=unix:path=/nowhere "$hapticd" touch "$source_dir/testdata/meshes/bunny.obj" --find
refused 1 "--traj-unit does not go with --session" "$hapticd" render --session "$source_dir/testdata/recordings/all_commands_law2.haptics" --traj-unit m
refused 1 "without TLS: leave out --fingerprint" "$hapticd" tunnel unix:/nowhere --fingerprint 00
refused 2 "--haply-host: is empty" "$hapticd" devices --haply-host ''
for command in "demo" "replay $source_dir/testdata/recordings/all_commands_law2.haptics" "serve"; do
  refused 2 "is not an IPv4 address" "$hapticd" $command --listen x
  refused 2 "'::1' is an IPv6 address" "$hapticd" $command --listen ::1
  refused 2 "'[::1]:4000' is an IPv6 address" "$hapticd" $command --listen '[::1]:4000'
done
ln -s loop "$work/loop"
refused 2 "cannot read '$work/loop': Too many levels of symbolic links" "$hapticd" info "$work/loop"
refused 2 "there is no file '$work/none'" "$hapticd" replay "$work/none"
refused 2 "'$work' is a folder, not a file" "$hapticd" serve --config "$work"
refused 2 "packages.txt has no section 'nosuch', but build" "$source_dir/scripts/install_packages.sh" nosuch
printf '{"asset":%0200000d' 0 | tr 0 '[' >"$work/deep.gltf"  # overflows the stack of the reader
refused 1 "deep.gltf': its reader crashed" "$hapticd" touch "$work/deep.gltf"
printf 'OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n' >"$work/three.off"
refused 1 "three.off': the format '.off' is not supported" "$hapticd" touch "$work/three.off"

refused 1 "replayed: hapticd record Phantom@tcp://$address --server, or" "$hapticd" record "Phantom@tcp://$address" "$work/own.haptics"
# What is odd about a hand file is said once.
printf 'time_s,hand_x_m,hand_y_m,hand_z_m\n0,0,0,0\n1,0.01,0,0\n' >"$work/old.csv"
"$hapticd" serve --listen 127.0.0.1:0 --http off --hand "$work/old.csv" --seconds 0.2 >"$work/said" 2>&1
[ "$(grep -c 'columns of an older version' "$work/said")" = 1 ] || { cat "$work/said"; exit 1; }
# Nothing is overwritten without --force.
"$hapticd" record "Phantom@tcp://$address" "$work/own.csv" --seconds 0.3
refused 1 "exists: choose another name, or overwrite it by --force" "$hapticd" record "Phantom@tcp://$address" "$work/own.csv" --seconds 0.3
"$hapticd" record "Phantom@tcp://$address" "$work/own.csv" --seconds 0.3 --force
# A terminal that closes ends a recording as Ctrl-C does: the file is whole.
"$hapticd" record "Phantom@tcp://$address" "$work/closed.mcap" >"$work/closed.log" 2>&1 &
recorder=$!
for _ in $(seq 600); do [ ! -e "$work/closed.mcap" ] || break; sleep 0.05; done
sleep 0.3
kill -HUP "$recorder"
wait "$recorder"
grep -q "^recorded [0-9]* ticks" "$work/closed.log" || { cat "$work/closed.log"; exit 1; }
[ "$(tail -c 8 "$work/closed.mcap" | od -An -tx1 | tr -d ' \n')" = 894d434150300d0a ]

# A hapticd that is slow is not taken for another server.
(cd "$work" && exec "$hapticd" serve --listen 127.0.0.1:0 --http off --allow-no-rt) >"$work/slow.log" 2>&1 &
slow=$!
trap 'kill -KILL "$slow" 2>/dev/null || true; kill "$server" 2>/dev/null || true; rm -rf "$work"' EXIT
for _ in $(seq 600); do grep -q 'listening on' "$work/slow.log" && break; sleep 0.05; done
"$hapticd" record "Phantom@tcp://$(sed -nE 's/.*listening on ([0-9.:]+).*/\1/p' "$work/slow.log")" --server >"$work/said" 2>&1 &
recorder=$!
for _ in $(seq 600); do grep -q 'recording to' "$work/said" && break; sleep 0.05; done
kill -STOP "$slow"
kill -TERM "$recorder"
status=0
wait "$recorder" || status=$?
[ "$status" = 1 ] && grep -q 'did not answer within 5 s; it is busy' "$work/said" || { cat "$work/said"; echo "status $status"; exit 1; }
kill -KILL "$slow"

recording=$source_dir/testdata/recordings/all_commands_law2.haptics
"$hapticd" export "$recording" --to csv -o "$work/out.csv" | grep -qx "wrote $work/out.csv and $work/out.csv.json"
refused 1 "--force" "$hapticd" export "$recording" --to csv -o "$work/out.csv"
"$hapticd" export "$recording" --to csv -o "$work/out.csv" --force

# Into a pipe goes the file alone; what is closed is not taken for a file.
"$hapticd" export "$recording" --to csv -o /dev/stdout 2>"$work/said" | cmp - "$work/out.csv"
grep -qx "wrote /dev/stdout" "$work/said"
for to in csv mcap vrpn; do
  "$hapticd" export "$recording" --to $to -o "$work/whole.$to" >/dev/null
  (cd "$work" && "$hapticd" export "$recording" --to $to -o - 2>said) | cmp - "$work/whole.$to"
done
refused 1 "both write to standard output" "$hapticd" export "$recording" --to csv -o - --json
refused 1 "standard output is a file: name it by -o FILE" "$hapticd" export "$recording" --to csv -o -
status=0
"$hapticd" export "$recording" --to csv -o - >&- 2>"$work/said" || status=$?
[ "$status" = 1 ] && grep -q "cannot write to standard output" "$work/said" || { cat "$work/said"; echo "status $status"; exit 1; }
# Where there is other output, no file of this name surprises.
(
  cd "$work"
  refused 1 "'-' would be a file of that name" "$hapticd" render --session "$recording" --out -
  refused 1 "'-' would be a file of that name" "$hapticd" render --session "$recording" --report -
  refused 1 "'-' must end with .svg or .pdf" "$hapticd" plot "$recording" --out -
  refused 1 "'-' would be a file of that name" "$hapticd" record "Phantom@tcp://$address" -
  refused 2 "record: '-' would be a file of that name" "$hapticd" serve --listen 127.0.0.1:0 --http off --record - --seconds 1
  ls -- -* 2>&- && { echo "a file was written"; exit 1; }
  "$hapticd" export "$recording" --to csv -o ./- --force >/dev/null
  cmp ./- out.csv
)
status=0
"$hapticd" export "$recording" --to csv -o "$work/closed.csv" >&- 2>"$work/said" || status=$?
[ "$status" = 1 ] && grep -q "cannot write to standard output" "$work/said" || { cat "$work/said"; echo "status $status"; exit 1; }
cmp "$work/closed.csv" "$work/out.csv"
refused 1 "is a pipe: copy it to a file first" "$hapticd" info <(cat "$recording")
for command in info replay "render --session" "plot --out $work/null.svg"; do
  refused 1 "'/dev/null' is a device, not a recording; 'hapticd serve --record FILE' writes one" "$hapticd" $command /dev/null
done
# What a recording says of itself does not reach the terminal as it is.
python3 - "$recording" "$work/odd.haptics" <<'EOF'
import struct, sys, zlib
file = bytearray(open(sys.argv[1], "rb").read())
head, end = file[8:16], 20 + struct.unpack(">I", file[12:16])[0]
header = bytes(file[20:end])
config = b"\x1b[2J\nx"
offset = 8 + struct.unpack(">I", header[4:8])[0] + 8  # behind version, program and offset of the clock
assert header[offset:offset + 4] == bytes(4)
header = header[:offset + 3] + bytes([len(config)]) + config + header[offset + 4:]
for said in (b"hapticd", b"Phantom", b"simulated"):
    assert said in header
    header = header.replace(said, b"\x1b[2J\n" + said[5:])
head = head[:4] + struct.pack(">I", len(header))
file[8:end] = head + struct.pack(">I", zlib.crc32(head + header)) + header
open(sys.argv[2], "wb").write(file)
EOF
for command in "info --config" "render --session" "plot --force --out $work/odd.svg" "plot --device none --out $work/none.svg"; do
  "$hapticd" $command "$work/odd.haptics" >"$work/said" 2>&1 || true
  grep -q '�\[2J�' "$work/said" && ! grep -q $'\x1b' "$work/said" || { cat -v "$work/said"; echo "of: $command"; exit 1; }
done
mkfifo "$work/pipe.haptics"
for file in /dev/full "$work/pipe.haptics"; do
  refused 1 "cannot record to '$file': it is a device or a pipe; name a file" "$hapticd" serve --listen 127.0.0.1:0 --http off --record "$file" --seconds 1
done
refused 1 "File exists; name another" "$hapticd" serve --listen 127.0.0.1:0 --http off --record "$work/out.csv.json" --seconds 1

# Nor is what is still to be read, also with it.
cp "$recording" "$work/kept.haptics"
ln -s kept.haptics "$work/link"
for out in kept.haptics link; do
  refused 1 "is the file to read" "$hapticd" export "$work/kept.haptics" --to vrpn -o "$work/$out" --force
  refused 1 "is the file to read" "$hapticd" render --session "$work/kept.haptics" --out "$work/$out" --force
done
cmp "$recording" "$work/kept.haptics"
refused 1 "--out and --report name one file" "$hapticd" render --session "$recording" --out "$work/both" --report "$work/./both"
# A file that cannot be written is refused before the work.
refused 1 "cannot write '$work/nowhere/x.csv'" "$hapticd" render --session "$recording" --out "$work/nowhere/x.csv"
! grep session "$work/said" || exit 1
refused 1 "cannot write '$work/nowhere/x.svg'" "$hapticd" plot "$recording" --from 1000 --out "$work/nowhere/x.svg"

# What is not whole is read as far as it goes, and a script can tell.
"$hapticd" render --session "$recording" >/dev/null
head -c -1 "$recording" >"$work/cut.haptics"
refused 3 "everything before it was read" "$hapticd" info "$work/cut.haptics"
refused 3 "everything before it was read" "$hapticd" info "$work/cut.haptics" --json
refused 3 "everything before it was read" "$hapticd" render --session "$work/cut.haptics"
refused 3 "everything before it was read" "$hapticd" plot "$work/cut.haptics" --out "$work/cut.svg"
for to in csv mcap vrpn; do
  refused 3 "everything before it was read" "$hapticd" export "$work/cut.haptics" --to $to -o "$work/cut.$to"
  [ -s "$work/cut.$to" ]
done

refused 3 "everything before it was read" "$hapticd" replay "$work/cut.haptics" --listen 127.0.0.1:0 --http off --speed 1000 --seconds 5
grep -q '^hapticd: .*everything before it was read' "$work/said"
"$hapticd" replay "$recording" --listen 127.0.0.1:0 --http off --speed 1000 --seconds 1 >/dev/null

"$hapticd" info "$recording" >"$work/info"
grep -q '^device      ' "$work/info" && grep -q '^  force     at most [0-9.]* N' "$work/info" && grep -q '^command     SetVertices, 4 times' "$work/info" ||
  { cat "$work/info"; exit 1; }

for words in "info $recording" --version "serve --help"; do
  status=0
  "$hapticd" $words >/dev/full 2>"$work/said" || status=$?
  [ "$status" = 1 ] && grep -q "cannot write to standard output" "$work/said" ||
    { cat "$work/said"; echo "status $status of $words"; exit 1; }
done

# A port that needs privileges is not called taken.
if [ "$(id -u)" = 0 ] && [ "$(cat /proc/sys/net/ipv4/ip_unprivileged_port_start)" -gt 7 ]; then
  setpriv --reuid=65534 --regid=65534 --clear-groups "$hapticd" doctor --seconds 0.1 --port 7 >"$work/said" || true
  [ "$(grep -c 'port 7 needs privileges: choose one above 1023 with --listen' "$work/said")" = 2 ] || { cat "$work/said"; exit 1; }
fi

# A loop that was stopped for 0.1 s has late ticks; rights that are granted are no remedy.
"$hapticd" doctor --seconds 1 >"$work/said" &
doctor=$!
for _ in $(seq 600); do ! grep -q '^loop, ' "$work/said" || break; sleep 0.05; done
sleep 0.3
kill -STOP "$doctor"
sleep 0.1
kill -CONT "$doctor"
wait "$doctor" && { cat "$work/said"; exit 1; }
grep -A1 'BAD   [0-9]* ticks' "$work/said" | grep -q -e '-> .*close other programs' || { cat "$work/said"; exit 1; }
! grep -q 'SCHED_FIFO priority 80 is granted' "$work/said" || ! grep 'realtime rights' "$work/said" || exit 1

# What is interrupted leaves no file behind.
printf 't_s,x_m,y_m,z_m\n0,0.2,0,0\n100000,0.3,0,0\n' >"$work/long.csv"
"$hapticd" render --mesh "$source_dir/testdata/meshes/bunny.obj" --hand "$work/long.csv" --out "$work/half.csv" >"$work/said" 2>&1 &
rendering=$!
for _ in $(seq 600); do [ ! -e "$work/half.csv.part" ] || break; sleep 0.05; done
[ -e "$work/half.csv.part" ]
kill "$rendering"
status=0
wait "$rendering" || status=$?
[ "$status" = 1 ] && grep -q "interrupted: nothing is written" "$work/said" || { cat "$work/said"; echo "status $status"; exit 1; }
[ ! -e "$work/half.csv" ] && [ ! -e "$work/half.csv.part" ]

# What columns do not say stands beside them, for programs and people.
grep -q '"program": "hapticd' "$work/out.csv.json" && grep -q '"stiffness_N_per_m"' "$work/out.csv.json" || { cat "$work/out.csv.json"; exit 1; }
"$hapticd" info "$recording" --json | grep -q '"driver": "simulated"'

# Figures: of a recording, over nothing else, and each in its format.
refused 1 "--to must be greater than --from, 5, or 0 for the end; got 2" "$hapticd" plot "$recording" --out "$work/my.svg" --from 5 --to 2
"$hapticd" plot "$recording" --out "$work/my.svg" | grep -q "ticks of 'Phantom' from 0.000 s"
grep -q '<polyline' "$work/my.svg" && grep -q 'N/m</text>' "$work/my.svg" && tail -1 "$work/my.svg" | grep -qx '</svg>'
refused 1 "--force" "$hapticd" plot "$recording" --out "$work/my.svg"
refused 1 "must end with .svg or .pdf" "$hapticd" plot "$recording" --out "$work/my.gif"
refused 1 "it has Phantom" "$hapticd" plot "$recording" --out "$work/other.svg" --device Nobody
refused 1 "has no ticks of 'Phantom' in this time" "$hapticd" plot "$recording" --out "$work/other.svg" --from 1000
"$hapticd" plot "$recording" --out "$work/my.pdf" >/dev/null
[ "$(head -c 8 "$work/my.pdf")" = "%PDF-1.4" ] && [ "$(tail -1 "$work/my.pdf")" = "%%EOF" ]
# The table of the file names the byte of each object.
at=$(grep -aA1 '^startxref' "$work/my.pdf" | tail -1)
[ "$(tail -c +$((at + 1)) "$work/my.pdf" | head -c 4)" = xref ]

# A marker is confirmed and recorded.
"$hapticd" mark "trial 3 begins" --server "Phantom@tcp://$address" | grep -q 'marked "trial 3 begins"'
refused 2 "must have 1 to 255 bytes" "$hapticd" mark "$(printf 'x%.0s' $(seq 256))" --server "Phantom@tcp://$address"

# A smaller mesh replaces a larger one in its object; another object stays.
printf 'v 0 0 0\nv 30 0 0\nv 0 30 0\nf 1 2 3\n' >"$work/one.obj"
touch_mesh() { "$hapticd" touch "$@" --server "Phantom@tcp://$address" --seconds 0.2 >"$work/out" 2>&1 || { cat "$work/out"; exit 1; }; }
touch_mesh "$source_dir/testdata/meshes/bunny.obj"
touch_mesh "$work/one.obj" --object 1
touch_mesh "$work/one.obj" --true-size
grep -q ' 1 triangle,' "$work/out"
grep -q '^30 x 30 x 0 mm, centred' "$work/out"
web=$(sed -nE 's#.*viewer: http://127.0.0.1:([0-9]+)/.*#\1#p' "$work/log")
objects() { # of the scene: what matches
  exec 3<>"/dev/tcp/127.0.0.1/$web"
  printf 'GET /api/state HTTP/1.1\r\nHost: localhost:%s\r\nConnection: close\r\n\r\n' "$web" >&3
  grep -oaE "$1" <&3 | tr '\n' ' '
}
become() { for _ in $(seq 100); do [ "$(objects "$1")" = "$2" ] && return; sleep 0.1; done; echo "got $(objects "$1"), not $2"; exit 1; }
becomes() { become '"triangles":[0-9]+' "$1"; }
becomes '"triangles":1 "triangles":1 '
touch_mesh "$source_dir/testdata/meshes/bunny.obj" --replace
becomes '"triangles":3674 '
# A long name is cut between its characters.
cp "$work/one.obj" "$work/n$(printf 'ä%.0s' $(seq 40)).obj"
touch_mesh "$work/"nä*.obj --replace
become '"name":"nä[^"]*"' "\"name\":\"n$(printf 'ä%.0s' $(seq 31))\" "
"$hapticd" serve --listen 127.0.0.1:0 --http off --port 0 --seconds 0.2 --verbose >"$work/second" 2>&1
