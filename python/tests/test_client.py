"""The synchronous client against a real server with the simulated hand, and against scripted VRPN servers."""

import asyncio
import contextlib
import copy
import gc
import math
import os
import pathlib
import pickle
import select
import shutil
import signal
import socket
import struct
import subprocess
import sys
import textwrap
import threading
import time
import weakref
from typing import Any, Callable, Dict, List, Tuple

import numpy as np
import pytest

import hapticd
from conftest import COMMANDS, WAITS, Listener, ScriptedServer, Server, feel_a_sphere
from hapticd import Effect, Plane, Reports
from hapticd import _messages as m
from hapticd._codec import frame
from hapticd._core import _NUMBERS
from hapticd._peer import COOKIE, TYPE_NAMES, Peer, _description
from hapticd._statistics import LatencyHistogram, Statistics
from hapticd._tcp import LossWatch
from hapticd.reports import Contact, ContactsReport

WIRE = pathlib.Path(__file__).resolve().parents[2] / "testdata/wire"


def until(hand: hapticd.Client, condition: Any, seconds: float = 60) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, f"never became true; latest tick {hand.latest.tick}"
        hand.poll(0.1)


@pytest.mark.parametrize("way", ["tcp", "udp"])
def test_a_sphere_is_felt(server: Server, way: str) -> None:
    with hapticd.connect(getattr(server, way)) as hand:
        feel_a_sphere(hand)
        hand.subscribe(Reports.ALL)
        until(hand, lambda: hand.latest.tick.object == 0)
        tick = hand.latest.tick
        assert tick.object == 0 and tick.depth_m > 0 and np.linalg.norm(tick.proxy_m) == pytest.approx(0.025, abs=3e-4)
        until(hand, lambda: len(hand.latest.contacts.contacts) == 1)
        contact = hand.latest.contacts.contacts[0]
        assert contact.object == 0 and contact.normal[2] > 0.9 and contact.force_N[2] > 0
        assert hand.latest.touching.touching and hand.latest.touched_object.object == 0
        assert len(hand.latest.analog.channels) >= 6 and hand.latest.analog.channels[2] > 0
        hand.release_hand()
        statistics = hand.statistics()
        assert statistics.messages_damaged == 0 and statistics.reports["tick"].count > 0
        assert (statistics.udp_bytes_in > 0) == (way == "udp")
        assert statistics.reports["tick"].latency.count == statistics.reports["tick"].count


@pytest.mark.parametrize("way", ["tcp", "udp"])
def test_remote_contacts_and_held_forces_are_felt(server: Server, way: str) -> None:
    with hapticd.connect(getattr(server, way)) as hand:
        hand.subscribe(Reports.TRACKER | Reports.HAND, 200)
        hand.hold_hand((0, 35, 0))
        until(hand, lambda: 1 in hand.latest.pose and hand.latest.pose[1].position_m[1] > 0.034)
        floor = hapticd.RemoteContact(3, point_m=(0, 0.03, 0), normal=(0, 1, 0), stiffness_N_per_m=500)

        def pressed() -> bool:
            hand.set_remote_contacts([floor])
            return any(c.id == 3 and c.force_N[1] > 0.3 for c in hand.latest.hand.contacts)

        height_mm = 35.0
        while not pressed() and height_mm > 20:
            height_mm -= 0.1
            hand.hold_hand((0, height_mm, 0))
            hand.poll(0.01)
        assert pressed(), f"felt nothing: {hand.latest.hand}"
        hand.hold_hand((0, 35, 0))

        def pushed() -> bool:
            hand.set_force((0, 0, 0.5))
            return bool(hand.latest.hand.held_force_N[2] > 0.4)

        until(hand, pushed)
        hand.release_hand()


def test_rows_are_structured_arrays(server: Server) -> None:
    with hapticd.connect(server.tcp) as hand:
        hand.subscribe(Reports.TICK | Reports.TRACKER, 500)
        rows = hand.collect("tick", 0.5)
        assert len(rows) > 2 and rows["force_N"].shape == (len(rows), 3)
        assert np.all(np.diff(rows["tick"].astype(np.int64)) > 0)
        assert np.all(np.diff(rows["time"]) > 0)
        until(hand, lambda: 1 in hand.latest.pose)
        sensors = set()
        for report in hand.reports("pose", seconds=60):
            sensors.add(report.sensor)
            if {0, 1} <= sensors:
                break
        assert {0, 1} <= sensors
        with pytest.raises(ValueError, match="no rows of kind 'text'"):
            hand.collect("text", 0)
        with pytest.raises(ValueError, match="no reports of kind 'poses'; there are pose, velocity"):
            hand.on("poses", print)


def test_buttons_effects_planes_and_guard(server: Server) -> None:
    with hapticd.connect(server.tcp) as hand:
        hand.hold_hand((0, 0, 0), buttons=2)
        until(hand, lambda: hand.latest.pressed.get(1, False))
        hand.hold_hand((0, 0, 0))
        until(hand, lambda: not hand.latest.pressed[1])
        hand.set_effect(0, Effect.constant((0, 1, 0), 1.5))
        hand.start_effect(0)
        until(hand, lambda: hand.latest.force.force_N[1] > 1.4)
        hand.stop_forces()
        until(hand, lambda: hand.latest.guard.stopped and hand.latest.force.force_N[1] == 0)
        assert "stopped" in hand.latest.guard.active and hand.latest.guard.active.names == ("stopped",)
        assert "A client stopped the forces." in hand.latest.guard.active.explain()
        hand.rearm_forces()
        until(hand, lambda: not hand.latest.guard.stopped and hand.latest.force.force_N[1] > 1.4)
        hand.stop_effect(0)
        hand.set_plane(Plane((0, 1, 0, -0.005), 0.4))
        until(hand, lambda: hand.latest.force.force_N[1] > 0.5)
        hand.stop_plane()
        until(hand, lambda: hand.latest.force.force_N[1] == 0)


def test_sets_of_trips_combine_to_sets_of_trips() -> None:
    names = [trip[0] for trip in m.TRIPS]
    first, both = hapticd.Trips(1), hapticd.Trips(1) | hapticd.Trips(2)
    assert both.names == (names[0], names[1]) and names[1] in both and both.explain().count("\n") == 1
    for trips in (both & first, both ^ hapticd.Trips(2), 1 & both, 0 | first, 2 ^ both):
        assert isinstance(trips, hapticd.Trips) and trips.names == (names[0],)
    trips = first
    trips |= 2
    assert trips.names == both.names


def test_errors_have_the_servers_text(server: Server) -> None:
    with hapticd.connect(server.tcp, throw_on_error=True) as hand:
        texts: List[hapticd.TextReport] = []
        with hand.on_text(texts.append):
            hand.set_object_count(-4)
            with pytest.raises(hapticd.ServerError, match="-4"):
                until(hand, lambda: False)
        assert texts[-1].severity == hapticd.Severity.ERROR


