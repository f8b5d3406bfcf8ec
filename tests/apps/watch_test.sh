#!/usr/bin/env bash
# hapticd watch beside another client: lines for programs, and a summary for people.
set -euo pipefail
hapticd=$1
source_dir=$2
. "$(dirname "$0")/server.sh"

"$hapticd" touch "$source_dir/testdata/meshes/bunny.obj" --server "Phantom@$address" --seconds 120 >"$work/touch" &
touch=$!
# Every row has every column, and tick numbers increase. There is a force as soon as the hand has planned a stroke.
force=""
for _ in $(seq 10); do
  "$hapticd" watch "Phantom@$address" --csv --rate 200 --seconds 6 >"$work/csv"
  force=$(awk -F, 'NR == 1 { columns = NF; for (i = 1; i <= NF; i++) c[$i] = i; next }
                   NF != columns || $c["tick"] <= tick { print "row " NR ": " $0; bad = 1; exit }
                   { tick = $c["tick"] } $c["force_x_N"]^2 + $c["force_y_N"]^2 + $c["force_z_N"]^2 > 0.01 { force = 1 }
                   END { if (!bad && force && NR >= 100) print "felt"; exit bad }' "$work/csv") || { echo "$force"; exit 1; }
  [ "$force" != felt ] || break
done
[ "$force" = felt ] || { tail -3 "$work/csv"; exit 1; }
kill "$touch"
wait "$touch"

"$hapticd" watch "Phantom@tcp://$address" --json --seconds 1 >"$work/json"
grep -qE '^\{"device":"Phantom","time_ns":"[0-9]{19}","tick":[0-9]+,.*"force_N":\[[^]]*\],.*\}$' "$work/json"
"$hapticd" watch "Phantom@tcp://$address" --seconds 2 | grep -q 'reports total'

# On a terminal of 80x24 each redraw fits: fewer lines than rows, fewer characters than columns.
TERM=xterm LC_ALL=C.UTF-8 script -qec "stty rows 24 cols 80; '$hapticd' watch Phantom@$address --seconds 3" /dev/null \
  </dev/null >"$work/terminal"
python3 - "$work/terminal" <<'EOF'
import re, sys
frames = open(sys.argv[1], encoding="utf-8", newline="").read().replace("\r", "").split("\x1b[J")[:-1]
assert len(frames) > 1, len(frames)  # it was drawn again
for frame in frames:
    lines = re.sub(r"\x1b\[K|\x1b\[\d+A", "", frame).split("\n")[:-1]
    assert len(lines) < 24 and max(map(len, lines)) < 80, frame
    assert all(any(word in line for line in lines) for word in ("force", "|F|", "depth", "touching")), frame
EOF

# So does the bar of an upload on a narrow one.
TERM=xterm script -qec "stty rows 24 cols 40; '$hapticd' touch '$source_dir/testdata/meshes/bunny.obj' --server Phantom@$address --seconds 1" \
  /dev/null </dev/null >"$work/terminal"
python3 - "$work/terminal" <<'EOF'
import re, sys
bars = re.findall(r"\r(sending[^\r\x1b]*)\x1b\[K", open(sys.argv[1], encoding="utf-8", newline="").read())
assert bars and all(len(bar) < 40 and "[##" in bar and "100 %" in bar for bar in bars[-1:]), bars
EOF

# What a server repeats to a client that has caught up, also behind what it overtook, is one row.
python3 - "$hapticd" "$work" <<'EOF'
import csv, json, socket, struct, subprocess, sys, threading
def frame(sender, kind, payload):
    pad = lambda data: data + bytes(-len(data) % 8)
    return pad(struct.pack(">iiiii", 24 + len(payload), 1700000000, 0, sender, kind)) + pad(payload)
def description(kind, number, name):
    return frame(number, kind, struct.pack(">i", len(name) + 1) + name.encode() + b"\0")
types = ("hapticd Capabilities", "hapticd Tick", "vrpn_Base pong_message")
first = b"vrpn: ver. 07.38  0".ljust(24, b"\0") + description(-1, 0, "Phantom")
first += b"".join(description(-2, number, name) for number, name in enumerate(types))
first += frame(0, 0, struct.pack(">iI3di6d", 1, 127, 1000, 1000, 3.3, 2, *6 * [0])) + frame(0, 2, b"")
first += b"".join(frame(0, 1, struct.pack(">QqQ17diIII", tick, time, 1, *17 * [0], -1, 0, 0, 0))
                  for tick, time in ((5, 1), (6, 2), (6, 2), (7, 3), (6, 2), (7, 3), (8, 4), (2, 5)))
listener = socket.create_server(("127.0.0.1", 0))
def serve():
    while True:
        link = listener.accept()[0]
        link.sendall(first)
        threading.Thread(target=lambda link=link: [None for _ in iter(lambda: link.recv(4096), b"")], daemon=True).start()
threading.Thread(target=serve, daemon=True).start()
name = f"Phantom@tcp://127.0.0.1:{listener.getsockname()[1]}"
def run(*arguments):
    return subprocess.run([sys.argv[1], *arguments, "--seconds", "1"], capture_output=True, text=True, timeout=60, check=True).stdout.splitlines()
ticks = lambda rows: [int(row["tick"]) for row in rows]
wanted = [5, 6, 7, 8, 2]  # 2: of a replay that began again
assert ticks(csv.DictReader(run("watch", name, "--csv"))) == wanted
assert ticks(map(json.loads, run("watch", name, "--json"))) == wanted
run("record", name, sys.argv[2] + "/repeated.csv")
assert ticks(csv.DictReader(open(sys.argv[2] + "/repeated.csv"))) == wanted
EOF

# A server without the extensions, with a tracker only: what it does not report is left empty, not zero.
python3 - "$hapticd" <<'EOF'
import socket, struct, subprocess, sys, threading
def frame(sender, kind, payload):
    pad = lambda data: data + bytes(-len(data) % 8)
    return pad(struct.pack(">iiiii", 24 + len(payload), 1700000000, 0, sender, kind)) + pad(payload)
def description(kind, number, name):
    return frame(number, kind, struct.pack(">i", len(name) + 1) + name.encode() + b"\0")
listener = socket.create_server(("127.0.0.1", 0))
def serve():
    while True:
        link = listener.accept()[0]
        link.sendall(b"vrpn: ver. 07.38  0".ljust(24, b"\0") + description(-1, 0, "Phantom")
                     + description(-2, 0, "vrpn_Tracker Pos_Quat")
                     + frame(0, 0, struct.pack(">ii7d", 0, 0, 0.01, 0.02, 0.03, 0, 0, 0, 1)))
        threading.Thread(target=lambda: [None for _ in iter(lambda: link.recv(4096), b"")], daemon=True).start()
threading.Thread(target=serve, daemon=True).start()
name = f"Phantom@tcp://127.0.0.1:{listener.getsockname()[1]}"
watch = lambda form: subprocess.run([sys.argv[1], "watch", name, form, "--seconds", "2"], capture_output=True, text=True, timeout=60, check=True).stdout.splitlines()
head, *rows = watch("--csv")
row = dict(zip(head.split(","), rows[-1].split(","), strict=True))
known = {key for key, value in row.items() if value}
assert known == {"device", "time_ns", "proxy_x_m", "proxy_y_m", "proxy_z_m", "qx", "qy", "qz", "qw"}, row
assert row["proxy_y_m"] == "0.02" and row["time_ns"] == "1700000000000000000", row
assert "force_N" not in watch("--json")[-1]
EOF
