"""The asyncio client against a real server with the simulated hand."""

import asyncio
import gc
import inspect
import os
import signal
import socket
import threading
import time
import weakref
from typing import Any, Callable, Coroutine, List

import numpy as np
import pytest

import hapticd
from conftest import COMMANDS, ROOT, WAITS, ScriptedServer, Server
from hapticd import Effect, Reports, Surface
from hapticd import _messages as m
from hapticd._codec import frame
from hapticd._core import _NUMBERS


def run(main: Coroutine[Any, Any, None]) -> None:
    asyncio.run(asyncio.wait_for(main, 120), debug=False)


def run_without_collector(main: Coroutine[Any, Any, None]) -> None:
    """What is gone with its last name needs no garbage collector."""
    gc.collect()
    gc.disable()
    try:
        run(main)
    finally:
        gc.enable()


def no_client_is_left() -> None:
    tasks = asyncio.all_tasks() - {asyncio.current_task()}
    assert [task for task in tasks if "stay_connected" in repr(task)] == []


async def until(hand: hapticd.aio.Client, condition: Callable[[], Any]) -> None:
    assert await wait(hand, condition, 60), f"never became true; latest tick {hand.latest.tick}"


async def wait(hand: hapticd.aio.Client, condition: Callable[[], Any], seconds: float = 5) -> bool:
    deadline = time.monotonic() + seconds
    while not condition() and time.monotonic() < deadline:
        await hand.poll(0.05)
    return bool(condition())


@pytest.mark.parametrize("way", ["tcp", "udp"])
def test_a_sphere_is_felt(server: Server, way: str) -> None:
    async def main() -> None:
        async with hapticd.aio.connect(getattr(server, way)) as hand:
            await hand.subscribe(Reports.ALL)
            for _ in range(20):  # as conftest.feel_a_sphere()
                await hand.hold_hand((0, 0, 33))
                await wait(hand, lambda: 1 in hand.latest.pose and hand.latest.pose[1].position_m[2] > 0.03)
                async with hand.batch():
                    await hand.upload_mesh(0, *hapticd.sphere(25))
                    hand.set_surface(0, Surface(0.8))
                await hand.hold_hand((0, 0, 22))
                if await wait(hand, lambda: hand.latest.force.force_N[2] > 0.2):
                    break
            rows = await hand.collect("tick", 0.5)
            assert len(rows) > 2 and rows["force_N"].shape == (len(rows), 3)
            async for report in hand.reports("tick", 60):
                assert report.tick > rows["tick"][-1]
                break
            await hand.stop_forces()
            await until(hand, lambda: hand.latest.guard.stopped)
            await hand.rearm_forces()
            await until(hand, lambda: not hand.latest.guard.stopped)
            await hand.release_hand()
            assert (hand.statistics().udp_bytes_in > 0) == (way == "udp")

    run(main())


@pytest.mark.parametrize("way", ["tcp", "udp"])
def test_a_client_ends_with_its_last_name(server: Server, way: str, caplog: pytest.LogCaptureFixture) -> None:
    """Although the event loop goes on: what is left of the client would go on pushing the hand."""

    async def main() -> None:
        async with hapticd.aio.connect(server.tcp) as watching:

            async def push() -> "weakref.ref[hapticd.aio.Client]":
                hand = await hapticd.aio.connect(getattr(server, way))
                hand.set_effect(0, Effect.constant((1, 0, 0), 1))
                hand.start_effect(0)
                await until(watching, lambda: watching.latest.force.force_N[0] > 0.5)
                return weakref.ref(hand)

            gone = await push()
            await watching.poll(0.1)
            assert gone() is None
            await until(watching, lambda: watching.latest.force.force_N[0] == 0)
        no_client_is_left()

    run_without_collector(main())
    assert caplog.records == []


