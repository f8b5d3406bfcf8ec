"""hapticd-ros2 with a node that another implementation of DDS makes (tests/python/ros2_peer.cpp)."""

import collections
import os
import pathlib
import struct
import subprocess
import threading
import time
from typing import Any, Callable, DefaultDict, Iterator, List

import numpy as np
import pytest

import hapticd

from conftest import HAPTICD, Server, press
from bridge_process import Process

DOMAIN = str(100 + os.getpid() % 100)  # of this test, whoever else uses DDS here
#: From the axes of the device (x right, y up, z towards the user) to x forward, y left, z up.
TURN = np.array([[0, 0, -1], [-1, 0, 0], [0, 1, 0]])


class Bridge(Process):
    """One process of hapticd-ros2."""

    def __init__(self, server: Server, *options: str) -> None:
        command = [os.environ["HAPTICD_ROS2"], "--server", server.tcp, "--domain", DOMAIN, *options]
        super().__init__(command)
        self.wait_for("topics below .*; Ctrl-C ends")


class Node:
    """The newest sample of each topic that the node has received."""

    def __init__(self, namespace: str = "/Phantom") -> None:
        self.process = subprocess.Popen(
            [os.environ["HAPTICD_ROS2_PEER"], DOMAIN, namespace], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.newest: DefaultDict[str, List[str]] = collections.defaultdict(list)
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            topic, *values = line.split()
            self.newest[topic] = values

    def numbers(self, topic: str, first: int = 1) -> Any:
        deadline = time.monotonic() + 60
        while not self.newest[topic]:
            assert time.monotonic() < deadline, f"nothing arrived on {topic}"
            time.sleep(0.01)
        return np.array(self.newest[topic][first:], dtype=float)

    def write(self, *words: Any) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(" ".join(str(word) for word in words) + "\n")
        self.process.stdin.flush()

    def stop(self) -> None:
        assert self.process.stdin is not None
        self.process.stdin.close()
        assert self.process.wait(30) == 0


@pytest.fixture
def node() -> Iterator[Node]:
    node = Node()
    yield node
    node.stop()


def wait(hand: hapticd.Client, condition: Callable[[], Any], repeat: Callable[[], Any] = lambda: None) -> None:
    deadline = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline, (hand.latest.guard, hand.latest.force, hand.latest.pose)
        repeat()
        hand.poll(0.02)


def matrix(quaternion: Any) -> Any:
    x, y, z, w = quaternion
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])  # fmt: skip


def test_the_node_reads_the_hand(server: Server, node: Node) -> None:
    bridge = Bridge(server)
    turned = (0.1, 0.3, -0.5, 0.8)
    length = np.linalg.norm(turned)
    with hapticd.connect(server.tcp) as hand:
        place = TURN @ (0.003, -0.004, 0.03)

        hand.hold_hand((3, -4, 30), tuple(np.array(turned) / length), buttons=2)
        wait(hand, lambda: np.allclose(node.numbers("measured_cp")[:3], place, atol=1e-6))
        expected = TURN @ matrix(np.array(turned) / length)
        wait(hand, lambda: np.allclose(matrix(node.numbers("measured_cp")[3:]), expected, atol=1e-4))
        wait(hand, lambda: np.allclose(node.numbers("proxy/measured_cp")[:3], place, atol=1e-6))
        for topic in ("measured_cp", "measured_cv", "measured_cf"):
            wait(hand, lambda: node.newest[topic][:1] == ["Phantom_base"])
        wait(hand, lambda: node.newest["contact/object"] == ["-1"] and node.newest["contact/depth"] == ["0"])
        wait(hand, lambda: node.newest["buttons"] == ["Phantom_base", "0", "1"])
        wait(hand, lambda: node.newest["operating_state"] == ["Phantom_base", "ENABLED", "1", "0"])
        assert not node.newest["gripper/measured_js"]
        for begin, name in ((0, "Phantom"), (9, "Phantom_proxy")):
            wait(hand, lambda: node.newest["/tf"][begin : begin + 2] == ["Phantom_base", name])
            wait(hand, lambda: np.allclose(np.array(node.newest["/tf"][begin + 2 : begin + 5], dtype=float), place, atol=1e-6))

        # Velocity: forward, away from the user.
        fastest = 0.0
        for z_mm in np.arange(30, -30, -1.0):
            hand.hold_hand((3, -4, z_mm))
            hand.run_for(0.01)
            fastest = max(fastest, node.numbers("measured_cv")[0])
        assert 0.03 < fastest < 1, fastest

        # And to the left and back, about the axis that points up. The simulated hand turns at one speed.
        turning = []
        for angle in (0.0, 1.5) * 3:
            hand.hold_hand((3, -4, -30), (0, np.sin(angle / 2), 0, np.cos(angle / 2)))
            for _ in range(50):
                hand.run_for(0.01)
                turning.append(node.numbers("measured_cv")[3:])
        fast = [v for v in turning if np.linalg.norm(v) > 0.1]
        assert fast and all(abs(v[:2]).max() < 1e-3 * abs(v[2]) for v in fast), turning
        assert min(v[2] for v in fast) < 0 < max(v[2] for v in fast), fast
        expected = TURN @ matrix((0, np.sin(0.75), 0, np.cos(0.75)))
        wait(hand, lambda: np.allclose(matrix(node.numbers("measured_cp")[3:]), expected, atol=1e-4))
    bridge.stop()


