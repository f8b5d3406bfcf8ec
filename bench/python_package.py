"""Measures the Python package: reports decoded, mesh upload, reader of recordings, round trip.

    PYTHONPATH=python python3 bench/python_package.py build/release/bin/hapticd [build/release/bin/client_script]
"""

import os
import re
import struct
import subprocess
import sys
import tempfile
import time
import zlib

import numpy as np

import hapticd
from hapticd import _messages as m
from hapticd._address import parse
from hapticd._codec import frame
from hapticd._core import _NUMBERS, Core
from hapticd._peer import COOKIE, _description


def serve(program, *options):
    process = subprocess.Popen(
        [program, "serve", "--listen", "127.0.0.1:0", "--http", "off", "--allow-no-rt", *options],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    for line in process.stdout:
        found = re.search(r"listening on [0-9.]+:([0-9]+)", line)
        if found:
            return process, f"Phantom@tcp://127.0.0.1:{found.group(1)}"
    raise SystemExit("the server did not start")


def decoded(kind, message, count=100_000):
    """Reports per second of processor time: frames in, reports, latest and one callback out."""
    core = Core(parse("Phantom@localhost"), hapticd.Options())
    core._opened(None)
    number, layout = _NUMBERS[type(message)]
    core._received(COOKIE + frame(0, 0, 0, -1, _description(b"Phantom")) + frame(0, 0, number, -2, _description(layout.name.encode())))
    one = frame(1, 2, 0, number, layout.encode(message))
    block = one * 100
    reports = []
    core.on(kind, reports.append)
    start = time.process_time()
    for _ in range(count // 100):
        core._received(block)
        core._dispatch()
    seconds = time.process_time() - start
    assert len(reports) == count
    return count / seconds


def round_trips(name, count):
    """Median and 99th percentile of the time from a question to its answer, in microseconds."""
    with hapticd.connect(name) as hand:
        answers = []
        hand.on_workspace(answers.append)
        hand.subscribe(hapticd.Reports.NONE)
        hand.run_for(1)
        times = []
        for _ in range(count):
            before = len(answers)
            start = time.perf_counter()
            hand.request_workspace()
            while len(answers) == before:
                hand.poll(1.0)
            times.append((time.perf_counter() - start) * 1e6)
            time.sleep(0.0005)
    return tuple(np.quantile(times, [0.5, 0.99]))


def contact_turns(name, seconds):
    """Median and 99th percentile of the time in the client from a Hand_State that can be read to 16 contacts that the
    system has taken, in microseconds, and how many there were."""
    with hapticd.connect(name) as hand:
        hand.subscribe(hapticd.Reports.HAND, rate_Hz=1000)
        contacts = [hapticd.RemoteContact(i, (0, -0.05 - 0.001 * i, 0), (0, 1, 0), velocity_m_per_s=(0.01, 0, 0)) for i in range(16)]
        readable = [0.0]
        select = hand._select

        def noted(timeout):
            ready = select(timeout)
            readable[0] = time.perf_counter()
            return ready

        hand._select = noted
        times = []

        def answer(state):
            hand.set_remote_contacts(contacts)
            hand.flush()
            times.append((time.perf_counter() - readable[0]) * 1e6)

        hand.on_hand(answer)
        hand.run_for(seconds)
    return (*np.quantile(times, [0.5, 0.99]), len(times))


def long_recording(program, folder, ticks):
    """A recording of so many ticks: the blocks of a real one, again and again."""
    short = os.path.join(folder, "short.haptics")
    process, name = serve(program, "--record", short)
    with hapticd.connect(name) as hand:
        hand.upload_mesh(0, *hapticd.sphere(25))
        hand.run_for(5)
    process.terminate()
    process.wait()
    data = open(short, "rb").read()
    with hapticd.Session(short) as session:
        count = len(session.ticks)
        blocks = session._blocks
        runs = [data[s - 12 : s + n] for kind, s, n in blocks if kind == 4]
        head = data[: blocks[0][1] + blocks[0][2]]
    path = os.path.join(folder, "long.haptics")
    content = struct.pack(">q", 0)
    end = struct.pack(">II", 6, 8)
    with open(path, "wb") as file:
        file.write(head)
        for _ in range(-(-ticks // count)):
            file.write(b"".join(runs))
        file.write(end + struct.pack(">I", zlib.crc32(content, zlib.crc32(end))) + content)
    return path


def main():
    program = sys.argv[1]
    print(f"tick reports decoded:  {decoded('tick', m.TickReport()):9.0f} /s")
    print(f"pose reports decoded:  {decoded('pose', m.TrackerPosQuat()):9.0f} /s")
    rounds = {"Python": [], "C++": []}
    process, name = serve(program)
    grid = 708  # 708 * 708 * 2 = 1 002 528 triangles
    x, z = np.meshgrid(np.linspace(-50, 50, grid + 1), np.linspace(-50, 50, grid + 1))
    vertices = np.stack([x, np.sin(x) * np.sin(z) - 20, z], axis=-1).reshape(-1, 3).astype(np.float32)
    i = (np.arange(grid)[:, None] * (grid + 1) + np.arange(grid)).ravel()
    triangles = np.concatenate([np.stack([i, i + grid + 1, i + 1], 1), np.stack([i + 1, i + grid + 1, i + grid + 2], 1)])
    with hapticd.connect(name) as hand:
        hand.wait_capabilities()
        sent = hand.statistics().tcp_bytes_out
        processor, start = time.process_time(), time.monotonic()
        hand.upload_mesh(0, vertices, triangles)
        seconds, processor = time.monotonic() - start, time.process_time() - processor
        size = hand.statistics().tcp_bytes_out - sent
        print(f"upload of {len(triangles)} triangles: {size / 1e6:.1f} MB in {seconds:.3f} s, {size / 1e6 / seconds:.0f} MB/s; "
              f"processor of the client {processor:.3f} s")
    for turn in range(5):  # alternating, so that both meet the same machine
        rounds["Python"].append(round_trips(name, 1000))
        if len(sys.argv) > 2:
            told = subprocess.run([sys.argv[2], name, "1000"], check=True, capture_output=True, text=True).stdout
            rounds["C++"].append(tuple(map(float, told.split())))
    for language, values in rounds.items():
        if values:
            p50, p99 = np.median(values, axis=0)
            print(f"question to answer in {language}: median {p50:.0f} us, p99 {p99:.0f} us (medians of 5 x 1000)")
    if rounds["C++"]:
        ours, theirs = (np.median(rounds[language], axis=0) for language in ("Python", "C++"))
        print(f"  Python over C++: median {ours[0] / theirs[0]:.1f}, p99 {ours[1] / theirs[1]:.1f}")
    p50, p99, count = contact_turns(name, 5)
    print(f"Hand_State in to 16 remote contacts out: median {p50:.0f} us, p99 {p99:.0f} us ({count} in 5 s)")
    process.terminate()
    process.wait()
    print(f"load: {os.getloadavg()[0]:.1f}")
    with tempfile.TemporaryDirectory() as folder:
        path = long_recording(program, folder, 1_000_000)
        for verify in (True, False):
            start, processor = time.monotonic(), time.process_time()
            with hapticd.Session(path, verify=verify) as session:
                ticks = session.ticks
                count = len(ticks)
                opened = time.monotonic() - start
                for column in ("time_ns", "hip_m", "proxy_m", "force_N", "depth_m"):
                    ticks[column]
            seconds, processor = time.monotonic() - start, time.process_time() - processor
            checked = "checksums verified" if verify else "without checksums"
            print(f"reader: {count} ticks ({os.path.getsize(path) / 1e6:.0f} MB) in {seconds:.2f} s, {opened:.2f} s of it "
                  f"to find them; 5 columns, {checked}; processor {processor:.2f} s")  # fmt: skip


main()
