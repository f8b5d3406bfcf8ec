"""The bridge to OpenIGTLink: what it does with right, wrong and too many messages, and as a command."""

import pathlib
import re
import socket
import struct
import subprocess
import sys
from typing import Any, Iterator, Tuple

import numpy as np
import pytest

import hapticd
from hapticd import _openigtlink as igtl
from hapticd import igtlink

from conftest import Server, _wait
from bridge_process import Bridge

#: A model of four corners and two triangles.
SQUARE = (
    struct.pack(">10I", 4, 0, 0, 0, 0, 1, 20, 0, 0, 0)
    + np.array([[-40, -40, 0], [40, -40, 0], [40, 40, 0], [-40, 40, 0]], dtype=">f4").tobytes()
    + struct.pack(">5I", 4, 0, 1, 2, 3)
)


@pytest.fixture
def bridge(server: Server) -> Iterator[Bridge]:
    one = Bridge(server, "--frame", "device")
    yield one
    one.stop()


class Sender:
    """A client by its bytes."""

    def __init__(self, bridge: Bridge) -> None:
        self.socket = socket.create_connection(("127.0.0.1", bridge.port), 60)
        self.file = self.socket.makefile("rb")
        self.name = "%s:%s" % self.socket.getsockname()[:2]

    def send(self, kind: str, name: str, content: bytes = b"") -> None:
        self.socket.sendall(igtl.message(kind, name, content, 0))

    def receive(self) -> Tuple[igtl.Header, bytes]:
        header = igtl.parse_header(self.file.read(igtl.HEADER.size))
        return header, igtl.content_of(header, self.file.read(header.size))

    def receive_kind(self, kind: str) -> Tuple[igtl.Header, bytes]:
        while True:
            header, content = self.receive()
            if header.type == kind:
                return header, content

    def is_alive(self) -> bool:
        """Whether the bridge still reads and answers its messages."""
        self.send("GET_CAPABIL", "")
        return self.receive_kind("CAPABILITY")[0].name == "Phantom"


def raw(kind: bytes, size: int, crc: int = 0, version: int = 1) -> bytes:
    return struct.pack(">H12s20sQQQ", version, kind, b"Model", 0, size, crc)


def press(hand: hapticd.Client, down_to_mm: float) -> None:
    """Moves the hand down along z, slowly: a hand that jumps into a model does not feel it."""
    for z_mm in np.arange(10, down_to_mm - 0.1, -0.5):
        hand.hold_hand((0, 0, z_mm))
        hand.run_for(0.05)


def feels(hand: hapticd.Client, stiffness_N_per_mm: float) -> bool:
    """Whether the force becomes the one of this stiffness, and stays so."""
    hand.subscribe(hapticd.Reports.USUAL | hapticd.Reports.TICK)
    matching = 0
    for tick in hand.reports("tick", seconds=60):
        depth_mm = 1000 * tick.depth_m
        matching = matching + 1 if depth_mm > 0.2 and abs(tick.force_N[2] - stiffness_N_per_mm * depth_mm) < 0.01 else 0
        if matching == 300:
            return True
    return False


def lift(hand: hapticd.Client) -> None:
    hand.hold_hand((0, 0, 30))
    assert _wait(hand, lambda: 1 in hand.latest.pose and hand.latest.pose[1].position_m[2] > 0.0299, 60)


def test_models_surfaces_and_places_in_any_order(server: Server, bridge: Bridge) -> None:
    with hapticd.connect(server.tcp) as hand:
        lift(hand)
        sender = Sender(bridge)
        sender.send("TRANSFORM", "Table", igtl.transform_content(hapticd.translation(0, 0, 2)))
        sender.send("STRING", "Table", igtl.string_content("stiffness=0.4"))
        sender.send("POLYDATA", "Other", SQUARE[:4] + bytes(36) + SQUARE[40:88])  # has no triangles
        sender.send("POLYDATA", "Table", SQUARE)
        bridge.wait_for("object 0 is 'Other': 0 triangles")
        bridge.wait_for("object 1 is 'Table': 2 triangles")
        press(hand, 0)
        assert feels(hand, 0.2)  # 0.4 of 500 N/m
        assert hand.latest.touched_object.object == 1
        sender.send("STRING", "Table", igtl.string_content("stiffness=0.8 damping=0"))
        assert feels(hand, 0.4)
        lift(hand)
        sender.send("TRANSFORM", "Table", igtl.transform_content(hapticd.translation(0, 0, -3)))
        assert sender.is_alive()
        press(hand, 0)
        assert _wait(hand, lambda: hand.latest.pose[1].position_m[2] < 0.001, 60)
        assert hand.latest.depth.depth_m == 0 and not hand.latest.force.force_N.any()
        sender.send("POLYDATA", "Table", SQUARE[:4] + bytes(36) + SQUARE[40:88])  # sent again, it is replaced
        bridge.wait_for("object 1 is 'Table': 0 triangles")


