"""Bridge between a haptics server and 3D Slicer, or another client of OpenIGTLink.

    python3 -m hapticd.igtlink --server Phantom@localhost --listen 127.0.0.1:18944

A client of hapticd on one side and a server of OpenIGTLink on the other: poses, force and buttons go out, models come in
and can be touched. docs/slicer.md has the messages and the frames.
"""

import argparse
import asyncio
import ipaddress
import os
import pathlib
import re
import signal
import sys
import time
from contextlib import suppress
from typing import Any, Dict, Final, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np
import numpy.typing as npt

from . import _openigtlink as igtl
from . import aio
from . import reports as r
from ._address import parse
from ._codec import shortened
from .errors import Error
from .scene import IDENTITY, Surface

__all__ = ["main"]

_READS: Final = ("TRANSFORM", "POLYDATA", "STRING", "GET_CAPABIL", "GET_STATUS")
_SILENTLY_IGNORED: Final = ("STATUS", "CAPABILITY")  # clients send them unasked
_MAX_CLIENTS: Final = 8
_MAX_MODELS: Final = 256
_MAX_MODEL_BYTES: Final = 512 << 20  # of all models together
_MAX_WAITING_BYTES: Final = 1 << 20  # that a client has not read
_MAX_PROBLEMS: Final = 50  # lines in the log for one client
_LONG_BYTES: Final = 64 << 10  # a longer body is decoded in a thread
_PROPERTIES: Final = Surface._fields[:5]  # without the mass

Matrix = npt.NDArray[np.float64]

#: From the frame of the device (x right, y up, z towards the user) to that of the clients.
_FRAMES: Final[Dict[str, Matrix]] = {
    "device": IDENTITY,
    # As a user sees the patient in Slicer's 3D view at its start, from the front: right is L, up is S, towards the user is A.
    "ras": np.array([[-1.0, 0, 0, 0], [0, 0, 1, 0], [0, 1, 0, 0], [0, 0, 0, 1]]),
}


class _Model(NamedTuple):
    number: int
    vertices: "npt.NDArray[Any]"
    triangles: "npt.NDArray[Any]"


class _Client:
    """One connection of an OpenIGTLink client."""

    def __init__(self, writer: asyncio.StreamWriter) -> None:
        host, port = (writer.get_extra_info("peername") or ("that left at once", 0))[:2]
        self.name: Final = f"client {host}:{port}"
        self.writer: Final = writer
        self.texts: Dict[str, str] = {}  # that it has received
        self._problems = 0

    def problem(self, text: str) -> None:
        """Logs a problem, as long as the client has not had too many."""
        self._problems += 1
        if self._problems <= _MAX_PROBLEMS:
            _log(f"{self.name}: {text}")
        if self._problems == _MAX_PROBLEMS:
            _log(f"{self.name}: further problems of this client are not logged")

    def send(self, data: bytes) -> None:
        transport = self.writer.transport
        if transport.is_closing():
            return
        if transport.get_write_buffer_size() > _MAX_WAITING_BYTES:
            _log(f"{self.name}: disconnected, because it does not read: {_MAX_WAITING_BYTES} bytes wait for it")
            transport.abort()
        else:
            self.writer.write(data)


