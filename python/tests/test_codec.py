"""The codec against the byte vectors, and against conversations of VRPN's own client and server."""

import json
import pathlib
import re
from typing import Any, Dict, List, Tuple

import numpy as np
import pytest

from conftest import Listener

from hapticd import _messages as m
from hapticd._codec import DecodeError, frame
from hapticd._core import _NUMBERS
from hapticd._peer import COOKIE, TYPE_NAMES, Peer, ProtocolError

WIRE = pathlib.Path(__file__).resolve().parents[2] / "testdata/wire"
VECTORS = json.loads((WIRE / "vectors.json").read_text())
LAYOUTS = {layout.name: layout for layout in m.LAYOUTS}


def plain(value: Any) -> Any:
    return [plain(v) for v in value] if isinstance(value, (tuple, list)) else value


def same(ours: Any, theirs: Any) -> bool:
    if isinstance(theirs, str) and isinstance(ours, int):
        return ours == int(theirs)  # 64-bit integers are decimal text
    if isinstance(theirs, list):
        return len(ours) == len(theirs) and all(same(a, b) for a, b in zip(ours, theirs))
    return bool(ours == theirs)


@pytest.mark.parametrize("vector", VECTORS, ids=lambda v: v["struct"])
def test_vectors(vector: Dict[str, Any]) -> None:
    layout = LAYOUTS[vector["name"]]
    assert layout.cls.__name__ == vector["struct"]
    payload = bytes.fromhex(vector["payload"])
    message = layout.decode(payload)
    assert message._fields == tuple(vector["fields"])
    for name, value in vector["fields"].items():
        assert same(plain(getattr(message, name)), value), name
    assert layout.encode(message) == payload
    h = vector["header"]
    whole = frame(h["seconds"], h["microseconds"], h["sender"], h["type"], payload)
    assert whole[:20] == bytes.fromhex(vector["frame"])[:20] and whole[24:] == bytes.fromhex(vector["frame"])[24:]


def test_every_message_has_vectors() -> None:
    assert {v["name"] for v in VECTORS} == set(LAYOUTS)


def test_a_payload_of_another_length_is_refused() -> None:
    for layout in m.LAYOUTS:
        payload = layout.encode(layout.cls())
        with pytest.raises(DecodeError, match=re.escape(layout.name)):
            layout.decode(payload[:-1] if payload else b"1")


def test_values_that_do_not_fit_name_the_field() -> None:
    with pytest.raises(ValueError, match=r"position is .*, expected 3 numbers"):
        LAYOUTS["vrpn_ForceDevice setVertex"].encode(m.SetVertex(0, 0, (1, 2)))
    with pytest.raises(ValueError, match="property 'x{21}' has 21 bytes, at most 20"):
        LAYOUTS["vrpn_ForceDevice setHapticProperty"].encode(m.SetHapticProperty(0, "x" * 21, 0))
    with pytest.raises(ValueError, match="text 'x{256}' has 256 bytes, at most 255"):
        LAYOUTS["hapticd Marker"].encode(m.Marker(0, "x" * 256))
    with pytest.raises(ValueError, match="text '.*' has a NUL character"):
        LAYOUTS["hapticd Marker"].encode(m.Marker(0, "trial\x003"))
    with pytest.raises(ValueError, match="setObjectNumber"):
        LAYOUTS["vrpn_ForceDevice setObjectNumber"].encode(m.SetObjectNumber(1 << 40))


def hear(data: bytes, piece: int) -> List[Tuple[int, str, int, int, bytes]]:
    listener = Listener()
    peer = Peer(listener, ["Phantom"], None)
    for at in range(0, len(data), piece):
        peer.feed(data[at : at + piece])
    return listener.messages


@pytest.mark.parametrize("way", ["c2s", "s2c"])
def test_recorded_conversations_are_read_in_whatever_pieces(way: str) -> None:
    data = (WIRE / f"tcp.{way}.tcp.bin").read_bytes()
    whole = hear(data, len(data))
    counts: Dict[str, int] = {}
    for message in whole:
        assert message[1] == "Phantom"
        counts[TYPE_NAMES[message[0]]] = counts.get(TYPE_NAMES[message[0]], 0) + 1
    expected = {}
    for line in (WIRE / "tcp.index.txt").read_text().splitlines():
        match = re.fullmatch(r"(\S+)\s+(.*\S)\s+x(\d+)", line)
        if match and match[1] == way and not match[2].endswith("_DESCRIPTION"):
            expected[match[2]] = int(match[3])
    assert counts == expected
    for piece in (1, 7, 1000):
        assert hear(data, piece) == whole


def test_recorded_messages_are_written_as_vrpn_writes_them() -> None:
    data = (WIRE / "tcp.c2s.tcp.bin").read_bytes()
    ragged = {"vrpn_ForceDevice setHapticProperty", "vrpn_ForceDevice Effect", "vrpn_Base text_message"}
    compared = 0
    for kind, _, _, _, payload in hear(data, len(data)):
        layout = m.LAYOUTS[kind]
        message = layout.decode(payload)
        ours = layout.encode(message)
        if layout.name in ragged:  # bytes behind a text are undefined
            assert layout.decode(ours) == message
        else:
            assert ours == payload
        compared += 1
    assert compared > 50


def test_a_peer_that_breaks_the_protocol_is_refused() -> None:
    peer = Peer(Listener(), [], None)
    with pytest.raises(ProtocolError, match="opened with 'HTTP/1.1"):
        peer.feed(b"HTTP/1.1 400 Bad Request")
    peer = Peer(Listener(), [], None)
    peer.feed(COOKIE)
    with pytest.raises(ProtocolError, match="frame of 3 bytes"):
        peer.feed(b"\0\0\0\3" + bytes(20))


def test_damaged_datagrams_are_ignored() -> None:
    listener = Listener()
    peer = Peer(listener, [], None)
    data = (WIRE / "tcp.s2c.tcp.bin").read_bytes()
    peer.feed(data)
    heard = len(listener.messages)
    for size in range(0, 200):
        peer.feed_datagram(bytes([size]) * size)
    number = _NUMBERS[m.Text][0]
    peer.feed_datagram(frame(0, 0, 99, -1, b"\0\0\0\2x\0"))
    assert len(listener.messages) == heard and number >= 0


def test_arrays_are_taken_for_vectors_and_lists() -> None:
    layout = LAYOUTS["hapticd Mesh_Vertices"]
    values = np.arange(6, dtype=np.float64)
    assert layout.encode(m.MeshVertices(1, 2, values)) == layout.encode(m.MeshVertices(1, 2, tuple(values)))
    box = LAYOUTS["vrpn_ForceDevice setVertex"]
    assert box.encode(m.SetVertex(1, 2, np.float32([1, 2, 3]))) == box.encode(m.SetVertex(1, 2, (1, 2, 3)))
