"""The bridge with a client that the protocol's own library makes (tests/python/igtlink_peer.cpp): the hand touches the model
that the client has sent, and the client reads it."""

import os
import subprocess
import threading
import time
from typing import Any, Dict, List

import numpy as np

import hapticd

from conftest import Server, press
from bridge_process import Bridge

PEER = os.environ["HAPTICD_IGTLINK_PEER"]


class Peer:
    """The newest message of each name that the client has printed."""

    def __init__(self, port: int) -> None:
        self.process = subprocess.Popen([PEER, "127.0.0.1", str(port)], stdout=subprocess.PIPE, text=True)
        self.newest: Dict[str, List[str]] = {}
        self.thread = threading.Thread(target=self._read, daemon=True)
        self.thread.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            kind, name, *values = line.split()
            self.newest[f"{kind} {name}"] = values

    def matrix(self, name: str) -> Any:
        return np.array(self.newest["TRANSFORM " + name], dtype=float).reshape(3, 4)


def wait(hand: hapticd.Client, condition: Any) -> None:
    deadline = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline, (hand.latest.guard, hand.latest.force, hand.latest.pose)
        hand.poll(0.05)


def test_the_hand_touches_the_model_of_the_client(server: Server) -> None:
    turned = (0.5, 0.5, 0.5, 0.5)  # x to y, y to z, z to x
    bridge = Bridge(server, "--stiffness", "0.5", "--first-object", "2")
    with hapticd.connect(server.tcp) as hand:
        hand.hold_hand((3, -4, 30), turned)
        wait(hand, lambda: 1 in hand.latest.pose and abs(hand.latest.pose[1].position_m[2] - 0.03) < 1e-6)
        peer = Peer(bridge.port)
        bridge.wait_for(r"object 2 is 'Plate': 12 triangles")
        expected = ["TRANSFORM", "POLYDATA", "STRING", "GET_CAPABIL", "GET_STATUS"]
        wait(hand, lambda: peer.newest.get("CAPABILITY Phantom") == expected)

        # The plate's top is at A = 5 + 10 mm: z = 15 mm of the device. Slowly: a hand that jumps into it does not feel it.
        way = [(3, -4, z_mm) for z_mm in np.arange(30, 11.9, -0.5)]
        press(hand, way, lambda: hand.latest.touched_object.object == 2, orientation=turned, buttons=2)
        wait(hand, lambda: abs(peer.matrix("PhantomProxy")[1, 3] - 15) < 0.01 and peer.matrix("PhantomHand")[1, 3] < 14)
        hand_A = peer.matrix("PhantomHand")[1, 3]
        for name, depth in (("PhantomHand", hand_A), ("PhantomProxy", 15)):
            # x right is -R, y up is S, z towards the user is A.
            assert np.allclose(peer.matrix(name)[:, 3], (-3, depth, -4), atol=0.01), peer.matrix(name)
            assert np.allclose(peer.matrix(name)[:, :3], [[0, 0, -1], [0, 1, 0], [1, 0, 0]], atol=1e-4), peer.matrix(name)

        def force_is_that_of_the_depth() -> bool:
            force = np.array(peer.newest["STRING PhantomForce"], dtype=float)
            depth_mm = 15 - peer.matrix("PhantomHand")[1, 3]
            return bool(np.allclose(force, (0, 0.25 * depth_mm, 0), atol=0.005))  # half of 500 N/m

        wait(hand, force_is_that_of_the_depth)
        wait(hand, lambda: peer.newest["STRING PhantomButtons"] == ["up", "down"])
        assert hand.latest.touched_object.object == 2

        bridge.stop()  # takes the model out of the scene, and ends the client
        for z_mm in (30, 12):
            hand.hold_hand((3, -4, z_mm))
            wait(hand, lambda: all(abs(hand.latest.pose[sensor].position_m[2] - z_mm / 1000) < 1e-5 for sensor in (0, 1)))
        assert peer.process.wait(30) == 0
        peer.thread.join(30)