def test_a_second_hand_is_refused_with_its_code(server: Server) -> None:
    with hapticd.connect(server.tcp) as first, hapticd.connect(server.tcp) as second:
        first.hold_hand((0, 0, 0))
        until(first, lambda: 1 in first.latest.pose)
        texts: List[hapticd.TextReport] = []
        second.on_text(texts.append)
        second.hold_hand((1, 0, 0))
        until(second, lambda: texts)
        assert texts[0].level == 3


def test_a_batch_that_raises_sends_nothing(server: Server) -> None:
    with hapticd.connect(server.tcp) as hand:
        texts: List[hapticd.TextReport] = []
        hand.on_text(texts.append)
        sent = hand.statistics().tcp_bytes_out
        with pytest.raises(KeyError):
            with hand.batch():
                hand.set_object_count(-1)
                raise KeyError
        hand.run_for(0.1)
        assert hand.statistics().tcp_bytes_out - sent < 200 and texts == []
        with pytest.raises(RuntimeError, match="batches do not nest"):
            with hand.batch():
                with hand.batch():
                    pass


def test_a_mesh_without_triangles_is_no_list_of_corners() -> None:
    none = np.zeros((0, 3), dtype=np.int32)
    for extensions in (True, False):
        server = ScriptedServer(extensions)
        with hapticd.connect(server.name) as hand:
            hand.upload_mesh(3, np.eye(3), none)
            hand.send_text("end")
            hand.flush_all()
            server.wait_for("vrpn_Base text_message")
        sent = [name for name, _ in server.received]
        assert "vrpn_ForceDevice clearTrimesh" in sent
        assert not any("ertex" in name or "ertices" in name for name in sent), sent
        server.close()


def test_a_large_mesh_reports_its_progress(server: Server) -> None:
    vertices, triangles = hapticd.sphere(25, rings=100)
    with hapticd.connect(server.tcp) as hand:
        steps: List[hapticd.UploadProgress] = []
        hand.upload_mesh(0, vertices, triangles, steps.append)
        assert steps[-1].bytes_sent == steps[-1].bytes_total > 12 * (len(vertices) + len(triangles))
        assert [s.bytes_sent for s in steps] == sorted(s.bytes_sent for s in steps)
        with pytest.raises(ValueError, match="triangle 1 names vertex 7, the mesh has 3"):
            hand.upload_mesh(0, np.zeros((3, 3)), [[0, 1, 2], [0, 7, 1]])
        with pytest.raises(ValueError, match=r"vertices of shape \(3, 2\): give \(n, 3\)"):
            hand.upload_mesh(0, np.zeros((3, 2)), [[0, 1, 2]])
        with pytest.raises(ValueError, match=r"corners of shape \(4, 3\): give three rows for each triangle"):
            hand.upload_corners(0, np.zeros((4, 3)))


def test_a_stop_passes_a_large_upload(server: Server) -> None:
    vertices, triangles = hapticd.sphere(25, rings=300)
    with hapticd.connect(server.tcp) as hand:
        for object in range(3):
            frames, _ = hand._mesh_frames(object, np.asarray(vertices, ">f4"), np.asarray(triangles, ">i4"))
            hand._peer.stream.extend(frames)  # type: ignore[union-attr]
        hand.flush()
        hand.stop_forces()
        until(hand, lambda: hand.latest.guard.stopped)
        hand.rearm_forces()
        until(hand, lambda: not hand.latest.guard.stopped)


def test_who_stopped_re_arms_on_its_next_connection(server: Server) -> None:
    with hapticd.connect(server.tcp) as hand, hapticd.connect(server.tcp) as other:
        hand.stop_forces()
        until(other, lambda: other.latest.guard.stopped)
        hand._fail("lost")
        until(hand, lambda: hand.connected)
        hand.rearm_forces()
        until(other, lambda: not other.latest.guard.stopped)


def test_heartbeats_stop_with_the_polling(server: Server) -> None:
    for _ in range(5):  # a busy machine may not run this process for 500 ms
        hand = hapticd.connect(server.tcp, reconnect=False)
        hand.enable_heartbeat()
        hand.run_for(0.8)
        if hand.connected:
            break
        hand.close()
    with hand, hapticd.connect(server.tcp) as other:
        assert hand.connected
        losses: List[hapticd.ConnectionReport] = []
        hand.on_connection(losses.append)
        time.sleep(1.0)
        until(hand, lambda: not hand.connected)
        hand.poll()
        assert losses and not losses[-1].connected and losses[-1].reason
        with pytest.raises(hapticd.ConnectionLost):
            hand.stop_forces()
        assert other.connected


def test_a_restarted_server_is_found_again() -> None:
    server = Server()
    with hapticd.connect(server.tcp) as hand:
        hand.subscribe(Reports.TICK)
        until(hand, lambda: hand.latest.tick.tick > 0)
        events: List[bool] = []
        hand.on_connection(lambda c: events.append(c.connected))
        server.stop()
        until(hand, lambda: events == [False])
        assert hand.latest.tick.tick == 0
        hand.set_object_count(2)
        assert hand.statistics().messages_dropped == 1
        server.start(f"127.0.0.1:{server.port}")
        until(hand, lambda: events == [False, True] and hand.latest.tick.tick > 0)
    server.stop()


def test_reports_of_a_connection_that_nobody_renews_end() -> None:
    server = Server()
    with hapticd.connect(server.tcp, reconnect=False) as hand:
        waits = [hand.reports("pose", 20), hand.rows("pose", 20)]
        for reports in waits:
            next(reports)
        server.stop()
        for reports in waits:
            with pytest.raises(hapticd.ConnectionLost, match=f"connection to 127.0.0.1:{server.port} lost"):
                for _ in reports:
                    pass
        with pytest.raises(hapticd.ConnectionLost, match="lost"):
            hand.collect("pose", 20)
        hand.run_for(0.01)


@pytest.mark.parametrize("way", ["tcp", "udp"])
def test_a_closed_client_is_not_connected_and_every_command_raises(server: Server, way: str) -> None:
    others = {
        "batch", "capabilities", "close", "connected", "device", "flush", "latest", "on", "reports", "rows", "run_for",
        "server", "statistics",
    }  # fmt: skip
    with hapticd.connect(getattr(server, way)) as hand:
        public = {name for name in dir(hand) if not name.startswith(("_", "on_"))}
        assert public == {*COMMANDS, *WAITS, *others}
        hand.run_for(0.1)
        with pytest.raises(hapticd.ConnectionLost, match="nothing of it was sent"):
            with hand.batch():
                hand.set_object_count(2)
                hand.close()
                with pytest.raises(hapticd.ConnectionLost, match="is closed"):
                    hand.set_object_count(3)
    assert not hand.connected and hand.capabilities is None
    pose = hand.latest.pose
    assert pose  # the newest state stays
    waits: Dict[str, Tuple[Any, ...]] = {**WAITS, "run_for": (60,)}
    for name, arguments in {**COMMANDS, **waits}.items():
        with pytest.raises(hapticd.ConnectionLost, match="this client of Phantom@127.0.0.1:[0-9]+ is closed"):
            getattr(hand, name)(*arguments)
            pytest.fail(f"{name}() returned")
    for generator in (hand.reports("force"), hand.rows("force")):
        with pytest.raises(hapticd.ConnectionLost, match="is closed"):
            next(generator)
    with pytest.raises(hapticd.ConnectionLost, match="is closed"):
        with hand.batch():
            pass
    hand.flush()
    hand.close()
    assert hand.latest.pose is pose and hand.statistics().messages_dropped == 0


