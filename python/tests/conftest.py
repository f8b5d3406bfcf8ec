"""A server of hapticd with the simulated hand, and a scripted VRPN server."""

import os
import pathlib
import re
import socket
import subprocess
import tempfile
import threading
import time
from typing import Any, Callable, Dict, Iterable, Iterator, List, Tuple

import numpy as np
import pytest

import hapticd
from hapticd import _messages as m
from hapticd._codec import frame
from hapticd._core import _NUMBERS
from hapticd._peer import Peer, TYPE_NAMES, now

ROOT = pathlib.Path(__file__).resolve().parents[2]
HAPTICD = os.environ.get("HAPTICD", str(ROOT / "build/release/bin/hapticd"))
RUNTIME = tempfile.TemporaryDirectory()  # for the sockets of servers, which one that is killed leaves


#: Every call of a client that commands, with arguments that are right.
COMMANDS: Dict[str, Tuple[Any, ...]] = {
    "add_object": (1,),
    "add_object_outside_scene": (1,),
    "clear_mesh": (0,),
    "constrain_to_line": ((0, 0, 0), (0, 0, 1), 100),
    "constrain_to_plane": ((0, 0, 0), (0, 0, 1), 100),
    "constrain_to_point": ((0, 0, 0), 100),
    "enable_heartbeat": (),
    "hold_hand": ((0, 0, 0),),
    "mark": ("trial 3 begins",),
    "move_to_parent": (1, 0),
    "present_token": ("0123456789abcdef",),
    "rearm_forces": (),
    "release_constraint": (),
    "release_hand": (),
    "remove_object": (1,),
    "remove_triangle": (0, 0),
    "request_to_room": (),
    "request_unit_to_sensor": (),
    "request_workspace": (),
    "reset_origin": (),
    "reset_scene": (),
    "send_text": ("text",),
    "set_button_mode": (0, hapticd.ButtonMode.MOMENTARY),
    "set_effect": (0, hapticd.Effect.constant((1, 0, 0), 1)),
    "set_force": ((0, 0, 1),),
    "set_force_field": (hapticd.ForceField((0, 0, 0), (0, 0, 1), np.zeros((3, 3)), 1),),
    "set_haptic_origin": ((0, 0, 0), (0, 0, 1), 0),
    "set_haptic_scale": (1,),
    "set_mesh_type": (0, 0),
    "set_normal": (0, 0, 0, 0, 1),
    "set_object_count": (2,),
    "set_object_name": (0, "part"),
    "set_object_orientation": (0, (0, 0, 1), 0),
    "set_object_position": (0, (0, 0, 0)),
    "set_object_scale": (0, (1, 1, 1)),
    "set_plane": (hapticd.Plane((0, 1, 0, 0), 0.4),),
    "set_plane_texture": (hapticd.PlaneTexture(),),
    "set_remote_contacts": ([],),
    "set_scene_origin": ((0, 0, 0), (0, 0, 1), 0),
    "set_surface": (0, hapticd.Surface(0.8)),
    "set_surface_property": (0, "stiffness", 0.8),
    "set_touchable": (0, True),
    "set_touchable_faces": (hapticd.Faces.BOTH,),
    "set_transform": (0, hapticd.IDENTITY),
    "set_triangle": (0, 0, (0, 1, 2)),
    "set_update_rate": (100,),
    "set_vertex": (0, 0, 1, 2, 3),
    "set_vertices": (0, 0, [[1, 2, 3]]),
    "set_workspace_box": ((0, 0, 0), (1, 1, 1)),
    "set_workspace_projection": (hapticd.IDENTITY, hapticd.IDENTITY),
    "start_custom_effect": (0,),
    "start_effect": (0,),
    "stop_custom_effect": (),
    "stop_effect": (0,),
    "stop_force_field": (),
    "stop_forces": (),
    "stop_plane": (),
    "subscribe": (hapticd.Reports.ALL,),
    "transform_mesh": (0, hapticd.IDENTITY),
    "update_mesh": (0, hapticd.Surface(0.8)),
    "upload_corners": (0, np.eye(3)),
    "upload_mesh": (0, np.eye(3), [[0, 1, 2]]),
}
#: Calls that wait for the server, in the same way.
WAITS: Dict[str, Tuple[Any, ...]] = {
    "collect": ("force", 60),
    "flush_all": (),
    "poll": (60,),
    "wait_capabilities": (),
    "wait_connected": (60,),
}


class Server:
    """One process of `hapticd serve`."""

    def __init__(self, *options: str) -> None:
        self.options = options
        self.start("127.0.0.1:0")

    def start(self, listen: str) -> None:
        self.process = subprocess.Popen(
            [HAPTICD, "serve", "--listen", listen, "--http", "off", "--allow-no-rt", *self.options],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env={**os.environ, "XDG_RUNTIME_DIR": RUNTIME.name},
        )
        self.log: List[str] = []
        found = threading.Event()

        def read(process: "subprocess.Popen[str]") -> None:
            assert process.stdout is not None
            for line in process.stdout:
                self.log.append(line)
                match = re.search(r"listening on ([0-9.]+):([0-9]+)", line)
                if match:
                    self.port = int(match.group(2))
                    found.set()

        self.reader = threading.Thread(target=read, args=(self.process,), daemon=True)
        self.reader.start()
        assert found.wait(60), "".join(self.log)

    @property
    def tcp(self) -> str:
        return f"Phantom@tcp://127.0.0.1:{self.port}"

    @property
    def udp(self) -> str:
        return f"Phantom@127.0.0.1:{self.port}"

    def stop(self) -> None:
        self.process.terminate()
        self.process.wait(30)
        self.reader.join(30)