@pytest.mark.parametrize("closes", [True, False])
def test_what_was_sent_arrives_although_the_client_ends(closes: bool) -> None:
    """The system resets a connection that is closed with unread reports, and drops what it has not sent."""
    scripted = ScriptedServer()

    async def main() -> None:
        hand = await hapticd.aio.connect(scripted.name)
        await hand.wait_capabilities()
        number, layout = _NUMBERS[m.TouchedObject]
        scripted.chatter = frame(1, 0, 0, number, layout.encode(m.TouchedObject(1)))
        await hand.upload_mesh(0, *hapticd.sphere(25, rings=300))
        scripted.reads.clear()
        hand.set_vertices(0, 0, np.zeros((500000, 3)))  # more than the system takes
        hand.send_text("end")
        hand.flush()
        threading.Timer(1.5, scripted.reads.set).start()
        if closes:
            await hand.close()
        del hand
        await asyncio.get_running_loop().run_in_executor(None, scripted.wait_for, "vrpn_Base text_message", 10)

    run(main())
    scripted.close()


def test_a_server_that_has_stopped_does_not_keep_a_client_that_closes() -> None:
    async def main() -> None:
        for vertices in (1, 1000000):  # the server's system takes all, or not
            scripted = ScriptedServer()
            async with hapticd.aio.connect(scripted.name, send_timeout=1.5) as hand:
                await hand.wait_capabilities()
                scripted.reads.clear()
                hand.set_vertices(0, 0, np.zeros((vertices, 3)))
                start = time.monotonic()
            assert time.monotonic() - start < 60  # it would wait for ever
            scripted.reads.set()
            scripted.close()

    run(main())


def test_a_block_that_is_cancelled_does_not_wait_for_the_server() -> None:
    scripted = ScriptedServer()

    async def upload(steps: "List[hapticd.UploadProgress]") -> None:
        async with hapticd.aio.connect(scripted.name, send_timeout=100) as hand:
            await hand.wait_capabilities()
            scripted.reads.clear()  # the system takes only a part of the mesh
            await hand.upload_mesh(0, *hapticd.sphere(25, rings=600), steps.append)

    async def main() -> None:
        steps: List[hapticd.UploadProgress] = []
        task = asyncio.ensure_future(upload(steps))
        while not steps:
            await asyncio.sleep(0.01)
        start = time.monotonic()
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert time.monotonic() - start < 60
        scripted.reads.set()
        async with hapticd.aio.connect(scripted.name, connect_timeout=60):  # after the end of the first connection
            pass

    run(main())
    edges = [name.rpartition("_")[2] for name, _ in scripted.received if name.startswith("hapticd Batch_")]
    assert edges == ["Begin"]
    scripted.close()


@pytest.mark.parametrize("way", ["tcp", "udp"])
def test_a_forked_process_does_not_keep_a_connection(server: Server, way: str) -> None:
    """As the workers of a ProcessPoolExecutor."""

    async def main() -> None:
        async with hapticd.aio.connect(server.tcp) as watching, hapticd.aio.connect(getattr(server, way)) as hand:
            hand.set_effect(0, Effect.constant((1, 0, 0), 1))
            hand.start_effect(0)
            await until(watching, lambda: watching.latest.force.force_N[0] > 0.5)
            out, into = os.pipe()
            child = os.fork()
            if child == 0:
                answer = b"it may use the connection"
                try:
                    hand.stop_effect(0)
                except hapticd.ConnectionLost as error:
                    answer = str(error).encode()
                os.write(into, answer)
                time.sleep(60)
                os._exit(0)
            try:
                assert "belongs to the process that made it" in os.read(out, 1000).decode()
                time_of_pose = hand.latest.pose[1].time
                await until(hand, lambda: hand.connected and hand.latest.pose[1].time > time_of_pose)
                await hand.close()
                assert await wait(watching, lambda: watching.latest.force.force_N[0] == 0, 10)
            finally:
                os.kill(child, signal.SIGKILL)
                os.waitpid(child, 0)
                os.close(out)
                os.close(into)

    run(main())