@pytest.mark.parametrize("way", ["tcp", "udp"])
def test_a_stop_that_nothing_receives_raises(way: str) -> None:
    calls = {"stop_forces": "forces not stopped", "mark": "not marked", "rearm_forces": "forces not re-armed"}
    for name, what in calls.items():
        server = Server()
        with hapticd.connect(getattr(server, way), connect_timeout=60) as hand:
            hand.wait_capabilities()
            server.process.kill()
            server.process.wait(30)
            time.sleep(0.1)  # until the end of the connection has arrived; nothing polls meanwhile
            with pytest.raises(hapticd.ConnectionLost, match=f"{what}: .*{server.port}"):
                getattr(hand, name)(*COMMANDS[name])
            assert not hand.connected
            for again in ("stop_forces", "mark"):
                with pytest.raises(hapticd.ConnectionLost, match=f"{calls[again]}: .*{server.port}"):
                    getattr(hand, again)(*COMMANDS[again])
        server.reader.join(30)


def test_a_flush_before_the_first_connection_says_that_there_is_none() -> None:
    scripted = ScriptedServer()
    with hapticd.connect(scripted.name, connect_timeout=0) as hand:
        hand.set_object_count(2)
        with pytest.raises(hapticd.ConnectionLost, match="nothing is sent yet: no VRPN server at "):
            hand.flush_all()

    async def run() -> None:
        async with hapticd.aio.connect(scripted.name, connect_timeout=0) as hand:
            with pytest.raises(hapticd.ConnectionLost, match="nothing is sent yet: no VRPN server at "):
                await hand.flush_all()

    asyncio.run(run())


def test_a_stop_before_the_first_connection_raises() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    with hapticd.connect(f"Phantom@tcp://127.0.0.1:{port}", connect_timeout=0) as hand:
        with pytest.raises(hapticd.ConnectionLost, match="forces not stopped: "):
            hand.stop_forces()
        with pytest.raises(hapticd.ConnectionLost, match="not marked: "):
            hand.mark("trial 3 begins")


def test_texts_that_are_too_long_are_refused(server: Server) -> None:
    with hapticd.connect(server.tcp) as hand:
        sent = hand.statistics().messages_out
        limits: List[Tuple[Callable[[str], None], int]] = [
            (hand.mark, 255),
            (hand.send_text, 1023),
            (lambda name: hand.set_object_name(0, name), 64),
        ]
        for call, most in limits:
            for text in ("x" * (most + 1), "x" * most + "ä", "ä" * (most // 2 + 1)):
                with pytest.raises(ValueError, match=f"has {len(text.encode())} bytes, at most {most}"):
                    call(text)
        assert hand.statistics().messages_out == sent
        hand.mark("x" * 255)
        hand.send_text("ä" * 511)


#: In a network of its own, which it breaks.
BREAKS_THE_NETWORK = """
import asyncio, subprocess, sys, time
import hapticd
from conftest import Server

server = Server()


def link(state):
    subprocess.run(["ip", "link", "set", "lo", state], check=True)


def connect():
    reading = [hapticd.connect(server.tcp), hapticd.connect(server.udp)]
    beating = hapticd.connect(server.tcp)
    beating.enable_heartbeat()
    return [*reading, beating]


async def main():
    hands = connect()
    looping = [await hapticd.aio.connect(server.tcp), await hapticd.aio.connect(server.udp)]
    beating = await hapticd.aio.connect(server.tcp)
    await beating.enable_heartbeat()
    looping.append(beating)

    async def until(connected):
        deadline = time.monotonic() + 120
        while any(hand.connected != connected for hand in [*hands, *looping]):
            assert time.monotonic() < deadline, [hand.connected for hand in [*hands, *looping]]
            for hand in hands:
                hand.poll()
            await asyncio.sleep(0.02)

    await until(True)
    link("down")
    await until(False)
    link("up")
    await until(True)
    for hand in hands:
        hand.close()
    for hand in looping:
        await hand.close()


try:
    asyncio.run(main())
finally:
    server.stop()
"""


def test_a_lost_network_is_noticed_and_the_client_reconnects() -> None:
    """Nothing tells a client that only reads of the end of its server's machine."""
    network = ["unshare", "--user", "--map-root-user", "--net", "sh", "-c", 'ip link set lo up && exec "$@"', "sh"]
    if shutil.which("unshare") is None or subprocess.run([*network, "true"], capture_output=True).returncode != 0:
        pytest.skip("no network of its own here")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(pathlib.Path(__file__).parent), *sys.path])}
    subprocess.run([*network, sys.executable, "-c", BREAKS_THE_NETWORK], check=True, env=environment, timeout=400)


def test_requests_name_the_address_that_the_machine_has_now(monkeypatch: pytest.MonkeyPatch) -> None:
    address = "127.0.0.2"

    def towards(_: Tuple[str, int]) -> str:
        if not address:
            raise OSError("Network is unreachable")
        return address

    for face in (hapticd.client, hapticd.aio):
        monkeypatch.setattr(face, "local_towards", towards)

    async def run() -> None:
        nonlocal address
        with contextlib.ExitStack() as opened:
            asked = [opened.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(2)]
            for sock in asked:
                sock.bind(("127.0.0.1", 0))
                sock.setblocking(False)
            names = [f"Phantom@127.0.0.1:{sock.getsockname()[1]}" for sock in asked]
            hand = opened.enter_context(hapticd.connect(names[0], connect_timeout=0))
            async with hapticd.aio.connect(names[1], connect_timeout=0):

                async def both_ask_from(host: str) -> List[Tuple[str, int]]:
                    ends: Dict[socket.socket, Tuple[str, int]] = {}
                    deadline = time.monotonic() + 60
                    while len(ends) < len(asked):
                        assert time.monotonic() < deadline, f"asked from {host}: {ends}"
                        hand.poll(0.01)
                        await asyncio.sleep(0.01)
                        for sock in asked:
                            with contextlib.suppress(BlockingIOError):
                                text = sock.recv(2048).rstrip(b"\0").decode().split()
                                if text[0] == host:
                                    ends[sock] = (text[0], int(text[1]))
                    return list(ends.values())

                await both_ask_from("127.0.0.2")
                address = ""
                for _ in range(75):
                    hand.poll(0.01)
                    await asyncio.sleep(0.01)
                address = "127.0.0.3"
                for end in await both_ask_from("127.0.0.3"):
                    socket.create_connection(end, 60).close()  # it listens there

    asyncio.run(run())