def test_the_hand_touches_the_mesh_of_the_node(server: Server, node: Node) -> None:
    bridge = Bridge(server, "--object", "part", "--first-object", "2", "--stiffness", "0.5", "--rate", "500")
    with hapticd.connect(server.tcp) as hand:
        hand.hold_hand((0, 30, 0))
        wait(hand, lambda: 1 in hand.latest.pose and abs(hand.latest.pose[1].position_m[1] - 0.03) < 1e-6)

        def uploaded() -> bool:
            return any("object 2 is 'part': 2 triangles" in line for line in bridge.log)

        # Repeated, because a sample before the two have found each other is lost.
        wait(hand, uploaded, lambda: (node.write("pose", "Phantom_base", 0, 0, 0.01, 0, 0, 0, 1), node.write("plate", 0.005)))
        press(hand, [(0, y_mm, 0) for y_mm in np.arange(30, 11.9, -0.5)], lambda: hand.latest.touched_object.object == 2)
        wait(hand, lambda: abs(node.numbers("proxy/measured_cp")[2] - 0.015) < 1e-5 and node.newest["contact/object"] == ["2"])

        def felt() -> bool:
            depth = node.numbers("contact/depth", 0)[0]
            force = node.numbers("measured_cf")[:3]
            return bool(depth > 0.001 and np.allclose(force, (0, 0, 250 * depth), atol=0.01))  # half of 500 N/m

        wait(hand, felt)
        node.write("pose", "-", 0, 0, 0.005, 0, 0, 0, 1)  # down: away from the hand
        wait(hand, lambda: node.newest["contact/object"] == ["-1"] and np.allclose(node.numbers("measured_cf"), 0))

        uploads = len(bridge.log)
        node.write("newer", 0.004)  # by a newer version of the message
        wait(hand, lambda: "object 2 is 'part': 2 triangles" in "".join(bridge.log[uploads:]))

        node.write("plate", 0.004, 100)  # 0.7 MB
        bridge.wait_for("object 2 is 'part': 20000 triangles")

        # What is wrong is left out.
        node.write("pose", "map", 0, 0, 0, 0, 0, 0, 1)
        bridge.wait_for(r"/Phantom/part/pose is ignored: frame_id is 'map'; transform the message into 'Phantom_base'")
        node.write("pose", "-", 0, 0, 0, 0, 0, 0, 0)
        bridge.wait_for(r"part/pose is ignored: .* a quaternion of length 1")
        node.write("broken")
        bridge.wait_for(r"part/mesh is ignored: a vertex is not finite")
        node.write("beyond")
        bridge.wait_for(r"part/mesh is ignored: a triangle names a vertex that is not there; there are 4")

        bridge.stop()  # takes the object out of the scene
        hand.hold_hand((0, 30, 0))
        wait(hand, lambda: abs(hand.latest.pose[1].position_m[1] - 0.03) < 1e-5)
        hand.hold_hand((0, -20, 0))
        wait(hand, lambda: abs(hand.latest.pose[0].position_m[1] + 0.02) < 1e-5)