def test_uploads_and_batches_of_several_tasks_follow_each_other() -> None:
    """Their batches must not be one inside the other: batches do not nest."""
    vertices, triangles = hapticd.sphere(25, rings=600)
    scripted = ScriptedServer()

    async def main() -> None:
        async with hapticd.aio.connect(scripted.name) as hand:
            await hand.wait_capabilities()

            async def rename() -> None:
                await asyncio.sleep(0)  # after the uploads have begun
                async with hand.batch():
                    hand.set_object_name(0, "part")

            await asyncio.gather(*(hand.upload_mesh(i, vertices, triangles) for i in range(3)), rename())
            hand.send_text("end")
            await hand.flush_all()
            await asyncio.get_running_loop().run_in_executor(None, scripted.wait_for, "vrpn_Base text_message")

    run(main())
    edges = [name.rpartition("_")[2] for name, _ in scripted.received if name.startswith("hapticd Batch_")]
    assert edges == ["Begin", "Commit"] * 4
    scripted.close()


def test_batches_of_several_tasks_follow_each_other() -> None:
    scripted = ScriptedServer()

    async def main() -> None:
        async with hapticd.aio.connect(scripted.name) as hand:

            async def name(object: int) -> None:
                async with hand.batch():
                    hand.set_object_name(object, "first")
                    await asyncio.sleep(0.05)
                    hand.set_object_name(object, "second")

            await asyncio.gather(*(name(i) for i in range(3)))
            async with hand.batch():
                for nested in (name(4), asyncio.ensure_future(name(4))):
                    with pytest.raises(RuntimeError, match="batches do not nest"):
                        await nested
                uploads = (hand.upload_mesh(i, np.eye(3), [[0, 1, 2]]) for i in range(2))
                await asyncio.wait_for(asyncio.gather(*uploads), 60)
            with pytest.raises(KeyError):
                async with hand.batch():
                    raise KeyError
            await name(5)
            hand.send_text("end")
            await hand.flush_all()
            await asyncio.get_running_loop().run_in_executor(None, scripted.wait_for, "vrpn_Base text_message")

    run(main())
    named = [(name.rpartition(" ")[2], payload[:4]) for name, payload in scripted.received if "Batch" in name or "Name" in name]
    begin, commit = ("Batch_Begin", b""), ("Batch_Commit", b"")
    own = [[begin, *[("Set_Object_Name", i.to_bytes(4, "big"))] * 2, commit] for i in (0, 1, 2, 5)]
    assert named == [*own[0], *own[1], *own[2], begin, commit, *own[3]]
    scripted.close()


def test_an_upload_that_is_cut_short_leaves_no_open_batch() -> None:
    """A server keeps every command that follows, until the batch ends."""
    vertices, triangles = hapticd.sphere(25, rings=600)
    scripted = ScriptedServer()

    async def main() -> None:
        async with hapticd.aio.connect(scripted.name) as hand:
            await hand.wait_capabilities()
            scripted.reads.clear()  # the system takes only a part of the mesh
            steps: List[hapticd.UploadProgress] = []
            upload = asyncio.ensure_future(hand.upload_mesh(0, vertices, triangles, steps.append))
            await until(hand, lambda: steps)
            upload.cancel()
            with pytest.raises(asyncio.CancelledError):
                await upload
            assert steps[-1].bytes_sent < steps[-1].bytes_total
            scripted.reads.set()
            with pytest.raises(ZeroDivisionError):
                await hand.upload_mesh(0, vertices, triangles, lambda _: 1 / 0)
            hand.send_text("end")
            await hand.flush_all()
            await asyncio.get_running_loop().run_in_executor(None, scripted.wait_for, "vrpn_Base text_message")

    run(main())
    edges = [name.rpartition("_")[2] for name, _ in scripted.received if name.startswith("hapticd Batch_")]
    assert edges == ["Begin", "Commit"] * 2
    scripted.close()