def test_a_server_is_found_at_the_address_that_its_name_has_now(monkeypatch: pytest.MonkeyPatch) -> None:
    """And while the system takes long to say so, nothing waits for it, not even the end of the client."""
    address, answer, asked = "127.0.0.1", threading.Event(), 0
    system = socket.getaddrinfo

    def getaddrinfo(host: Any, port: Any, *rest: Any, **more: Any) -> Any:
        nonlocal asked
        if host != "lab.example":
            return system(host, port, *rest, **more)
        asked += 1
        if asked > 2:
            answer.wait()
        return system(address, port, *rest, **more)

    monkeypatch.setattr(socket, "getaddrinfo", getaddrinfo)

    async def run(way: str) -> None:
        nonlocal address, asked
        address, asked = "127.0.0.1", 0
        server = Server()
        device = f"Phantom@{way}lab.example:{server.port}"
        with hapticd.connect(device) as hand:
            async with hapticd.aio.connect(device) as other:

                async def both(condition: Any) -> None:
                    deadline = time.monotonic() + 60
                    while not condition():
                        assert time.monotonic() < deadline
                        hand.poll(0.01)
                        await asyncio.sleep(0.01)

                server.stop()
                await both(lambda: not (hand.connected or other.connected))
                await both(lambda: asked == 4)
                server.start(f"127.0.0.1:{server.port}")
                await both(lambda: hand.connected and other.connected)
                assert asked == 4, "one lookup at a time"
                server.stop()
                await both(lambda: not (hand.connected or other.connected))
                address = "127.0.0.2"
                answer.set()
                server.start(f"127.0.0.2:{server.port}")
                await both(lambda: hand.connected and other.connected)
                server.stop()
                answer.clear()
                await both(lambda: all(one._host._thread.is_alive() for one in (hand, other)))

    try:
        for way in ("tcp://", ""):
            asyncio.run(run(way))
    finally:
        answer.set()


def test_a_button_that_is_released_without_a_connection_is_reported_after_it() -> None:
    """Otherwise a program holds for ever what its user has let go."""

    def states(*pressed: int) -> bytes:
        number, layout = _NUMBERS[m.ButtonStates]
        return frame(1, 0, 0, number, layout.encode(m.ButtonStates(pressed)))

    scripted = ScriptedServer()
    scripted.answer = states(1, 0, 1, 1)
    seen: List[Tuple[int, bool]] = []
    with hapticd.connect(scripted.name) as hand:
        hand.on_button(lambda report: seen.append((report.button, report.pressed)))
        until(hand, lambda: len(seen) == 3)
        seen.clear()
        scripted.answer = states(0, 0, 1)
        scripted.chatter = b"\xff" * 24  # breaks the protocol
        hand.set_object_count(1)
        until(hand, lambda: not hand.connected)
        scripted.chatter = b""
        until(hand, lambda: len(seen) == 3)
    assert seen == [(0, False), (3, False), (2, True)]
    scripted.close()


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not say what is acknowledged")
def test_a_peer_that_does_not_read_is_not_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    seconds = 100.0
    monkeypatch.setattr(time, "monotonic", lambda: seconds)

    class Socket:
        in_flight, data_ms, acknowledgement_ms, window = 0, 60000, 60000, 1

        def setsockopt(self, *_: int) -> None: ...
        def getsockopt(self, *_: int) -> bytes:
            return struct.pack("=24xI24xII168xI", self.in_flight, self.data_ms, self.acknowledgement_ms, self.window)

    def lost_within(sock: Socket, limit: float, step: float = 1.0, timeout: float = 10.0) -> bool:
        nonlocal seconds
        watch = LossWatch(sock, timeout)
        for _ in range(int(limit / step)):
            seconds += step
            if watch.is_lost():
                return True
        return False

    sock = Socket()
    assert not lost_within(sock, 100), "nothing is awaited"
    sock.in_flight = 1
    assert not lost_within(sock, 10)
    assert lost_within(sock, 12)
    assert not lost_within(sock, 100, timeout=0)
    assert not lost_within(sock, 100, step=50), "this machine stood still"
    assert lost_within(sock, 12, step=0.1)
    sock.window = 0
    assert not lost_within(sock, 100), "its program does not read"
    sock.window = 1
    sock.data_ms = 100
    assert not lost_within(sock, 100), "it sends reports"
    sock.data_ms, sock.acknowledgement_ms = 60000, 100
    assert not lost_within(sock, 100), "it acknowledges"


def test_what_is_wrong_with_a_connection_is_named(server: Server) -> None:
    with pytest.raises(ValueError, match="expected NAME@host"):
        hapticd.connect("localhost")
    for host in ("[::1]:3883", "tcp://[::1]:3883", "::1"):
        with pytest.raises(ValueError, match="IPv6 addresses are not supported; use a name or an IPv4 address"):
            hapticd.connect("Phantom@" + host)
    with pytest.raises(ValueError, match="expected NAME@host"):
        hapticd.connect("Phantom@http://localhost:3883")
    with pytest.raises(ValueError, match="port '99999', expected 1 to 65535"):
        hapticd.connect("Phantom@localhost:99999")
    with hapticd.connect(server.tcp.replace("Phantom", "Nobody"), connect_timeout=0) as nobody:
        until(nobody, lambda: nobody._server_devices)
        with pytest.raises(hapticd.ConnectError, match=r"no device 'Nobody' answers at 127.0.0.1:\d+; it has Phantom"):
            nobody.wait_connected(0.3)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        name = f"Phantom@tcp://127.0.0.1:{silent.getsockname()[1]}"
        with hapticd.connect(name, connect_timeout=0) as client:
            peer, _ = silent.accept()
            with peer, pytest.raises(hapticd.ConnectError, match="it has named none: it has no device, or it hangs"):
                peer.sendall(b"vrpn: ver. 07.38  0".ljust(24, b"\0"))
                client.wait_connected(0.3)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    with pytest.raises(hapticd.ConnectError, match="nothing listens on 127.0.0.1"):
        hapticd.connect(f"Phantom@tcp://127.0.0.1:{port}", connect_timeout=0.3)
    with pytest.raises(hapticd.ConnectError, match="nothing listens on 127.0.0.1"):
        hapticd.connect(f"Phantom@127.0.0.1:{port}", connect_timeout=0.3)
    with pytest.raises(hapticd.ConnectError, match="no server at no.such.host.invalid"):
        hapticd.connect("Phantom@no.such.host.invalid")


@pytest.mark.parametrize("throws", (False, True))
def test_what_a_server_says_does_not_reach_the_terminal_as_it_is(throws: bool) -> None:
    server = ScriptedServer(device="Phan\x1b[2Jtom\n")
    with pytest.raises(hapticd.ConnectError) as wrong:
        hapticd.connect(f"Nobody@tcp://127.0.0.1:{server.port}", connect_timeout=0.3)
    assert str(wrong.value).endswith("it has Phan\ufffd[2Jtom\ufffd")
    number, layout = _NUMBERS[m.Text]
    server.answer = frame(1700000000, 0, 0, number, layout.encode(m.Text(2, 0, "no\x1b[2J\x9b1m\nä\x7f")))
    with hapticd.connect(server.name, throw_on_error=throws) as hand:
        texts: List[str] = []
        hand.on_text(lambda report: texts.append(report.text))
        said = "no\ufffd[2J\ufffd1m\ufffdä\ufffd"
        try:
            until(hand, lambda: texts)
        except hapticd.ServerError as error:
            assert throws and str(error).endswith(said)
        assert set(texts) == {said}
    server.close()


