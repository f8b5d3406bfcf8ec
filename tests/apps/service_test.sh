#!/usr/bin/env bash
# What systemd learns: readiness once the server listens, and that it lives while its device is absent or disarmed. Needs Python.
set -euo pipefail
hapticd=$1
command -v python3 >/dev/null || exit 77
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 - "$hapticd" "$work" <<'PY'
import os, shutil, socket, subprocess, sys
hapticd, work = sys.argv[1:]
manager = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
manager.bind(work + "/notify")
manager.settimeout(60)
port = None

def start(runtime=work):
    log = open(work + "/log", "w")
    command = [hapticd, "serve", "--port", str(port or 0), "--http", "off", "--allow-no-rt"]
    environment = {**os.environ, "NOTIFY_SOCKET": work + "/notify", "RUNTIME_DIRECTORY": runtime}
    return subprocess.Popen(command, env=environment, stdout=log, stderr=subprocess.STDOUT)

def await_state(state):
    while manager.recv(100) != state:
        pass

def sockets():
    return [name for name in os.listdir(work) if name.endswith(".sock")]

# A device whose loop does not start, here without realtime rights: not ready, and no crash.
os.chmod(work, 0o777)
os.chmod(work + "/notify", 0o777)
shutil.copy(hapticd, work + "/hapticd")
with open(work + "/hand.csv", "w") as hand:
    hand.write("t_s,x_m,y_m,z_m\n0,0,0,0\n1,0,0,0\n")
user = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"] if os.getuid() == 0 else []
serve = [work + "/hapticd", "serve", "--port", "0", "--http", "off", "--device", "replay", "--hand", work + "/hand.csv"]
refused = subprocess.run(["bash", "-c", 'ulimit -r 0; ulimit -l 64; exec "$@"', "-", *user, *serve], timeout=60, text=True,
                         env={**os.environ, "NOTIFY_SOCKET": work + "/notify", "RUNTIME_DIRECTORY": work},
                         stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
assert refused.returncode == 1 and "--allow-no-rt" in refused.stdout, refused.stdout
manager.setblocking(False)
try:
    raise AssertionError(manager.recv(100))
except BlockingIOError:
    manager.settimeout(60)
assert not os.path.exists(work + "/running")

server = start()
try:
    assert manager.recv(100) == b"READY=1"
    assert len(sockets()) == 1, sockets()
    port = int(sockets()[0].split(".")[0])
    for _ in range(2):
        await_state(b"WATCHDOG=1")
    # After a crash forces are stopped, and the socket that is left is replaced.
    server.kill()
    server.wait()
    assert len(sockets()) == 1
    server = start()
    await_state(b"READY=1")
    stop = [hapticd, "stop", "--rearm", f"Phantom@unix:{work}/{port}.sock"]
    assert "forces ramp in" in subprocess.run(stop, stdout=subprocess.PIPE, timeout=60, text=True).stdout
    server.terminate()
    await_state(b"STOPPING=1")
    assert server.wait(60) == 0
    assert "did not end in order" in open(work + "/log").read()
    assert not sockets()
    server = start()
    await_state(b"READY=1")
    server.terminate()
    assert server.wait(60) == 0
    assert "did not end in order" not in open(work + "/log").read()
    assert "after a crash" not in open(work + "/log").read()
    # A mark that cannot be set is said: after a crash nothing would keep the forces stopped.
    os.mkdir(work + "/full")
    os.symlink("/dev/full/running", work + "/full/running")
    server = start(work + "/full")
    await_state(b"READY=1")
    server.terminate()
    assert server.wait(60) == 0
    assert "forces are not stopped after a crash: cannot create" in open(work + "/log").read()
finally:
    server.kill()
PY