def test_texts_are_sent_again_only_when_they_change(server: Server, bridge: Bridge) -> None:
    with hapticd.connect(server.tcp) as hand:
        lift(hand)
        sender = Sender(bridge)
        texts = {}
        while texts != {"PhantomForce": "0.000 0.000 0.000", "PhantomButtons": "up up"}:
            header, content = sender.receive_kind("STRING")
            texts[header.name] = igtl.read_string(content)
        assert {sender.receive()[0].name for _ in range(60)} == {"PhantomProxy", "PhantomHand"}
        hand.hold_hand((0, 0, 30), buttons=1)
        hand.flush_all()
        header, content = sender.receive_kind("STRING")
        assert (header.name, igtl.read_string(content)) == ("PhantomButtons", "down up")


def test_a_large_model_arrives_whole(server: Server, bridge: Bridge) -> None:
    vertices, triangles = hapticd.sphere(25, rings=100)
    cells = np.insert(triangles, 0, 3, axis=1).astype(">u4").tobytes()
    table = struct.pack(">10I", len(vertices), 0, 0, 0, 0, len(triangles), len(cells), 0, 0, 0)
    sender = Sender(bridge)
    sender.send("POLYDATA", "Ball", table + vertices.astype(">f4").tobytes() + cells)
    bridge.wait_for(f"object 0 is 'Ball': {len(triangles)} triangles")
    assert sender.is_alive()


def test_models_come_back_after_a_restart_of_the_server() -> None:
    server = Server()
    bridge = Bridge(server, "--frame", "device")
    sender = Sender(bridge)
    sender.send("POLYDATA", "Table", SQUARE)
    bridge.wait_for("object 0 is 'Table'")
    port = server.port
    server.stop()
    bridge.wait_for(rf"lost 127\.0\.0\.1:{port}: ")
    sender.send("GET_STATUS", "")
    status = sender.receive_kind("STATUS")[1]
    assert struct.unpack_from(">H", status) == (13,) and b"no connection to 127.0.0.1" in status
    server.start(f"127.0.0.1:{port}")
    bridge.wait_for(r"(?s)lost .*connected to .*object 0 is 'Table'")
    with hapticd.connect(server.tcp) as hand:
        lift(hand)
        press(hand, -2)
        assert feels(hand, 0.4)
    sender.send("GET_STATUS", "")
    assert struct.unpack_from(">H", sender.receive_kind("STATUS")[1]) == (1,)
    bridge.stop()
    server.stop()


@pytest.mark.parametrize(
    "data, text",
    [
        (raw(b"POLYDATA", 4, 1) + b"abcd", "'POLYDATA' 'Model' is left out: its CRC is 0000000000000001, that of its body is"),
        (igtl.message("TRANSFORM", "Model", b"abcd", 0), "'TRANSFORM' 'Model' is left out: its content has 4 bytes, expected 48"),
        (igtl.message("POLYDATA", "Model", b"abcd", 0), "'POLYDATA' 'Model' is left out: its content of 4 bytes has no room"),
        (igtl.message("POLYDATA", "", SQUARE, 0), "'POLYDATA' '' is left out: it names no model"),
        (igtl.message("IMAGE", "Model", b"abcd", 0), "a 'IMAGE' is ignored; this bridge reads TRANSFORM, POLYDATA, STRING"),
        (igtl.message("STRING", "Model", igtl.string_content("soft"), 0), "a property 'soft'; write NAME=NUMBER, with the names stiffness"),
        (igtl.message("STRING", "Model", igtl.string_content("stiffness=2"), 0), "stiffness is '2': give a number from 0 to 1"),
        (igtl.message("STRING", "Model", igtl.string_content("damping=nan"), 0), "damping is 'nan': give a number from 0 to 1"),
        (raw(b"POLYDATA", (64 << 20) + 1) + bytes((64 << 20) + 1), "67108865 bytes, at most 67108864; reduce the model"),
        (raw(b"\x1b[2J\xff", 0), "a '.*2J.*' is ignored"),
    ],
    ids=lambda value: value[:20] if isinstance(value, str) else "",
)
def test_a_wrong_message_is_named_and_the_next_one_is_read(bridge: Bridge, data: bytes, text: str) -> None:
    sender = Sender(bridge)
    sender.socket.sendall(data)
    bridge.wait_for(rf"igtlink: client {sender.name}: .*{text}")
    assert sender.is_alive()
    assert "\x1b" not in "".join(bridge.log)


@pytest.mark.parametrize(
    "data, text",
    [
        (b"GET / HTTP/1.1\r\nHost: localhost:18944\r\nAccept: */*\r\n\r\n12345678", "a header of version 18245, expected 1 to 3"),
        (raw(b"POLYDATA", 2**64 - 1), "a message 'POLYDATA' of 18446744073709551615 bytes, at most 67108864 are read"),
    ],
)
def test_a_stream_of_something_else_is_disconnected(bridge: Bridge, data: bytes, text: str) -> None:
    sender, other = Sender(bridge), Sender(bridge)
    sender.socket.sendall(data)
    bridge.wait_for(f"client {sender.name}: disconnected, because its stream cannot be read on: {text}")
    with pytest.raises((ConnectionError, struct.error)):
        while True:
            sender.receive()
    assert other.is_alive()


