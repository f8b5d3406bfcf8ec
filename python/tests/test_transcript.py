"""The same script by the C++ client and by both faces of this one: the same messages, byte for byte."""

import asyncio
import inspect
import os
import subprocess
from typing import Any, Callable, List, Tuple

import numpy as np
import pytest

import hapticd
from hapticd import Effect, Faces, ForceField, Plane, PlaneTexture, Reports, Severity, Surface
from conftest import ScriptedServer

SCRIPT = os.environ.get("HAPTICD_CLIENT_SCRIPT", "")
LAST = "vrpn_Base text_message"


async def script(hand: Any, do: Callable[[Any], Any], batch: Callable[[], Any]) -> None:
    m = (np.arange(16) + 0.5).reshape(4, 4).T
    v = (0.5, 1.5, -2.5)
    await do(hand.wait_capabilities())
    hand.set_object_count(3)
    hand.set_vertex(1, 2, 0.5, -1.5, 2.5)
    hand.set_vertices(1, 4, [[1, 2, 3], [4, 5, 6]])
    hand.set_surface(1, Surface(0.1, 0.2, 0.3, 0.4, 0.5, 0.6))
    hand.set_surface_property(2, "stiffness", 0.7)
    hand.set_transform(2, m)
    hand.set_touchable(2, False)
    hand.set_touchable_faces(Faces.BACK)
    hand.set_workspace_box((1, 2, 3), (4, 5, 6), m)
    hand.set_workspace_projection(hapticd.IDENTITY, m)
    hand.set_effect(0, Effect.constant((0, 1, 0), 2, 100))
    hand.set_effect(1, Effect.spring((1, 2, 3), 0.5, 2, 100))
    hand.set_effect(2, Effect.viscous(0.01, 1, 5))
    hand.set_effect(3, Effect.friction(0.5, 1))
    hand.set_effect(4, Effect.motor_vibration(80, 0.5))
    hand.set_effect(5, Effect.contact_vibration(400, 0.25))
    hand.start_effect(4)
    hand.stop_effect(4)
    hand.reset_scene()

    hand.add_object(3, 1)
    hand.add_object_outside_scene(4)
    hand.move_to_parent(3, -1)
    hand.set_object_position(3, v)
    hand.set_object_orientation(3, v, 0.75)
    hand.set_object_scale(3, v)
    hand.set_normal(3, 1, 0, 1, 0)
    hand.set_triangle(3, 5, (0, 1, 2))
    hand.set_triangle(3, 6, (2, 1, 0), (3, 4, 5))
    hand.remove_triangle(3, 6)
    hand.update_mesh(3, Surface(0.1, 0.002, 0.3, 0.4, 0.5, 0.6))
    hand.transform_mesh(3, (np.arange(16) + 0.25).reshape(4, 4))
    hand.set_mesh_type(3, 1)
    hand.set_object_name(3, "part.stl")
    hand.clear_mesh(3)
    hand.remove_object(3)
    hand.set_haptic_origin(v, (0, 1, 0), 0.25)
    hand.set_haptic_scale(2)
    hand.set_scene_origin(v, (1, 0, 0), 0.5)

    hand.set_plane(Plane((0, 2, 0, 0.5), 0.25, 0.002, 0.3, 0.2, 3, 25))
    hand.set_plane_texture(PlaneTexture(0.1, 0.2, 0.3, 0.4, 0.5, 0.6))
    hand.stop_plane(3)
    hand.set_force_field(ForceField((1, 2, 3), (4, 5, 6), np.arange(1, 10).reshape(3, 3), 0.5))
    hand.stop_force_field()
    hand.constrain_to_point((1, 2, 3), 100)
    hand.constrain_to_line((1, 2, 3), (0, 0, 1), 200)
    hand.constrain_to_plane((1, 2, 3), (0, 1, 0), 300)
    hand.release_constraint()
    hand.start_custom_effect(7, (1, 2, 3))
    hand.stop_custom_effect()

    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    await do(hand.upload_mesh(1, vertices, [[0, 1, 2], [0, 2, 3]]))
    await do(hand.upload_corners(2, vertices[:3]))
    async with batch():
        hand.set_touchable(1, True)
        hand.set_touchable(2, False)
    await do(hand.subscribe(Reports.TICK | Reports.BUTTON, 250))
    await do(hand.stop_forces())
    await do(hand.rearm_forces())
    await do(hand.mark("trial 3 begins"))
    await do(hand.enable_heartbeat())
    await do(hand.enable_heartbeat(False))
    await do(hand.hold_hand((1, 2, 3), (0, 0, 1, 0), 2))
    await do(hand.release_hand())
    contact = hapticd.RemoteContact(
        7, (1, 2, 3), (0, 1, 0), 600, 0.5, 0.4, 0.3, (4, 5, 6), (7, 8, 9), hapticd.RemoteShape.CYLINDER, 0.25, (1, 0, 0),
        0.05, True,
    )  # fmt: skip
    await do(hand.set_remote_contacts([contact, hapticd.RemoteContact(8, (1, 2, 3), (0, 1, 0))]))
    await do(hand.set_force((1, 2, 3), (4, 5, 6), 0.05))

    hand.request_to_room()
    hand.request_unit_to_sensor()
    hand.request_workspace()
    hand.set_update_rate(125)
    hand.reset_origin()
    hand.set_button_mode(hapticd.ALL_BUTTONS, hapticd.ButtonMode.TOGGLE_STARTS_ON)
    hand.send_text("end of the script", Severity.WARNING)
    await do(hand.flush_all())