def test_the_node_puts_a_force_on_the_hand_and_stops_it(server: Server, node: Node) -> None:
    bridge = Bridge(server)
    with hapticd.connect(server.tcp) as hand:
        push = lambda: node.write("force", "Phantom_base", 0, 0.2, 0.5, 0, 0, 0)  # noqa: E731: left and up
        wait(hand, lambda: np.allclose(hand.latest.force.force_N, (-0.2, 0.5, 0), atol=0.02), push)
        wait(hand, lambda: np.allclose(hand.latest.force.force_N, 0))  # 100 ms after the last one

        node.write("force", "camera", 0, 0, 1, 0, 0, 0)
        bridge.wait_for(r"/Phantom/servo_cf is ignored: frame_id is 'camera'")
        node.write("force", "-", 0, "nan", 1, 0, 0, 0)
        bridge.wait_for(r"servo_cf is ignored: a force or torque is not finite")

        node.write("state", "disable")
        wait(hand, lambda: hand.latest.guard.stopped and node.newest["operating_state"][1:2] == ["DISABLED"])
        push()
        hand.run_for(0.1)
        assert np.allclose(hand.latest.force.force_N, 0)
        node.write("state", "home")
        bridge.wait_for(r"state_command is ignored: 'home' is not known; known are disable, pause, enable and resume")
        node.write("state", "enable")
        wait(hand, lambda: not hand.latest.guard.stopped and node.newest["operating_state"][1:2] == ["ENABLED"])
        wait(hand, lambda: np.allclose(hand.latest.force.force_N, (-0.2, 0.5, 0), atol=0.02), push)
    bridge.stop()


def test_a_bridge_that_only_reads(server: Server) -> None:
    bridge = Bridge(server, "--read-only", "--namespace", "/lab/left", "--frame", "device")
    node = Node("/lab/left")
    with hapticd.connect(server.tcp) as hand:
        hand.hold_hand((3, -4, 30))
        wait(hand, lambda: np.allclose(node.numbers("measured_cp")[:3], (0.003, -0.004, 0.03), atol=1e-6))
        for _ in range(20):
            node.write("force", "-", 0, 0, 1, 0, 0, 0)
            node.write("state", "disable")
            hand.run_for(0.02)
            assert np.allclose(hand.latest.force.force_N, 0) and not hand.latest.guard.stopped
    bridge.stop()
    node.stop()


def test_a_server_that_is_restarted_has_the_objects_again(node: Node) -> None:
    server = Server()
    bridge = Bridge(server, "--object", "part")

    def uploads() -> int:
        return sum("object 0 is 'part': 2 triangles" in line for line in bridge.log)

    with hapticd.connect(server.tcp) as hand:
        wait(hand, uploads, lambda: node.write("plate", 0.005))
        wait(hand, lambda: node.newest["operating_state"][1:2] == ["ENABLED"])
    before = uploads()
    port = server.port
    server.stop()
    bridge.wait_for("lost 127.0.0.1:")
    deadline = time.monotonic() + 60
    while node.newest["operating_state"][1:3] != ["FAULT", "0"]:
        assert time.monotonic() < deadline
        node.write("force", "-", 0, 0, 0.1, 0, 0, 0)  # to nobody
        node.write("pose", "-", 0, 0, 0, 0, 0, 0, 1)
        time.sleep(0.02)
    server.start(f"127.0.0.1:{port}")
    while uploads() == before or node.newest["operating_state"][1:3] != ["ENABLED", "1"]:
        assert time.monotonic() < deadline, bridge.log
        time.sleep(0.02)
    bridge.stop()
    server.stop()


def test_the_opening_of_a_gripper(node: Node, tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The library of the device is the mock, to which ArmBlock of tests/mocks/arm_block.h gives the opening."""
    arm = tmp_path / "arm"
    with arm.open("wb") as file:
        file.truncate(32 << 20)
        file.seek(8)
        file.write(struct.pack("=i", 1))  # one place, the origin
        file.seek(24600)
        file.write(struct.pack("=d", 0.25))
    mocks = pathlib.Path(HAPTICD).parents[1] / "mocks"
    monkeypatch.setenv("HAPTICD_MOCK_ARM", str(arm))
    monkeypatch.setenv("HAPTICD_DHD_LIB", os.environ.get("HAPTICD_MOCK_DRD", str(mocks / "libmock_drd.so")))
    server = Server("--device", "forcedimension")
    bridge = Bridge(server)
    with hapticd.connect(server.tcp) as hand:
        wait(hand, lambda: node.newest["gripper/measured_js"] == ["Phantom_base", "gripper", "0.25"])
    bridge.stop()
    server.stop()


def test_options_that_are_wrong() -> None:
    def refusal(*options: str) -> str:
        result = subprocess.run([os.environ["HAPTICD_ROS2"], *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert result.returncode == (1 if "--server" in options or options.count("--object") > 1 else 2)
        return result.stdout + result.stderr

    assert "a name of letters, digits and underscores, got '9a'" in refusal("--object", "9a")
    assert "names behind slashes, such as /left, got 'left'" in refusal("--namespace", "left")
    assert "0 to 232" in refusal("--domain", "233")
    assert "'part' is given twice" in refusal("--object", "part", "--object", "part")
    assert "nothing listens on 127.0.0.1:1" in refusal("--server", "Phantom@tcp://127.0.0.1:1")