def test_reports_of_a_connection_that_nobody_renews_end() -> None:
    server = Server()

    async def main() -> None:
        async with hapticd.aio.connect(server.tcp, reconnect=False) as hand:
            with pytest.raises(hapticd.ConnectionLost, match=f"connection to 127.0.0.1:{server.port} lost"):
                async for _ in hand.reports("pose", 20):
                    if server.process.poll() is None:
                        server.stop()

    run(main())


def test_many_clients_share_one_loop(server: Server) -> None:
    async def main() -> None:
        hands = await asyncio.gather(*(hapticd.aio.connect(server.tcp) for _ in range(4)))
        await asyncio.gather(*(until(hand, lambda hand=hand: hand.latest.pose) for hand in hands))  # type: ignore[misc]
        await asyncio.gather(*(hand.close() for hand in hands))

    run(main())


def test_an_exception_of_a_callback_goes_to_the_loop(server: Server) -> None:
    async def main() -> None:
        errors: List[Any] = []
        asyncio.get_running_loop().set_exception_handler(lambda _, context: errors.append(context["exception"]))
        async with hapticd.aio.connect(server.tcp) as hand:
            hand.on_pose(lambda _: 1 / 0)
            await until(hand, lambda: len(errors) > 2)
            assert isinstance(errors[0], ZeroDivisionError) and hand.latest.pose

    run(main())


def test_a_callback_that_raises_does_not_keep_reports_from_what_waits(server: Server, caplog: pytest.LogCaptureFixture) -> None:
    async def run() -> int:
        async with hapticd.aio.connect(server.tcp) as hand:
            hand.on_text(lambda report: 1 / 0)
            hand.set_transform(0, np.zeros((4, 4)))  # refused by a text
            async for report in hand.reports("text", seconds=60):
                return int(report.severity)
            return -1

    assert asyncio.run(run()) == hapticd.Severity.ERROR
    assert "ZeroDivisionError" in caplog.text


def test_a_call_of_another_loop_or_thread_is_refused(server: Server) -> None:
    async def call_by_a_thread() -> hapticd.aio.Client:
        hand = await hapticd.aio.connect(server.tcp)
        sent = hand.statistics().messages_out
        for call in (lambda: hand.clear_mesh(0), hand.flush, lambda: hand.set_force_field(hapticd.ForceField())):
            with pytest.raises(RuntimeError, match="belongs to another event loop, or to the thread of one"):
                await asyncio.get_running_loop().run_in_executor(None, call)
        assert hand.statistics().messages_out == sent
        hand.clear_mesh(0)
        await hand.flush_all()
        return hand

    async def use(hand: hapticd.aio.Client) -> None:
        for wait in (lambda: hand.poll(60), hand.stop_forces, lambda: hand.mark("x"), lambda: hand.collect("force", 60)):
            with pytest.raises(RuntimeError, match="belongs to another event loop"):
                await wait()  # type: ignore[no-untyped-call]

    hand = asyncio.run(call_by_a_thread())
    asyncio.run(use(hand))
    ends = [line for line in server.log if "disconnected" in line]
    asyncio.run(hand.close())  # its own loop has ended
    assert hand._finished
    deadline = time.monotonic() + 60
    while [line for line in server.log if "disconnected" in line] == ends:
        assert time.monotonic() < deadline
        time.sleep(0.005)


def test_a_connection_that_is_not_awaited_says_so() -> None:
    with pytest.raises(AttributeError, match=r"^set_surface: connect\(\) gives the client to 'await connect"):
        hapticd.aio.connect("Phantom@localhost").set_surface(0, Surface())  # type: ignore[attr-defined]
    assert not hasattr(hapticd.aio.connect("Phantom@localhost"), "__enter__")