def test_a_connection_that_is_reset_before_it_is_used_is_tried_again() -> None:
    """By a server that connects, as VRPN's do, and is gone before the client polls."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asked:
        asked.bind(("127.0.0.1", 0))
        asked.settimeout(60)
        with hapticd.connect(f"Phantom@127.0.0.1:{asked.getsockname()[1]}", connect_timeout=0) as hand:
            for _ in range(2):
                hand.run_for(0.5)
                host, port = asked.recv(100).rstrip(b"\0").decode().split()
                with socket.create_connection((host, int(port))) as server:
                    server.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                while select.select([asked], [], [], 0)[0]:
                    asked.recv(100)
                time.sleep(0.1)
            hand.poll()
            assert not hand.connected and hand._last_failure


def test_a_server_that_closes_without_an_answer_may_ask_for_tls() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def close_all() -> None:
            with contextlib.suppress(OSError):
                while True:
                    connection = listener.accept()[0]
                    connection.recv(4096)
                    connection.close()

        closer = threading.Thread(target=close_all, daemon=True)
        closer.start()
        with pytest.raises(hapticd.ConnectError, match="before it answered; a server that asks for TLS needs"):
            hapticd.connect(f"Phantom@tcp://127.0.0.1:{listener.getsockname()[1]}", connect_timeout=0.3)
        listener.shutdown(socket.SHUT_RDWR)
        closer.join()


def test_a_vrpn_server_without_extensions() -> None:
    scripted = ScriptedServer(extensions=False)
    with hapticd.connect(scripted.name) as hand:
        assert hand.wait_capabilities() is None
        calls: List[Callable[[], None]] = [hand.stop_forces, hand.rearm_forces, hand.enable_heartbeat]
        calls += [lambda: hand.hold_hand((0, 0, 0)), lambda: hand.mark("trial 3 begins")]
        for call in calls:
            with pytest.raises(hapticd.Unsupported, match="without the extensions of hapticd"):
                call()
        hand.upload_mesh(0, np.eye(3), [[0, 1, 2], [2, 1, 0]])
        hand.send_text("end")
        hand.flush_all()
        scripted.wait_for("vrpn_Base text_message")
    vertices = [payload for name, payload in scripted.received if name == "vrpn_ForceDevice setVertex"]
    assert len(vertices) == 6 and vertices[3][4:8] == (3).to_bytes(4, "big")
    scripted.close()


def test_a_recorded_stock_server_is_understood() -> None:
    """The bytes of VRPN's own server, as a client of it received them."""
    listener = socket.create_server(("127.0.0.1", 0))
    received = bytearray()

    def serve() -> None:
        connection = listener.accept()[0]
        with connection:
            connection.sendall((WIRE / "tcp.s2c.tcp.bin").read_bytes())
            while True:
                data = connection.recv(1 << 16)
                received.extend(data)
                if not data:
                    break

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    with hapticd.connect(f"Phantom@tcp://127.0.0.1:{listener.getsockname()[1]}") as hand:
        until(hand, lambda: hand.latest.pose and hand.latest.force.time > 0)
        assert hand.capabilities is None and hand.statistics().messages_damaged == 0
        assert abs(np.linalg.norm(hand.latest.pose[0].orientation) - 1) < 1e-6
    thread.join(60)
    listener.close()
    # Also when reports arrive together with the cookie: without a ping there is no pong, and no answer to wait for.
    assert b"vrpn_Base ping_message" in received
    listening = Listener()
    Peer(listening, [], None).feed(bytes(received))
    assert "vrpn_Base ping_message" in [TYPE_NAMES[message[0]] for message in listening.messages]


def test_a_stock_server_of_several_devices() -> None:
    """As VRPN's generic server with a null tracker, a button, dials and analog channels: numbers of its own for senders
    and types, every device's reports on each connection, a message that no client of this project knows."""
    pose = m.TrackerPosQuat(sensor=1, position=(0.1, 0.2, 0.3), orientation=(0.0, 0.0, 0.6, 0.8))
    said = [
        ("VRPN Control", m.Text(1, 3, "stock text")),
        ("Button0", m.ButtonChange(2, 1)),
        ("Tracker0", pose),
        ("Tracker0", m.TrackerVelocity(sensor=1, velocity=(1.0, 2.0, 3.0))),
        ("Tracker0", m.TrackerAcceleration(sensor=1, acceleration=(4.0, 5.0, 6.0))),
        ("Analog0", m.AnalogChannels((1.5, -2.5))),
        ("Tracker0", m.TrackerWorkspace((-0.2, -0.2, -0.1), (0.2, 0.2, 0.2))),
    ]
    senders = ["VRPN Control", "Button0", "Analog0", "Dial0", "Tracker0"]
    types = [_NUMBERS[type(message)] for _, message in reversed(said)]
    stream = COOKIE + frame(0, 0, 0, -2, _description(b"vrpn_Dial update"))
    for i, (_, layout) in enumerate(types, 1):
        stream += frame(0, 0, i, -2, _description(layout.name.encode()))
    for i, name in enumerate(senders):
        stream += frame(0, 0, i, -1, _description(name.encode()))
    stream += frame(7, 0, senders.index("Dial0"), 0, bytes(24))
    stream += frame(7, 0, senders.index("Tracker0"), 0, bytes(24))
    for name, message in said:
        at = types.index(_NUMBERS[type(message)])
        stream += frame(7, 500_000, senders.index(name), at + 1, types[at][1].encode(message))
    for device, kinds in {
        "Tracker0": {"pose", "velocity", "acceleration", "workspace"},
        "Button0": {"button"},
        "Analog0": {"analog"},
    }.items():
        listener = socket.create_server(("127.0.0.1", 0))

        def serve(listener: socket.socket = listener) -> None:
            connection = listener.accept()[0]
            with connection:
                connection.sendall(stream)
                while connection.recv(1 << 16):
                    pass

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        seen = {}
        with hapticd.connect(f"{device}@tcp://127.0.0.1:{listener.getsockname()[1]}") as client:
            for kind in hapticd.reports.KINDS:
                getattr(client, f"on_{kind}")(lambda report, kind=kind: seen.setdefault(kind, report))
            until(client, lambda: kinds <= set(seen))
            client.run_for(0.1)
            assert set(seen) == kinds
            assert client.capabilities is None and client.statistics().messages_damaged == 0
        thread.join(60)
        listener.close()
        assert all(report.time == 7.5 for report in seen.values())
        if device == "Tracker0":
            assert seen["pose"].sensor == 1 and seen["pose"].position_m.tolist() == [0.1, 0.2, 0.3]
            assert seen["acceleration"].acceleration_m_per_s2.tolist() == [4, 5, 6]
            assert seen["workspace"].max_m.tolist() == [0.2, 0.2, 0.2]
        elif device == "Button0":
            assert (seen["button"].button, seen["button"].pressed) == (2, True)
        else:
            assert seen["analog"].channels.tolist() == [1.5, -2.5]