def test_a_client_that_leaves_in_the_middle_of_a_message(bridge: Bridge) -> None:
    sender = Sender(bridge)
    sender.socket.sendall(raw(b"POLYDATA", 100) + b"abc")
    sender.socket.shutdown(socket.SHUT_WR)
    bridge.wait_for(f"client {sender.name}: disconnected in the middle of a message")


def test_problems_of_one_client_do_not_fill_the_log(bridge: Bridge) -> None:
    sender = Sender(bridge)
    for _ in range(500):
        sender.send("IMAGE", "Model")
    assert sender.is_alive()
    bridge.wait_for("further problems of this client are not logged")
    assert "".join(bridge.log).count("is ignored") == 50


def test_a_client_that_does_not_read_is_dropped(server: Server) -> None:
    bridge = Bridge(server, "--rate", "1000")
    sender, other = Sender(bridge), Sender(bridge)
    sender.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    question = igtl.message("GET_CAPABIL", "", b"", 0) * 1000
    with pytest.raises(ConnectionError):
        while True:
            sender.socket.sendall(question)  # each is answered by twice its size
            for _ in range(20):
                other.receive()
    bridge.wait_for(f"client {sender.name}: disconnected, because it does not read: 1048576 bytes wait for it")
    assert other.is_alive()
    bridge.stop()


def test_the_ninth_client_is_refused(bridge: Bridge) -> None:
    senders = [Sender(bridge) for _ in range(8)]
    assert all(sender.is_alive() for sender in senders)
    ninth = Sender(bridge)
    bridge.wait_for(f"client {ninth.name}: refused, because 8 clients are connected")
    senders[0].socket.shutdown(socket.SHUT_WR)
    bridge.wait_for(f"client {senders[0].name}: disconnected\n")
    assert Sender(bridge).is_alive()


@pytest.mark.parametrize(
    "arguments, text",
    [
        (["--rate", "0"], "argument --rate: '0': give a number from 1 to 1000"),
        (["--rate", "nan"], "argument --rate: 'nan': give a number from 1 to 1000"),
        (["--stiffness", "1.5"], "argument --stiffness: '1.5': give a number from 0 to 1"),
        (["--listen", "18944"], "argument --listen: '18944': give HOST:PORT, such as 127.0.0.1:18944"),
        (["--listen", "127.0.0.1:70000"], "argument --listen: '127.0.0.1:70000': give HOST:PORT"),
        (["--server", "Phantom"], "argument --server: device 'Phantom': expected NAME@host"),
        (["--first-object", "-1"], "argument --first-object: '-1': give a whole number from 0 to 9999"),
        (["--token-file", "/nonexistent"], "argument --token-file: '/nonexistent' cannot be read: .*No such file"),
        (["--frame", "lps"], "argument --frame: invalid choice: 'lps'"),
    ],
)
def test_wrong_options_are_named(arguments: Any, text: str, capsys: "pytest.CaptureFixture[str]") -> None:
    with pytest.raises(SystemExit) as end:
        igtlink.main(arguments)
    assert end.value.code == 2
    assert re.search(text, capsys.readouterr().err)


def test_what_cannot_be_reached_is_named(server: Server, capsys: "pytest.CaptureFixture[str]") -> None:
    assert igtlink.main(["--server", "Phantom@tcp://127.0.0.1:1"]) == 1
    assert "igtlink: Phantom: nothing listens on 127.0.0.1:1" in capsys.readouterr().err
    assert igtlink.main(["--server", server.tcp, "--listen", f"127.0.0.1:{server.port}"]) == 1
    text = f"igtlink: cannot listen on 127.0.0.1:{server.port}: Address already in use; choose another address by --listen\n"
    assert capsys.readouterr().err == text


def test_a_token_that_is_none_is_named(server: Server, tmp_path: pathlib.Path, capsys: "pytest.CaptureFixture[str]") -> None:
    (tmp_path / "token").write_text("short\n")
    assert igtlink.main(["--server", server.tcp, "--token-file", str(tmp_path / "token"), "--listen", "127.0.0.1:0"]) == 1
    assert capsys.readouterr().err == "igtlink: present_token(): 5 characters; a token has 16 to 128\n"


def test_help_explains_the_frames_and_slicer() -> None:
    result = subprocess.run([sys.executable, "-m", "hapticd.igtlink", "--help"], capture_output=True, text=True)
    assert result.returncode == 0
    for words in ("OpenIGTLinkIF", "PhantomProxy", "towards the", "default: 127.0.0.1:18944", "default: ras"):
        assert words in " ".join(result.stdout.split()), words