def test_another_thread_may_close_a_client(server: Server) -> None:
    async def run() -> None:
        hand = await hapticd.aio.connect(server.tcp)
        await asyncio.get_running_loop().run_in_executor(None, lambda: asyncio.run(hand.close()))
        with pytest.raises(hapticd.ConnectionLost, match="is closed"):
            await hand.poll(60)
        assert hand._task is not None
        await asyncio.wait_for(hand._task, 60)
        assert not hand.connected

    asyncio.run(run())


def test_a_stop_passes_a_large_upload(server: Server) -> None:
    async def main() -> None:
        vertices, triangles = hapticd.sphere(25, rings=300)
        async with hapticd.aio.connect(server.tcp) as hand:
            upload = asyncio.ensure_future(hand.upload_mesh(0, vertices, triangles))
            await asyncio.sleep(0)
            await hand.stop_forces()
            await until(hand, lambda: hand.latest.guard.stopped)
            await upload
            await hand.rearm_forces()
            await until(hand, lambda: not hand.latest.guard.stopped)

    run(main())


@pytest.mark.parametrize("uploads", [False, True])
def test_a_stop_acts_although_nobody_awaits_it(server: Server, uploads: bool) -> None:
    async def main() -> None:
        async with hapticd.aio.connect(server.tcp) as hand, hapticd.aio.connect(server.tcp) as other:
            await hand.wait_capabilities()
            upload = asyncio.ensure_future(hand.upload_mesh(0, *hapticd.sphere(25, rings=300))) if uploads else None
            await asyncio.sleep(0)
            stop = hand.stop_forces()
            await until(other, lambda: other.latest.guard.stopped)
            if upload is not None:
                await upload
                await stop  # else that of the second connection may follow the re-arm
            await hand.rearm_forces()
            await until(other, lambda: not other.latest.guard.stopped)
            if upload is None:
                before = hand.statistics().messages_out
                await stop
                assert hand.statistics().messages_out == before, "it does not stop again"

    run(main())


def test_one_stop_that_fails_does_not_keep_another_from_acting(server: Server) -> None:
    async def main() -> None:
        async with hapticd.aio.connect(server.tcp) as gone, hapticd.aio.connect(server.tcp) as hand:
            await gone.close()
            results = await asyncio.gather(gone.stop_forces(), hand.stop_forces(), return_exceptions=True)
            assert isinstance(results[0], hapticd.ConnectionLost) and results[1] is None
            await until(hand, lambda: hand.latest.guard.stopped)
            task = asyncio.create_task(hand.stop_forces())
            await asyncio.wait_for(task, 60)
            await hand.rearm_forces()
            await until(hand, lambda: not hand.latest.guard.stopped)

    run(main())


def test_who_stopped_re_arms_on_its_next_connection(server: Server) -> None:
    async def main() -> None:
        async with hapticd.aio.connect(server.tcp) as hand, hapticd.aio.connect(server.tcp) as other:
            await hand.stop_forces()
            await until(other, lambda: other.latest.guard.stopped)
            hand._abort("lost")
            await until(hand, lambda: hand.connected)
            await hand.rearm_forces()
            await until(other, lambda: not other.latest.guard.stopped)

    run(main())


def test_a_lost_connection_comes_back(server: Server) -> None:
    async def main() -> None:
        async with hapticd.aio.connect(server.tcp) as hand:
            events: List[bool] = []
            hand.on_connection(lambda c: events.append(c.connected))
            await hand.enable_heartbeat()
            assert hand._transport is not None
            hand._transport.abort()
            await until(hand, lambda: events[-2:] == [False, True])
            await until(hand, lambda: hand.latest.pose)

    run(main())