def test_a_poll_in_a_callback_does_not_keep_the_outer_poll() -> None:
    scripted = ScriptedServer()
    many = 50
    with hapticd.connect(scripted.name) as hand:
        seen: List[int] = []

        def arrives(touched: int) -> None:  # as a poll() does it
            number, layout = _NUMBERS[m.TouchedObject]
            hand._peer.feed(frame(1, 0, 0, number, layout.encode(m.TouchedObject(touched))))

        def answer(report: hapticd.TouchedObjectReport) -> None:
            seen.append(report.object)
            hand.poll()
            if report.object < many:
                arrives(report.object + 1)

        hand.on("touched_object", answer)
        arrives(1)
        hand.poll()
        assert seen == [1]
        hand.poll()
        assert seen == [1, 2], "nothing is lost"
        until(hand, lambda: len(seen) == many)
        assert seen == list(range(1, many + 1))
    scripted.close()


def test_one_callback_that_raises_does_not_keep_a_report_from_the_others(server: Server) -> None:
    with hapticd.connect(server.tcp) as hand:
        heard: List[Any] = []

        def first(report: Any) -> None:
            raise KeyError("of the first")

        def last(report: Any) -> None:
            raise KeyError("of the last")

        hand.on_text(first)
        hand.on_text(heard.append)
        hand.on_text(last)
        hand.set_transform(0, np.zeros((4, 4)))  # refused by a text
        deadline = time.monotonic() + 60
        with pytest.raises(KeyError, match="of the first"):
            while time.monotonic() < deadline:
                hand.poll(1)
        assert [report.severity for report in heard] == [hapticd.Severity.ERROR]


@pytest.mark.parametrize("way", ["tcp", "udp"])
def test_a_call_while_another_thread_polls_is_refused_but_a_stop_acts(server: Server, way: str) -> None:
    """Two threads would mix their bytes in one stream, and the server would end it."""
    with hapticd.connect(getattr(server, way)) as hand, hapticd.connect(server.tcp) as other:
        hand.wait_capabilities()
        asleep, awake = threading.Event(), threading.Event()
        select = hand._select

        def sleep(timeout: float) -> Any:
            asleep.set()
            awake.wait(60)
            return select(0.0)

        hand._select = sleep  # type: ignore[method-assign,assignment]
        worker = threading.Thread(target=hand.poll)
        worker.start()
        try:
            assert asleep.wait(60)
            sent = hand.statistics().messages_out
            calls: Dict[str, Any] = {**COMMANDS, **WAITS, "flush": ()}
            for call in sorted(set(calls) - {"stop_forces", "wait_capabilities"}):
                with pytest.raises(RuntimeError, match="in use by another thread: connect one client for each thread"):
                    getattr(hand, call)(*calls[call])
            with pytest.raises(RuntimeError, match="in use by another thread"):
                with hand.batch():
                    hand.clear_mesh(0)
            assert hand.statistics().messages_out == sent
            hand.stop_forces()
            deadline = time.monotonic() + 60
            while not other.latest.guard.stopped and time.monotonic() < deadline:
                other.poll(0.1)
            assert other.latest.guard.stopped
        finally:
            awake.set()
            worker.join(60)
            hand._select = select  # type: ignore[method-assign]
        rearm(hand, other)
        assert hand.statistics().connections == 1


def rearm(hand: hapticd.Client, other: hapticd.Client) -> None:
    """Ends a stop that the other one has seen. A re-arm acts only while its client is there."""
    hand.rearm_forces()
    until(other, lambda: not other.latest.guard.stopped)


class Interrupted:
    """A socket during whose first send() a signal arrives."""

    def __init__(self, sock: Any, handler: Callable[[], None]) -> None:
        self._sock = sock
        self._handlers = [handler]

    def send(self, data: Any) -> int:
        sent = int(self._sock.send(data))
        while self._handlers:
            self._handlers.pop()()
        return sent

    def __getattr__(self, name: str) -> Any:
        return getattr(self._sock, name)


def test_a_signal_handler_may_stop_the_forces_while_bytes_are_written(server: Server) -> None:
    with hapticd.connect(server.tcp) as hand, hapticd.connect(server.tcp) as other:
        hand.wait_capabilities()
        assert not other.latest.guard.stopped

        def handler() -> None:
            hand.mark("in a handler")
            hand.stop_forces()

        hand._sock = Interrupted(hand._sock, handler)  # type: ignore[assignment]
        texts: List[str] = []
        hand.on_text(lambda report: texts.append(report.text))
        hand.upload_mesh(0, *hapticd.sphere(25))
        until(other, lambda: other.latest.guard.stopped)
        until(hand, lambda: "marked for all clients; this server records nothing" in texts)
        assert hand.statistics().connections == 1
        hand._sock = hand._sock._sock  # type: ignore[attr-defined]
        rearm(hand, other)


def test_another_thread_may_close_a_client_that_waits(server: Server) -> None:
    hand = hapticd.connect(server.tcp)
    ends: List[BaseException] = []

    def work() -> None:
        try:
            hand.run_for(3600)
        except BaseException as end:
            ends.append(end)

    worker = threading.Thread(target=work)
    worker.start()
    while not hand._inside and worker.is_alive():
        time.sleep(0.001)
    hand.close()
    worker.join(60)
    assert [type(end) for end in ends] == [hapticd.ConnectionLost]


def test_a_client_is_not_copied(server: Server) -> None:
    """The copy would close the sockets of the first when it ends."""
    with hapticd.connect(server.tcp) as hand:
        for attempt in (copy.copy, copy.deepcopy, pickle.dumps):
            with pytest.raises(TypeError, match="cannot be copied or pickled: connect where it is used"):
                attempt(hand)
        hand.run_for(0.01)
        assert hand.connected
        report = hand.latest.guard
        assert pickle.loads(pickle.dumps(report)) == copy.deepcopy(report) == report


def test_ctrl_c_ends_a_wait_and_nothing_is_left(server: Server) -> None:
    program = textwrap.dedent(
        f"""
        import hapticd
        hand = hapticd.connect("{server.tcp}")
        hand.set_effect(9, hapticd.Effect.constant((1, 0, 0), 1)); hand.start_effect(9); hand.flush_all()
        print("ready", flush=True)
        hand.run_for(1000)
        """
    )
    child = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert child.stdout is not None and child.stdout.readline() == "ready\n"
    with hapticd.connect(server.tcp) as hand:
        until(hand, lambda: hand.latest.force.force_N[0] > 0.5)
        child.send_signal(signal.SIGINT)
        _, errors = child.communicate(timeout=60)
        assert child.returncode != 0 and errors.rstrip().endswith("KeyboardInterrupt")
        until(hand, lambda: hand.latest.force.force_N[0] == 0)