@pytest.fixture(scope="session")
def shared_server() -> Iterator[Server]:
    server = Server()
    yield server
    server.stop()


@pytest.fixture
def server(shared_server: Server) -> Server:
    """The shared server, with the scene as at its start."""
    with hapticd.connect(shared_server.tcp) as hand:
        hand.reset_scene()
        hand.rearm_forces()
        hand.flush_all()
    return shared_server


def feel_a_sphere(hand: Any, depth_mm: float = 3) -> None:
    """Uploads a sphere of 25 mm and presses the hand onto it, from outside: an object that appears around the hand is
    not felt. On a busy machine a late tick can put the hand so deep that the contact is not felt either: again then."""
    for _ in range(20):
        hand.hold_hand((0, 0, 33))
        _wait(hand, lambda: 1 in hand.latest.pose and hand.latest.pose[1].position_m[2] > 0.03)
        with hand.batch():
            hand.upload_mesh(0, *hapticd.sphere(25))
            hand.set_surface(0, hapticd.Surface(0.8))
        hand.hold_hand((0, 0, 25 - depth_mm))
        if _wait(hand, lambda: hand.latest.force.force_N[2] > 0.2):
            return
    raise AssertionError(f"felt nothing; poses {hand.latest.pose}, guard {hand.latest.guard}")


def press(hand: Any, way: Iterable[Tuple[float, float, float]], felt: Callable[[], bool], **pose: Any) -> None:
    """Moves the hand along `way`, in steps that it feels, until `felt`. Again, where a late tick had it jump into what it
    should have touched."""
    places = list(way)
    for _ in range(10):
        for place in places:
            hand.hold_hand(place, **pose)
            hand.run_for(0.05)
        if _wait(hand, felt):
            return
        for place in reversed(places):
            hand.hold_hand(place, **pose)
            hand.run_for(0.05)
    raise AssertionError(f"felt nothing; poses {hand.latest.pose}, guard {hand.latest.guard}")


def _wait(hand: Any, condition: Any, seconds: float = 5) -> bool:
    deadline = time.monotonic() + seconds
    while not condition() and time.monotonic() < deadline:
        hand.poll(0.1)
    return bool(condition())


class ScriptedServer:
    """A VRPN server in a thread that notes what one client sends. `extensions`: it answers the question for the
    capabilities."""

    def __init__(self, extensions: bool = True, device: str = "Phantom") -> None:
        self.extensions = extensions
        self.device = device
        self.received: List[Tuple[str, bytes]] = []
        self.answer = b""  # sent behind each pong
        self.chatter = b""  # sent before each read
        self.reads = threading.Event()  # clear: it takes nothing more
        self.reads.set()
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        self.name = f"{device}@tcp://127.0.0.1:{self.port}"
        self.thread = threading.Thread(target=self._serve, daemon=True)
        self.thread.start()

    # What Peer calls.
    def _peer_connected(self) -> None:
        pass

    def _peer_described(self, sender: str) -> None:
        pass

    def _peer_listens(self, host: str, port: int) -> None:
        pass

    def _peer_message(self, kind: int, sender: str, seconds: int, microseconds: int, payload: bytes) -> None:
        self.received.append((TYPE_NAMES[kind], payload))
        if kind == _NUMBERS[m.Ping][0]:
            self.send(m.Pong())
            self.peer.send_frames(self.answer)
        if kind == _NUMBERS[m.QueryCapabilities][0] and self.extensions:
            self.send(m.Capabilities(1, 127, 1000.0, 1000.0, 3.3, 2, (-0.1, -0.1, -0.1, 0.1, 0.1, 0.1)))

    def send(self, message: Any) -> None:
        number, layout = _NUMBERS[type(message)]
        self.peer.send_frames(frame(*now(), 0, number, layout.encode(message)))

    def _serve(self) -> None:
        while True:
            try:
                connection = self.listener.accept()[0]
            except OSError:
                return
            self.peer = Peer(self, [self.device], None)
            with connection:
                while True:
                    try:
                        if self.peer.stream or self.chatter:
                            connection.sendall(self.peer.take_stream() + self.chatter)
                        self.reads.wait()
                        data = connection.recv(1 << 16)
                    except OSError:
                        break
                    if not data:
                        break
                    self.peer.feed(data)

    def wait_for(self, name: str, seconds: float = 60) -> None:
        deadline = time.monotonic() + seconds
        while all(received[0] != name for received in list(self.received)):
            assert time.monotonic() < deadline, f"no {name} in {[r[0] for r in self.received]}"
            time.sleep(0.005)

    def close(self) -> None:
        self.listener.close()


class Listener:
    """Notes the messages that a peer reads."""

    def __init__(self) -> None:
        self.messages: List[Tuple[int, str, int, int, bytes]] = []

    def _peer_connected(self) -> None: ...
    def _peer_described(self, sender: str) -> None: ...
    def _peer_listens(self, host: str, port: int) -> None: ...
    def _peer_message(self, *message: Any) -> None:
        self.messages.append(message)