@pytest.mark.parametrize("way", ["tcp", "udp"])
def test_a_closed_client_is_not_connected_and_every_command_raises(server: Server, way: str) -> None:
    async def consume(reports: Any) -> None:
        async for _ in reports:
            pass

    async def main() -> None:
        async with hapticd.aio.connect(getattr(server, way)) as hand:
            await until(hand, lambda: hand.latest.pose)
            consumers = [asyncio.ensure_future(consume(stream("tick"))) for stream in (hand.reports, hand.rows)]
            await asyncio.sleep(0)
            closing = asyncio.ensure_future(hand.close())
            await asyncio.sleep(0)
            assert not hand.connected
            await closing
        assert not hand.connected and hand.capabilities is None
        for result in await asyncio.wait_for(asyncio.gather(*consumers, return_exceptions=True), 60):
            assert isinstance(result, hapticd.ConnectionLost) and "is closed" in str(result)
        for name, arguments in {**COMMANDS, **WAITS}.items():
            with pytest.raises(hapticd.ConnectionLost, match="this client of Phantom@127.0.0.1:[0-9]+ is closed"):
                result = getattr(hand, name)(*arguments)
                if inspect.isawaitable(result):
                    await result
                pytest.fail(f"{name}() returned")
        with pytest.raises(hapticd.ConnectionLost, match="is closed"):
            async with hand.batch():
                pass
        hand.flush()
        await hand.close()
        assert hand.statistics().messages_dropped == 0

    run(main())


def test_a_close_that_is_cancelled_is_cancelled() -> None:
    scripted = ScriptedServer()

    async def main() -> None:
        hand = await hapticd.aio.connect(scripted.name)
        await hand.wait_capabilities()
        scripted.reads.clear()
        hand.set_vertices(0, 0, np.zeros((1000000, 3)))  # more than the system takes
        closing = asyncio.ensure_future(hand.close())
        await asyncio.sleep(0)
        closing.cancel()
        with pytest.raises(asyncio.CancelledError):
            await closing
        scripted.reads.set()
        async with hapticd.aio.connect(scripted.name, connect_timeout=60):  # after the end of the first connection
            no_client = [task for task in asyncio.all_tasks() if "stay_connected" in repr(task)]
            assert len(no_client) == 1

    run(main())
    scripted.close()


def test_close_ends_a_wait_for_the_first_connection() -> None:
    async def main() -> None:
        hand = await hapticd.aio.connect("Phantom@127.0.0.1:1", connect_timeout=0)
        waiting = asyncio.ensure_future(hand.wait_connected(3600))
        await asyncio.sleep(0.05)
        await hand.close()
        with pytest.raises(hapticd.ConnectionLost, match="is closed"):
            await asyncio.wait_for(waiting, 60)

    run(main())


@pytest.mark.parametrize("way", ["tcp", "udp"])
def test_a_stop_that_nothing_receives_raises(way: str) -> None:
    async def main() -> None:
        calls = {"stop_forces": "forces not stopped", "mark": "not marked", "rearm_forces": "forces not re-armed"}
        for name, what in calls.items():
            server = Server()
            async with hapticd.aio.connect(getattr(server, way), connect_timeout=60) as hand:
                await hand.wait_capabilities()
                server.process.kill()
                server.process.wait(30)
                time.sleep(0.1)  # until the end of the connection has arrived; the event loop does not run meanwhile
                with pytest.raises(hapticd.ConnectionLost, match=f"{what}: .*{server.port}"):
                    await getattr(hand, name)(*COMMANDS[name])
                assert not hand.connected
                for again in ("stop_forces", "mark"):
                    with pytest.raises(hapticd.ConnectionLost, match=f"{calls[again]}: .*{server.port}"):
                        await getattr(hand, again)(*COMMANDS[again])
            server.reader.join(30)

    run(main())