def test_a_value_that_was_refused_does_not_come_back_on_the_next_connection() -> None:
    scripted = ScriptedServer()
    right = "0123456789abcdef"
    with hapticd.connect(scripted.name) as hand:
        hand.wait_capabilities()
        hand.subscribe(Reports.FORCE, 100)
        hand.present_token(right)

        def refuse() -> None:
            for call, value in [(hand.subscribe, -1), (hand.present_token, right + "\0"), (hand.set_update_rate, "fast")]:
                with pytest.raises(ValueError):
                    call(value)

        refuse()
        hand.send_text("end")
        hand.flush_all()
        scripted.wait_for("vrpn_Base text_message")
        hand._fail("lost")
        hand.set_update_rate(50)
        refuse()
        scripted.received.clear()
        until(hand, lambda: hand.connected)
        hand.send_text("end")
        hand.flush_all()
        scripted.wait_for("vrpn_Base text_message")
    names = [_NUMBERS[kind][1].name for kind in (m.Identify, m.Subscribe, m.TrackerSetUpdateRate)]
    again = {name: payload for name, payload in scripted.received if name in names}
    assert list(again) == names
    assert _NUMBERS[m.Subscribe][1].decode(again[names[1]]) == m.Subscribe(int(Reports.FORCE), 100)
    assert _NUMBERS[m.TrackerSetUpdateRate][1].decode(again[names[2]]) == m.TrackerSetUpdateRate(50)
    scripted.close()


def test_an_upload_that_is_interrupted_does_not_appear() -> None:
    vertices, triangles = hapticd.sphere(25, rings=600)
    scripted = ScriptedServer()
    with hapticd.connect(scripted.name, send_timeout=100) as hand:
        hand.wait_capabilities()
        events: List[bool] = []
        hand.on_connection(lambda c: events.append(c.connected))
        hand.poll()
        scripted.reads.clear()  # the system takes only a part of the mesh
        sent = hand._counts.tcp_bytes_out

        def interrupt() -> None:
            while hand._counts.tcp_bytes_out < sent + 100000:
                time.sleep(0.01)
            os.kill(os.getpid(), signal.SIGINT)

        interrupter = threading.Thread(target=interrupt, daemon=True)
        interrupter.start()
        with pytest.raises(KeyboardInterrupt):
            hand.upload_mesh(0, vertices, triangles)
        interrupter.join()
        scripted.reads.set()
        until(hand, lambda: events[-2:] == [False, True], 20)
        hand.send_text("end")
        hand.flush_all()
        scripted.wait_for("vrpn_Base text_message")
        edges = [name.rpartition("_")[2] for name, _ in scripted.received if name.startswith("hapticd Batch_")]
        assert edges == ["Begin"]
        hand.upload_mesh(0, *hapticd.sphere(25))
    edges = [name.rpartition("_")[2] for name, _ in scripted.received if name.startswith("hapticd Batch_")]
    assert edges == ["Begin", "Begin", "Commit"]
    scripted.close()


def test_a_block_that_ctrl_c_ends_does_not_wait_for_the_server() -> None:
    scripted = ScriptedServer()
    with pytest.raises(KeyboardInterrupt):
        with hapticd.connect(scripted.name, queue_limit_bytes=1 << 30, send_timeout=100) as hand:
            hand.wait_capabilities()
            scripted.reads.clear()
            hand.set_vertices(0, 0, np.zeros((1000000, 3)))  # more than the system takes
            start = time.monotonic()
            raise KeyboardInterrupt
    assert time.monotonic() - start < 60
    scripted.reads.set()
    scripted.close()