class _Entered:
    """A `with` block as an `async with` block."""

    def __init__(self, manager: Any) -> None:
        self.manager = manager

    async def __aenter__(self) -> None:
        self.manager.__enter__()

    async def __aexit__(self, *exception: Any) -> None:
        self.manager.__exit__(*exception)


async def _nothing(_: Any) -> None:
    pass


async def _await(what: Any) -> Any:
    return await what


def sync_transcript(name: str) -> None:
    with hapticd.connect(name) as hand:
        asyncio.run(script(hand, _nothing, lambda: _Entered(hand.batch())))


def async_transcript(name: str) -> None:
    async def run() -> None:
        async with hapticd.aio.connect(name) as hand:
            await script(hand, _await, hand.batch)

    asyncio.run(run())


def cpp_transcript(name: str) -> None:
    subprocess.run([SCRIPT, name], check=True, timeout=120)


def commands(play: Callable[[str], None]) -> List[Tuple[str, bytes]]:
    """What a client sends, without pings and heartbeats of the clock."""
    server = ScriptedServer()
    play(server.name)
    server.wait_for(LAST)
    server.close()
    beats = ("vrpn_Base ping_message",)
    clocked = ("hapticd Remote_Contacts", "hapticd Held_Force")  # they begin with the client's time
    random = ("hapticd Identify",)  # they end with the client's key
    return [
        (name, p[8:] if name in clocked else p[:-8] if name in random else p)
        for name, p in server.received
        if name not in beats
    ]


def test_both_faces_send_the_same() -> None:
    assert commands(async_transcript) == commands(sync_transcript)


@pytest.mark.skipif(not SCRIPT, reason="HAPTICD_CLIENT_SCRIPT does not name the C++ client")
def test_cpp_and_python_send_the_same() -> None:
    ours, theirs = commands(sync_transcript), commands(cpp_transcript)
    assert [name for name, _ in ours] == [name for name, _ in theirs]
    for (name, our_payload), (_, their_payload) in zip(ours, theirs):
        assert our_payload == their_payload, name


def test_both_faces_have_the_same_calls() -> None:
    public = lambda cls: {n for n, _ in inspect.getmembers(cls) if not n.startswith("_")}  # noqa: E731
    assert public(hapticd.Client) - public(hapticd.aio.Client) == {"run_for"}
    assert public(hapticd.aio.Client) - public(hapticd.Client) == set()


def test_every_call_of_the_cpp_client_exists() -> None:
    import pathlib
    import re

    header = pathlib.Path(__file__).resolve().parents[2] / "include/hapticd/client.h"
    body = header.read_text().split("class HAPTICD_EXPORT Client {")[1].split(" private:")[0]
    names = re.findall(r"^  [A-Za-z][\w:<>&*\s]*?[ &]([a-z]\w+)\(", body, re.M)
    assert len(names) > 70
    snake = lambda name: re.sub(r"([A-Z])", lambda c: "_" + c[1].lower(), name)  # noqa: E731
    missing = [name for name in names if not hasattr(hapticd.Client, snake(name)) and name not in ("device", "server", "latest")]
    assert missing == []
