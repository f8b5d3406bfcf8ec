#!/usr/bin/env bash
# The server under the limits, the system calls and the rights of packaging/systemd/hapticd.service, without systemd: as another
# user, without capabilities. Its servo thread gets SCHED_FIFO, its memory is locked, and it serves. Needs root, Python and
# systemd-analyze for the groups of system calls.
set -euo pipefail
hapticd=$1
source_dir=$2
skip() { echo "skipped: $1"; exit 77; }
[ "$(id -u)" = 0 ] || skip "not root"
for tool in python3 systemd-analyze setpriv; do command -v "$tool" >/dev/null || skip "$tool is missing"; done
numbers=$(find /usr/include -path '*asm/unistd_64.h' | head -1)
[ "$(uname -m)" = x86_64 ] && [ -n "$numbers" ] || skip "no table of system calls"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
chmod 0755 "$work"
for unit in hapticd hapticd-loopback; do
  mkdir -m 0777 -p "$work/$unit"
  python3 - "$hapticd" "$source_dir/packaging/systemd/$unit.service" "$numbers" "$work/$unit" <<'PY'
import ctypes, os, re, resource, signal, struct, subprocess, sys, time
hapticd, unit, numbers, work = sys.argv[1:]
settings = re.findall(r"^(\w+)=(.*)$", open(unit).read(), re.M)

calls = {name: int(number) for name, number in re.findall(r"#define __NR_(\w+) (\d+)", open(numbers).read())}
def members(name):
    if not name.startswith("@"):
        return {name}
    lines = subprocess.run(["systemd-analyze", "syscall-filter", name], capture_output=True, text=True, check=True).stdout.splitlines()
    return set().union(*(members(line.strip()) for line in lines if line.startswith("    ") and not line.strip().startswith("#")))
allowed = members("@default")
for key, value in settings:
    if key == "SystemCallFilter":
        group = set().union(*(members(word) for word in value.lstrip("~").split()))
        allowed = allowed - group if value.startswith("~") else allowed | group
allowed_numbers = sorted(calls[name] for name in allowed if name in calls)
assert calls["sched_setscheduler"] in allowed_numbers and calls["mlockall"] in allowed_numbers
assert calls["ptrace"] not in allowed_numbers and calls["mount"] not in allowed_numbers

# Load the number; allow those of the list, else the error that the unit names.
code = struct.pack("=HBBI", 0x20, 0, 0, 0)
for number in allowed_numbers:
    code += struct.pack("=HBBI", 0x15, 0, 1, number) + struct.pack("=HBBI", 0x06, 0, 0, 0x7FFF0000)
code += struct.pack("=HBBI", 0x06, 0, 0, 0x00050001)

limits = {"LimitRTPRIO": "RLIMIT_RTPRIO", "LimitMEMLOCK": "RLIMIT_MEMLOCK", "LimitCORE": "RLIMIT_CORE", "LimitNOFILE": "RLIMIT_NOFILE"}
# A container may forbid to raise limits; two capabilities then stand in for those of realtime and locked memory.
raises = int(re.search(r"CapEff:\s+(\w+)", open("/proc/self/status").read()).group(1), 16) >> 24 & 1
CAPABILITIES = 0 if raises else 1 << 14 | 1 << 23  # CAP_IPC_LOCK, CAP_SYS_NICE

def confine():
    libc = ctypes.CDLL(None, use_errno=True)
    def check(result):
        if result != 0:
            raise OSError(ctypes.get_errno(), "prctl or capset")
    for key, value in settings:
        if key in limits and (raises or key in ("LimitCORE", "LimitNOFILE")):
            most = resource.RLIM_INFINITY if value == "infinity" else int(value)
            resource.setrlimit(getattr(resource, limits[key]), (most, most))
    check(libc.prctl(8, 1, 0, 0, 0))  # PR_SET_KEEPCAPS
    os.setgroups([])
    os.setresgid(65534, 65534, 65534)
    os.setresuid(65534, 65534, 65534)
    check(libc.capset(struct.pack("=Ii", 0x20080522, 0), struct.pack("=6I", CAPABILITIES, CAPABILITIES, CAPABILITIES, 0, 0, 0)))
    for number in range(32):
        if CAPABILITIES >> number & 1:
            check(libc.prctl(47, 2, number, 0, 0))  # PR_CAP_AMBIENT_RAISE
    check(libc.prctl(38, 1, 0, 0, 0))  # PR_SET_NO_NEW_PRIVS
    buffer = ctypes.create_string_buffer(code, len(code))
    program = struct.pack("=HxxxxxxQ", len(code) // 8, ctypes.addressof(buffer))
    check(libc.prctl(22, 2, program, 0, 0))  # PR_SET_SECCOMP

log = open(work + "/log", "w")
server = subprocess.Popen([hapticd, "serve", "--listen", "127.0.0.1:0", "--http", "127.0.0.1:0"], preexec_fn=confine, stdout=log,
                          stderr=subprocess.STDOUT, cwd=work, env={"PATH": "/usr/bin", "XDG_STATE_HOME": work, "RUNTIME_DIRECTORY": work})
try:
    end = time.time() + 60
    text = ""
    while "viewer: " not in text:
        assert time.time() < end and server.poll() is None, text
        time.sleep(0.1)
        text = open(work + "/log").read()
    policies = {}
    for thread in os.listdir(f"/proc/{server.pid}/task"):
        name = open(f"/proc/{server.pid}/task/{thread}/comm").read().strip()
        policies[name] = (os.sched_getscheduler(int(thread)), os.sched_getparam(int(thread)).sched_priority)
    assert (os.SCHED_FIFO, 80) in policies.values(), policies
    status = open(f"/proc/{server.pid}/status").read()
    assert re.search(r"^Seccomp:\s+2$", status, re.M) and int(re.search(r"CapEff:\s+(\w+)", status).group(1), 16) == CAPABILITIES, status
    locked = int(re.search(r"VmLck:\s+(\d+)", status).group(1))
    assert locked > 10_000, status
    address = re.search(r"listening on (\S+:\d+)", text).group(1)
    answer = subprocess.run([hapticd, "stop", f"Phantom@tcp://{address}"], capture_output=True, text=True, timeout=60)
    assert "forces are off" in answer.stdout, answer
    server.send_signal(signal.SIGTERM)
    assert server.wait(60) == 0, open(work + "/log").read()
    print(os.path.basename(unit), len(allowed_numbers), "system calls;", locked, "kB locked; limits", "raised" if raises else "replaced by capabilities;", policies)
finally:
    server.kill()
PY
done