class _Bridge:
    def __init__(self, hand: aio.Client, frame: Matrix, surface: Surface, first_object: int) -> None:
        self._hand = hand
        self._frame = frame
        self._surface = surface
        self._first_object = first_object
        self._prefix = hand.device.encode("ascii", "replace").decode("ascii")[:12]  # a name has at most 19 characters
        self._clients: List[_Client] = []
        # By the name of the model, whichever message comes first.
        self._models: Dict[str, _Model] = {}
        self._places: Dict[str, Matrix] = {}
        self._surfaces: Dict[str, Surface] = {}
        self._changed = asyncio.Event()
        self._stale: Dict[str, None] = {}  # names of the models that the server does not have, in order
        self._connections = hand.on_connection(self._on_connection)
        hand.on_text(lambda report: _log(f"server: {report.severity.name.lower()}: {report.text}") if report.severity else None)

    # --- the haptics server

    def _on_connection(self, report: r.ConnectionReport) -> None:
        _log(f"connected to {self._hand.server}" if report.connected else f"lost {self._hand.server}: {report.reason}")
        if report.connected:
            self._stale.update(dict.fromkeys(self._models))
            self._changed.set()

    async def upload_for_ever(self) -> None:
        """Uploads models that are new, and all after a connection, because a restarted server has none."""
        while True:
            await self._changed.wait()
            self._changed.clear()
            while self._stale:
                name = next(iter(self._stale))
                try:
                    await self._upload(name, self._models[name])
                except ConnectionError:
                    break  # until the next connection, after which all models are stale
                except (Error, ValueError) as error:
                    self._stale.pop(name, None)
                    _log(f"model {name!r} is not uploaded: {error}")

    async def _upload(self, name: str, model: _Model) -> None:
        async with self._hand.batch():
            del self._stale[name]  # from here on, what else arrives for this model follows its upload
            self._hand.set_object_count(model.number + 1)
            self._hand.set_object_name(model.number, name)
            self._hand.set_surface(model.number, self._surfaces.get(name, self._surface))
            self._hand.set_transform(model.number, self._placed(name))
            await self._hand.upload_mesh(model.number, model.vertices, model.triangles)
        _log(f"object {model.number} is {name!r}: {len(model.triangles)} triangles")

    def _placed(self, name: str) -> Matrix:
        return self._frame.T @ self._places.get(name, IDENTITY)

    def end(self) -> None:
        """Disconnects all clients, and takes their models out of the scene."""
        self._connections.end()
        for client in self._clients:
            client.writer.transport.abort()
        with suppress(Error):
            for model in self._models.values():
                self._hand.clear_mesh(model.number)

    # --- to the clients

    async def send_for_ever(self, rate_Hz: float) -> None:
        loop = asyncio.get_running_loop()
        due = loop.time()
        while True:
            due = max(due + 1 / rate_Hz, loop.time())
            await asyncio.sleep(due - loop.time())
            if self._clients:
                self._send_state()

    def _send_state(self) -> None:
        poses = b"".join(
            igtl.message("TRANSFORM", self._prefix + suffix, igtl.transform_content(self._frame @ _matrix(pose)), pose.time)
            for suffix, pose in (("Proxy", self._hand.latest.pose.get(0)), ("Hand", self._hand.latest.pose.get(1)))
            if pose is not None
        )
        texts = self._texts()
        for client in list(self._clients):
            changed = [(name, text) for name, text in texts.items() if client.texts.get(name) != text]
            client.texts.update(changed)
            now = time.time()
            client.send(poses + b"".join(igtl.message("STRING", name, igtl.string_content(text), now) for name, text in changed))

    def _texts(self) -> Dict[str, str]:
        if not self._hand.connected:
            return {}
        latest, capabilities = self._hand.latest, self._hand.capabilities
        force = np.round(self._frame[:3, :3] @ latest.force.force_N, 3) + 0.0  # no negative zero
        count = max([capabilities.buttons if capabilities else 0, *(button + 1 for button in latest.pressed)])
        buttons = " ".join("down" if latest.pressed.get(button) else "up" for button in range(count))
        return {self._prefix + "Force": "{:.3f} {:.3f} {:.3f}".format(*force), self._prefix + "Buttons": buttons or "none"}

    # --- from the clients

    async def attend(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Reads the messages of one client until it leaves."""
        client = _Client(writer)
        if len(self._clients) >= _MAX_CLIENTS:
            _log(f"{client.name}: refused, because {_MAX_CLIENTS} clients are connected")
            return writer.transport.abort()
        _log(f"{client.name}: connected")
        self._clients.append(client)
        try:
            while True:
                await self._read_message(client, reader)
        except igtl.StreamError as error:
            _log(f"{client.name}: disconnected, because its stream cannot be read on: {error}")
        except asyncio.IncompleteReadError as error:
            _log(f"{client.name}: disconnected" + (" in the middle of a message" if error.partial else ""))
        except OSError as error:
            _log(f"{client.name}: disconnected: {error}")
        finally:
            self._clients.remove(client)
            writer.transport.abort()

    async def _read_message(self, client: _Client, reader: asyncio.StreamReader) -> None:
        header = igtl.parse_header(await reader.readexactly(igtl.HEADER.size))
        what = f"{shortened(header.type)} {shortened(header.name)}"
        if header.size > igtl.MAX_BODY_BYTES:
            client.problem(f"{what} is left out: {header.size} bytes, at most {igtl.MAX_BODY_BYTES}; reduce the model")
            for begin in range(0, header.size, _LONG_BYTES):
                await reader.readexactly(min(_LONG_BYTES, header.size - begin))
            return
        body = await reader.readexactly(header.size)
        try:
            if header.size > _LONG_BYTES:
                value = await asyncio.get_running_loop().run_in_executor(None, _read, header, body)
            else:
                value = _read(header, body)
            self._apply(client, header, value)
        except ValueError as error:  # of the message, or of the command that it becomes
            client.problem(f"{what} is left out: {error}")

    def _apply(self, client: _Client, header: igtl.Header, value: Any) -> None:
        if header.type == "GET_CAPABIL":
            client.send(igtl.message("CAPABILITY", self._prefix, igtl.capability_content(_READS), time.time()))
        elif header.type == "GET_STATUS":
            problem = "" if self._hand.connected else f"no connection to {self._hand.server}"
            client.send(igtl.message("STATUS", self._prefix, igtl.status_content(problem), time.time()))
        elif header.type not in _READS:
            if header.type not in _SILENTLY_IGNORED:
                client.problem(f"a {shortened(header.type)} is ignored; this bridge reads {', '.join(_READS)}")
        elif not header.name:
            raise igtl.MessageError("it names no model")
        elif header.type == "POLYDATA":
            self._take_model(header.name, *value)
        elif header.type == "TRANSFORM":
            self._remember(self._places, header.name, value)
            if self._is_uploaded(header.name):
                self._hand.set_transform(self._models[header.name].number, self._placed(header.name))
        else:
            self._remember(self._surfaces, header.name, _surface(value, self._surfaces.get(header.name, self._surface)))
            if self._is_uploaded(header.name):
                self._hand.set_surface(self._models[header.name].number, self._surfaces[header.name])

    def _is_uploaded(self, name: str) -> bool:
        return self._hand.connected and name in self._models and name not in self._stale

    @staticmethod
    def _remember(table: Dict[str, Any], name: str, value: Any) -> None:
        if name not in table and len(table) >= _MAX_MODELS:
            raise igtl.MessageError(f"{_MAX_MODELS} names are known, which is the limit; end and start the bridge")
        table[name] = value

    def _take_model(self, name: str, vertices: "npt.NDArray[Any]", triangles: "npt.NDArray[Any]") -> None:
        others = sum(m.vertices.nbytes + m.triangles.nbytes for known, m in self._models.items() if known != name)
        if others + vertices.nbytes + triangles.nbytes > _MAX_MODEL_BYTES:
            raise igtl.MessageError(f"all models together have at most {_MAX_MODEL_BYTES} bytes; reduce them")
        known = self._models.get(name)
        number = known.number if known else self._first_object + len(self._models)
        self._remember(self._models, name, _Model(number, vertices, triangles))
        self._stale[name] = None
        self._changed.set()


def _read(header: igtl.Header, body: bytes) -> Any:
    """The value of a message. Raises igtl.MessageError."""
    content = igtl.content_of(header, body)
    readers = {"TRANSFORM": igtl.read_transform, "POLYDATA": igtl.read_polydata, "STRING": igtl.read_string}
    return readers[header.type](content) if header.type in readers else None


def _surface(text: str, surface: Surface) -> Surface:
    """The surface with some properties replaced, from "stiffness=0.8 damping=0.1". Raises igtl.MessageError."""
    for part in text.split():
        name, _, value = part.partition("=")
        if name not in _PROPERTIES:
            raise igtl.MessageError(f"a property {shortened(name)}; write NAME=NUMBER, with the names {', '.join(_PROPERTIES)}")
        try:
            surface = surface._replace(**{name: _fraction(value)})
        except argparse.ArgumentTypeError as error:
            raise igtl.MessageError(f"{name} is {error}") from error
    return surface


def _matrix(pose: r.PoseReport) -> Matrix:
    """A pose as a 4x4 matrix in millimetres."""
    x, y, z, w = pose.orientation / (np.linalg.norm(pose.orientation) or 1.0)
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, 3] = 1000 * pose.position_m
    return matrix


def _log(text: str) -> None:
    print("igtlink:", text, flush=True)


# --- the command


def _number(text: str, low: float, high: float) -> float:
    with suppress(ValueError):
        if low <= float(text) <= high:
            return float(text)
    raise argparse.ArgumentTypeError(f"{text!r}: give a number from {low:g} to {high:g}")


def _fraction(text: str) -> float:
    return _number(text, 0, 1)


def _rate(text: str) -> float:
    return _number(text, 1, 1000)


def _first_object(text: str) -> int:
    if not re.fullmatch(r"[0-9]{1,4}", text):
        raise argparse.ArgumentTypeError(f"{text!r}: give a whole number from 0 to 9999")
    return int(text)


def _listen(text: str) -> Tuple[str, int]:
    host, _, port = text.rpartition(":")
    if not host or not re.fullmatch(r"[0-9]{1,5}", port) or int(port) > 65535:
        raise argparse.ArgumentTypeError(f"{text!r}: give HOST:PORT, such as 127.0.0.1:18944")
    return host.strip("[]"), int(port)


def _server(text: str) -> str:
    try:
        parse(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return text


def _token(text: str) -> str:
    try:
        return pathlib.Path(text).read_text().strip()
    except (OSError, UnicodeError) as error:
        raise argparse.ArgumentTypeError(f"{text!r} cannot be read: {error}") from error


_EPILOG = """\
In 3D Slicer with the extension SlicerOpenIGTLink: module OpenIGTLinkIF, '+' for a new connector, Type Client, Hostname and
Port as in --listen, Active. The transforms PhantomProxy and PhantomHand appear. A model that Slicer sends can be touched; a
transform that it sends under the name of the model moves it; a text "stiffness=0.4 dynamic_friction=0.2" under that name
changes its surface. Lengths are millimetres.

Frames: with ras, the hand moves as the default 3D view shows it, which looks at the patient from the front: device right is
patient left (-R), up is S, towards the user is A. With device, coordinates are x right, y up, z towards the user.

example:
  hapticd serve                                      # in another terminal
  python3 -m hapticd.igtlink --stiffness 0.6         # then connect Slicer to localhost, port 18944
"""


def _arguments(argv: Optional[Sequence[str]]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python3 -m hapticd.igtlink",
        usage="%(prog)s [--server NAME@HOST] [--listen HOST:PORT] [OPTION...]",
        description="Connects 3D Slicer, or another OpenIGTLink client, to a haptic device.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--server", type=_server, default="Phantom@localhost", metavar="NAME@HOST", help="haptic device (default: %(default)s)")
    add("--listen", type=_listen, default="127.0.0.1:18944", metavar="HOST:PORT",
        help="where OpenIGTLink clients connect (default: %(default)s). They present no password: let in machines that you trust only")  # fmt: skip
    add("--rate", type=_rate, default=60.0, metavar="HZ", help="transforms per second (default: %(default)g)")
    add("--frame", choices=sorted(_FRAMES), default="ras", help="frame of the clients, see below (default: %(default)s)")
    add("--first-object", type=_first_object, default=0, metavar="NUMBER", help="object of the first model (default: %(default)s)")
    add("--token-file", type=_token, metavar="FILE", help="presents the token in the file to the haptics server")
    for name, default in zip(_PROPERTIES, Surface(stiffness=0.8)):
        add("--" + name.replace("_", "-"), type=_fraction, default=default, metavar="0..1",
            help=f"{name.replace('_', ' ')} of all models (default: %(default)g)")  # fmt: skip
    return parser.parse_args(argv)


async def _run(arguments: argparse.Namespace) -> None:
    tasks: "List[asyncio.Future[Any]]" = []
    stop = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        with suppress(NotImplementedError):  # Windows: Ctrl-C raises KeyboardInterrupt
            asyncio.get_running_loop().add_signal_handler(number, stop.set)
    async with aio.connect(arguments.server) as hand:
        if arguments.token_file is not None:
            hand.present_token(arguments.token_file)
        hand.set_update_rate(arguments.rate)
        surface = Surface(*(getattr(arguments, name) for name in _PROPERTIES))
        bridge = _Bridge(hand, _FRAMES[arguments.frame], surface, arguments.first_object)
        server = await asyncio.start_server(bridge.attend, *arguments.listen)
        try:
            host, port = server.sockets[0].getsockname()[:2]
            _log(f"listening on {host}:{port} for OpenIGTLink clients of {arguments.server}; Ctrl-C ends")
            if not ipaddress.ip_address(host).is_loopback:
                _log("warning: whoever reaches this port can change what the hand feels; let in machines that you trust only")
            running = (stop.wait(), bridge.send_for_ever(arguments.rate), bridge.upload_for_ever())
            tasks = [asyncio.ensure_future(one) for one in running]
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
        finally:
            for task in tasks:
                task.cancel()
            server.close()
            bridge.end()
    _log("ended")


def main(argv: Optional[Sequence[str]] = None) -> int:
    """Runs the bridge until Ctrl-C. Returns the exit status."""
    arguments = _arguments(argv)
    try:
        asyncio.run(_run(arguments))
    except KeyboardInterrupt:
        return 0
    except (Error, ValueError) as error:  # the latter for a token that is none
        print(f"igtlink: {error}", file=sys.stderr)
        return 1
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno and error.errno > 0 else error.strerror
        host, port = arguments.listen
        print(f"igtlink: cannot listen on {host}:{port}: {reason}; choose another address by --listen", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
