#!/usr/bin/env bash
# End to end: a server with the scripted hand gets a scan from a client over TCP and from one over UDP; both report contact.
set -euo pipefail
hapticd=$1
source_dir=$2
. "$(dirname "$0")/server.sh"

for name in "Phantom@tcp://$address" "Phantom@$address"; do
  "$hapticd" touch "$source_dir/testdata/meshes/bunny.obj" --server "$name" --seconds 6 >"$work/out"
  cat "$work/out"
  awk '/peak force/ { if ($3 > 0.1) force = 1 } END { exit !force }' "$work/out"
done
# A signal ends an upload that its link does not take.
if command -v python3 >/dev/null; then
  python3 - "$hapticd" "$work/large.ply" "$address" <<'PYTHON'
import array, contextlib, signal, socket, struct, subprocess, sys, threading
hapticd, mesh, address = sys.argv[1:]
n = 500
with open(mesh, "wb") as file:
    file.write(f"ply\nformat binary_little_endian 1.0\nelement vertex {n * n}\nproperty float x\nproperty float y\n"
               f"property float z\nelement face {2 * (n - 1) ** 2}\nproperty list uchar int vertex_indices\n"
               "end_header\n".encode())
    array.array("f", (c for i in range(n) for k in range(n) for c in (i, k, 0))).tofile(file)
    for i in range(n - 1):
        for k in range(i * n, i * n + n - 1):
            file.write(struct.pack("<BiiiBiii", 3, k, k + n, k + 1, 3, k + 1, k + n, k + n + 1))
link = socket.socket()
link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 16)
link.bind(("127.0.0.1", 0))
link.listen()
touch = subprocess.Popen([hapticd, "touch", mesh, "--server", f"Phantom@tcp://127.0.0.1:{link.getsockname()[1]}"],
                         stdout=subprocess.PIPE, text=True)
try:
    client = link.accept()[0]
    host, port = address.split(":")
    server = socket.create_connection((host, int(port)))

    def carry(source, sink, most):
        with contextlib.suppress(OSError):
            while most > 0 and (some := source.recv(min(most, 1 << 14))):
                sink.sendall(some)
                most -= len(some)

    threading.Thread(target=carry, args=(server, client, 1 << 60), daemon=True).start()
    carry(client, server, 1 << 18)  # then the link takes no more
    touch.send_signal(signal.SIGTERM)
    status = touch.wait(60)
    if status != -signal.SIGTERM:
        sys.exit(f"status {status}: {touch.stdout.read()}")
finally:
    touch.kill()
PYTHON
fi

kill -TERM "$server"
wait "$server"
grep -q 'ticks' "$work/log"
