#!/usr/bin/env bash
# A client of a tunnel ends while the server does not read: all that it sent arrives, and it sees the end of its connection
# only then.
set -euo pipefail
hapticd=$1
command -v python3 >/dev/null || exit 77
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 - "$hapticd" "$work/server.sock" <<'PYTHON'
import os, socket, subprocess, sys
program, path = sys.argv[1:]
server = socket.socket(socket.AF_UNIX)
server.bind(path)
server.listen()
tunnel = subprocess.Popen([program, "tunnel", "unix:" + path, "--port", "0"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
try:
    port = int(tunnel.stdout.readline().split(";")[0].rsplit(":", 1)[1])
    server.accept()[0].close()  # its attempt
    upload = os.urandom(5 << 18)  # more than the tunnel queues
    client = socket.create_connection(("127.0.0.1", port))
    client.settimeout(60)
    far = server.accept()[0]
    far.settimeout(60)
    client.sendall(upload)
    client.shutdown(socket.SHUT_WR)
    client.settimeout(3)  # more than the tunnel gives other ends
    try:
        sys.exit(f"the client's connection ended before the server read anything: {client.recv(1)}")
    except TimeoutError:
        pass
    arrived = b"".join(iter(lambda: far.recv(1 << 16), b""))
    if arrived != upload:
        sys.exit(f"{len(arrived)} of {len(upload)} bytes arrived")
    far.sendall(b"last words")
    far.close()
    client.settimeout(60)
    if client.recv(100):
        sys.exit("the client heard a server that it had left")
finally:
    tunnel.terminate()
PYTHON