def test_errors() -> None:
    async def main() -> None:
        with pytest.raises(hapticd.ConnectError, match="nothing listens on 127.0.0.1:1 "):
            await hapticd.aio.connect("Phantom@tcp://127.0.0.1:1", connect_timeout=2)
        with pytest.raises(hapticd.ConnectError, match="nothing listens on 127.0.0.1:1 "):
            await hapticd.aio.connect("Phantom@127.0.0.1:1", connect_timeout=2)
        scripted = ScriptedServer(extensions=False)
        async with hapticd.aio.connect(scripted.name) as hand:
            with pytest.raises(hapticd.Unsupported, match="without the extensions"):
                await hand.stop_forces()
            with pytest.raises(hapticd.Unsupported, match="without the extensions"):
                await hand.mark("trial 3 begins")
            await hand.upload_mesh(0, np.eye(3), [[0, 1, 2]])
        scripted.close()
        wrong = ScriptedServer(device="Tracker0")
        async with hapticd.aio.connect(wrong.name.replace("Tracker0", "Phantom"), connect_timeout=0) as nobody:
            await until(nobody, lambda: nobody._server_devices)
            with pytest.raises(hapticd.ConnectError, match="no device 'Phantom' answers at .*; it has Tracker0"):
                await nobody.wait_connected(0.3)
        wrong.close()

    run(main())


def test_a_server_that_speaks_at_once_loses_nothing() -> None:
    """By UDP request: the first bytes of a stock server arrive before the client's datagram socket exists."""
    recorded = (ROOT / "testdata/wire/udp.s2c.tcp.bin").read_bytes()
    request = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    request.bind(("127.0.0.1", 0))
    request.settimeout(60)
    port = request.getsockname()[1]

    def serve() -> None:
        host, _, listening = request.recv(1000).rstrip(b"\0").decode().partition(" ")
        with socket.create_connection((host, int(listening))) as connection:
            connection.sendall(recorded)
            while connection.recv(1 << 16):
                pass

    async def main() -> None:
        async with hapticd.aio.connect(f"Phantom@127.0.0.1:{port}") as hand:
            await until(hand, lambda: hand.statistics().tcp_bytes_in == len(recorded))
            assert hand.connected

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    run(main())
    thread.join(60)
    request.close()


def test_a_surplus_connection_of_a_server_does_not_end_the_first() -> None:
    """A server answers two requests with two connections, when the event loop was busy meanwhile."""
    recorded = (ROOT / "testdata/wire/udp.s2c.tcp.bin").read_bytes()
    request = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    request.bind(("127.0.0.1", 0))
    request.settimeout(60)

    async def main() -> None:
        hand = await hapticd.aio.connect(f"Phantom@127.0.0.1:{request.getsockname()[1]}", connect_timeout=0)
        await asyncio.sleep(0.1)
        host, _, listening = request.recv(1000).rstrip(b"\0").decode().partition(" ")
        connections = [socket.create_connection((host, int(listening))) for _ in range(2)]
        for connection in connections:
            connection.sendall(recorded)
        await until(hand, lambda: hand.connected)
        await asyncio.sleep(0.5)
        assert hand.connected and hand.statistics().connections == 1
        ended = []
        for connection in connections:
            connection.settimeout(0.1)
            try:
                while connection.recv(1 << 16):
                    pass
                ended.append(True)
            except socket.timeout:
                ended.append(False)
            except ConnectionResetError:
                ended.append(True)
        assert sorted(ended) == [False, True]
        for connection in connections:
            connection.close()
        await hand.close()

    run(main())
    request.close()


def test_a_client_ends_with_its_last_name_before_its_first_connection() -> None:
    request = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    request.bind(("127.0.0.1", 0))
    request.setblocking(False)

    async def main() -> None:
        hand = await hapticd.aio.connect(f"Phantom@127.0.0.1:{request.getsockname()[1]}", connect_timeout=0)
        await asyncio.sleep(0.2)
        assert request.recv(1000)
        gone = weakref.ref(hand)
        del hand
        assert gone() is None
        await asyncio.sleep(1.2)  # a request follows another after 1 s
        with pytest.raises(BlockingIOError):
            request.recv(1000)
        no_client_is_left()

    run_without_collector(main())
    request.close()