@pytest.mark.parametrize("where", ["_write", "_received"])
def test_ctrl_c_in_the_middle_of_a_message_does_not_garble_the_next(where: str) -> None:
    scripted = ScriptedServer()
    with hapticd.connect(scripted.name) as hand:
        hand.wait_capabilities()
        move = getattr(hand, where)

        def half(bytes_or_socket: Any) -> None:
            if where == "_received":
                move(bytes_or_socket[: len(bytes_or_socket) // 2])
            else:
                bytes_or_socket.send(hand._out[0][:10])
            raise KeyboardInterrupt

        setattr(hand, where, half)
        hand._ping()
        with pytest.raises(KeyboardInterrupt):
            hand.run_for(60)
        setattr(hand, where, move)
        events: List[bool] = []
        hand.on_connection(lambda c: events.append(c.connected))
        until(hand, lambda: events == [False, True] and hand._answered, 20)
        hand.send_text("end")
        hand.flush_all()
        scripted.wait_for("vrpn_Base text_message")
    scripted.close()


@pytest.mark.parametrize("way", ["tcp", "udp"])
def test_a_client_ends_with_its_last_name(server: Server, way: str) -> None:
    """Also where the garbage collector does not run: what is left of the client would go on pushing the hand."""
    with hapticd.connect(server.tcp) as watching:

        def push() -> "weakref.ref[hapticd.Client]":
            hand = hapticd.connect(getattr(server, way))
            hand.set_effect(0, Effect.constant((1, 0, 0), 1))
            hand.start_effect(0)
            hand.flush_all()
            until(watching, lambda: hand.poll() is not None and watching.latest.force.force_N[0] > 0.5)
            return weakref.ref(hand)

        gc.collect()
        gc.disable()
        try:
            assert push()() is None
            until(watching, lambda: watching.latest.force.force_N[0] == 0)
        finally:
            gc.enable()


def test_remote_contacts_name_no_state_of_an_earlier_server() -> None:
    scripted = ScriptedServer()
    number, layout = _NUMBERS[m.HandState]
    with hapticd.connect(scripted.name) as hand:

        def hears(time_ns: int) -> None:
            scripted.answer = frame(5, 0, 0, number, layout.encode(m.HandState(9, time_ns)))
            hand._ping()
            until(hand, lambda: hand.latest.hand.tick_time_ns == time_ns)
            scripted.answer = b""

        hears(77)
        hand._fail("lost")
        hand.wait_connected(60)  # without a poll: the loss is not reported yet
        hand.set_remote_contacts([])
        hears(99)
        hand.set_remote_contacts([])
        hand.flush_all()
    contacts = [m.LAYOUTS[_NUMBERS[m.RemoteContacts][0]].decode(data) for name, data in scripted.received if name == "hapticd Remote_Contacts"]
    assert [one.state_time for one in contacts] == [0, 99]
    scripted.close()


@pytest.mark.parametrize("closes", [True, False])
def test_what_was_sent_arrives_although_the_client_ends(closes: bool) -> None:
    """The system resets a connection that is closed with unread reports, and drops what it has not sent."""
    scripted = ScriptedServer()
    hand = hapticd.connect(scripted.name, queue_limit_bytes=1 << 30)
    hand.wait_capabilities()
    number, layout = _NUMBERS[m.TouchedObject]
    scripted.chatter = frame(1, 0, 0, number, layout.encode(m.TouchedObject(1)))
    hand.upload_mesh(0, *hapticd.sphere(25, rings=300))
    scripted.reads.clear()
    hand.set_vertices(0, 0, np.zeros((500000, 3)))  # more than the system takes
    hand.send_text("end")
    threading.Timer(1.5, scripted.reads.set).start()
    if closes:
        hand.close()
    del hand
    scripted.wait_for("vrpn_Base text_message", 10)
    scripted.close()


def test_a_server_that_has_stopped_does_not_keep_a_client_that_closes() -> None:
    for vertices in (1, 1000000):  # the server's system takes all, or not
        scripted = ScriptedServer()
        with hapticd.connect(scripted.name, queue_limit_bytes=1 << 30, send_timeout=1.5) as hand:
            hand.wait_capabilities()
            scripted.reads.clear()
            hand.set_vertices(0, 0, np.zeros((vertices, 3)))
            start = time.monotonic()
        assert time.monotonic() - start < 60  # it would wait for ever
        scripted.reads.set()
        scripted.close()


@pytest.mark.parametrize("way", ["tcp", "udp"])
def test_a_forked_process_neither_uses_nor_keeps_a_connection(server: Server, way: str) -> None:
    """A worker that was forked, as multiprocessing does it, outlives the client of its parent."""
    with hapticd.connect(server.tcp) as watching, hapticd.connect(getattr(server, way)) as hand:
        hand.set_effect(0, Effect.constant((1, 0, 0), 1))
        hand.start_effect(0)
        hand.flush_all()
        until(watching, lambda: hand.poll() is not None and watching.latest.force.force_N[0] > 0.5)
        hand.stop_effect(7)  # collected, and not sent yet
        out, into = os.pipe()
        child = os.fork()
        if child == 0:
            answer = b"it may use the connection"
            try:
                hand.poll()
            except hapticd.ConnectionLost as error:
                answer = str(error).encode()
            hand.close()
            os.write(into, answer)
            time.sleep(60)
            os._exit(0)
        try:
            assert "belongs to the process that made it" in os.read(out, 1000).decode()
            tick = hand.latest.pose[1].time
            until(hand, lambda: hand.connected and hand.latest.pose[1].time > tick, seconds=10)
            hand.close()
            until(watching, lambda: watching.latest.force.force_N[0] == 0, seconds=10)
        finally:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            os.close(out)
            os.close(into)


def test_waiting_takes_no_processor_time(server: Server) -> None:
    with hapticd.connect(server.tcp) as hand:
        hand.subscribe(Reports.NONE)
        hand.run_for(0.2)
        start = time.process_time()
        hand.run_for(1.0)
        assert time.process_time() - start < 0.5
    with pytest.raises(hapticd.ConnectionLost, match="is closed"):
        hand.poll()


def test_streamed_state_is_reported_back() -> None:
    scripted = ScriptedServer()
    with hapticd.connect(scripted.name) as hand:
        with hand.batch():  # streamed state does not wait for the end of a batch
            hand.set_remote_contacts([hapticd.RemoteContact(3, (0, 0, 0), (0, 1, 0))])
            hand.set_force((0, 0, 1))
            scripted.wait_for("hapticd Held_Force")
            assert "hapticd Batch_Begin" not in [name for name, _ in scripted.received]
        with pytest.raises(ValueError, match="17 remote contacts: give the 16 nearest"):
            hand.set_remote_contacts([hapticd.RemoteContact(i, (0, 0, 0), (0, 1, 0)) for i in range(17)])
        with pytest.raises(ValueError, match=r"point_m is \(0, 0\), expected three finite numbers"):
            hand.set_remote_contacts([hapticd.RemoteContact(0, (0, 0), (0, 1, 0))])
        with pytest.raises(ValueError, match=r"point_m is \(0, 0\), expected three finite numbers"):
            hand.set_remote_contacts([hapticd.RemoteContact(0, (0, 0), (0, 0, 1, 0))])
        with pytest.raises(ValueError, match="3 numbers"):
            hand.set_workspace_box((0, 0), (1, 1, 1, 1))
        number, layout = _NUMBERS[m.HandState]
        numbers = (3.0, 1, 2, 3, 4, 5, 6, 0.5)
        state = m.HandState(9, 8, 7, 6, force=(1, 2, 3), energy=0.02, flags=3, gripper=0.25, contacts=numbers)
        scripted.answer = frame(5, 0, 0, number, layout.encode(state))
        hand._ping()
        until(hand, lambda: hand.latest.hand.tick == 9)
        report = hand.latest.hand
        assert (report.tick_time_ns, report.contacts_sent_ns, report.force_sent_ns) == (8, 7, 6)
        assert report.energy_J == 0.02 and report.gripper_rad == 0.25 and report.energy_spent
        assert not report.corrections_held and list(report.force_N) == [1, 2, 3]
        assert report.contacts[0].id == 3 and list(report.contacts[0].force_N) == [4, 5, 6]
        assert hapticd.reports.rows_of("hand", [report])["energy_J"][0] == 0.02
        for tick, contact in enumerate((float("nan"), float("inf"), float("-inf"), 4.0), 10):  # the last is right
            state = m.HandState(tick, contacts=(contact, *numbers[1:]))
            scripted.answer = frame(5, 0, 0, number, layout.encode(state))
            pongs = hand._pongs
            hand._ping()
            until(hand, lambda: hand._pongs > pongs and (tick < 13 or hand.latest.hand.tick == 13))
        assert hand.statistics().messages_damaged == 3 and hand.latest.hand.contacts[0].id == 4
    scripted.close()


def test_quantiles_of_latencies_are_rounded_up_by_an_eighth_at_most() -> None:
    seconds = np.random.default_rng(5).exponential(3e-4, 3000)
    seconds[:10] = 0.0
    histogram = LatencyHistogram()
    assert histogram.count == histogram.quantile_us(0.5) == 0
    for one in seconds:
        histogram.add(one)
    histogram.add(-1.0)  # clocks that disagree
    exact = np.sort(np.append(np.floor(1e6 * seconds), 0.0))
    assert histogram.count == len(exact)
    for q in (0.0, 0.001, 0.1, 0.5, 0.9, 0.999, 1.0):
        true = exact[max(1, math.ceil(q * len(exact))) - 1]
        assert true < histogram.quantile_us(q) <= max(true + 1, 1.125 * true + 1), q
    before, after = Statistics(taken=1.0), Statistics(taken=3.0)
    assert after.rate_per_second("force", before) == 0
    after.reports["force"].count = 50
    assert after.rate_per_second("force", before) == 25 and before.rate_per_second("force", before) == 0


def test_contacts_are_a_row_each() -> None:
    floor, wall = Contact(3, (1, 2, 3), (0, 1, 0), (0, 5, 0)), Contact(7, (4, 5, 6), (1, 0, 0), (6, 0, 0))
    ticks = [ContactsReport(0.5, 9, 10, [floor, wall]), ContactsReport(0.6, 11, 12, []), ContactsReport(0.7, 13, 14, [wall])]
    rows = hapticd.reports.rows_of("contacts", ticks)
    assert rows["tick"].tolist() == [9, 9, 13] and rows["object"].tolist() == [3, 7, 7]
    assert rows["tick_time_ns"].tolist() == [10, 10, 14] and rows["force_N"].tolist() == [[0, 5, 0], [6, 0, 0], [6, 0, 0]]
    assert len(hapticd.reports.rows_of("contacts", ticks[1:2])) == 0
