"""The client without sockets: what both faces share. A face moves bytes, keeps time and waits."""

import copy
import math
import os
import secrets
import time
import weakref
from collections import deque
from dataclasses import dataclass
from typing import Any, Callable, Deque, Dict, Final, Generic, List, NamedTuple, NoReturn, Optional, Sequence, Set, Tuple, TypeVar

import numpy as np
import numpy.typing as npt

from . import _messages as m
from . import reports as r
from ._address import Address
from ._codec import HEADER, DecodeError, Numbers, by_class, frame, has_length, is_number, padded, printable, real_array, shortened, utf8
from ._commands import Commands, flag, function, instance
from ._peer import Peer, now
from ._statistics import Statistics
from .errors import ConnectError, ConnectionLost, ServerError, Unsupported
from .scene import Capabilities, RemoteContact, Reports

HANDSHAKE_S: Final = 3.0
RETRY_S: Final = 0.25
PING_S: Final = 1.0
HEARTBEAT_S: Final = 0.1
#: How long a client that closes waits for the end of a server that has received everything.
END_S: Final = 1.0
#: How often it looks at what the server has not received yet.
END_CHECK_S: Final = 0.05
#: Bytes that accumulate before they are given to the system.
BATCH_BYTES: Final = 64 * 1024
#: A stop on the first connection waits behind no more than this; beyond it, it also takes a second connection.
STOP_BACKLOG_BYTES: Final = 64 * 1024
#: Why a connection ended, where the server ended it.
CLOSED_BY_SERVER: Final = "the server closed the connection"
MAX_COMMAND_BATCH_BYTES: Final = 256 * 1024 * 1024
#: Reports that may wait for dispatch; beyond it the client stops reading.
MAX_WAITING_BYTES: Final = 64 * 1024 * 1024

_NUMBERS = by_class(m.LAYOUTS)
_PONG = _NUMBERS[m.Pong][0]
_CAPABILITIES = _NUMBERS[m.Capabilities][0]

Report = TypeVar("Report")


@dataclass(frozen=True)
class Options:
    """Options of a client; times in seconds."""

    connect_timeout: float = 3.0  # how long connect() waits before it raises; 0: it does not wait
    reconnect: bool = True  # whether to reconnect, without limit, when a connection ends
    send_timeout: float = 10.0  # how long the server may accept no data while data waits
    queue_limit_bytes: int = 4 * 1024 * 1024  # that may wait to be sent; a command that would exceed them sleeps
    throw_on_error: bool = False  # poll() raises ServerError for a text of severity error, after the callbacks

    def __post_init__(self) -> None:
        for name in ("connect_timeout", "send_timeout", "queue_limit_bytes"):
            value = getattr(self, name)
            if not is_number(value) or value < 0:
                raise ValueError(f"{name} is {shortened(value)}: give a number of at least 0")
        for name in ("reconnect", "throw_on_error"):
            flag(getattr(self, name), name + " is ")


def options_of(options: Optional[Options], fields: Dict[str, Any]) -> Options:
    """The options that are given whole, or by the names of single ones. Raises ValueError."""
    if options is None:
        return Options(**fields)
    if fields:
        raise ValueError("give either options or single fields of it")
    return instance(options, Options)


class UploadProgress(NamedTuple):
    """Progress of an upload: bytes that the system has accepted, of all bytes of the mesh."""

    bytes_sent: int
    bytes_total: int


class Subscription(Generic[Report]):
    """One callback of a client. It stays for the life of the client unless end() is called; as a context manager
    it ends with the block."""

    def __init__(self, callbacks: "List[Subscription[Any]]", callback: Callable[[Report], object]) -> None:
        self._callbacks = callbacks
        self._callback = callback
        self.active = True
        callbacks.append(self)

    def end(self) -> None:
        """Ends the callback; does nothing when it has ended before."""
        if self.active:
            self.active = False
            self._callbacks.remove(self)

    def __enter__(self) -> "Subscription[Report]":
        return self

    def __exit__(self, *_: object) -> None:
        self.end()


class Ending:
    """How long a client that closes waits for the server; times in seconds, `longest` in any case."""

    def __init__(self, send_timeout: float, longest: float) -> None:
        self._send_timeout = send_timeout
        self._end = time.monotonic() + longest
        self._left = -1
        self._progress = 0.0

    def is_over(self, left: int) -> bool:
        """Whether the wait is over, with so many bytes that the server has not received."""
        at = time.monotonic()
        if left != self._left:
            self._left, self._progress = left, at
        return at > self._end or at - self._progress > (self._send_timeout if left else END_S)


Arrival = Tuple[int, int, int, float, bytes]  # kind, seconds, microseconds, time of arrival, payload
_CONNECTED: Final = -2
_LOST: Final = -3

_array = np.array


def _object_number(value: float) -> int:
    """The wire has object numbers as floats; -1 stands for everything that is no object number."""
    return int(value) if 0 <= value <= 2147483647 else -1


def _contacts(t: float, c: m.ContactList) -> r.ContactsReport:
    n = _array(c.contacts[: len(c.contacts) // 10 * 10], dtype=np.float64).reshape(-1, 10)
    contacts = [r.Contact(_object_number(row[0]), row[1:4], row[4:7], row[7:10]) for row in n]
    return r.ContactsReport(t, c.tick, c.time, contacts)


def _hand(t: float, h: m.HandState) -> r.HandReport:
    n = _array(h.contacts[: len(h.contacts) // 8 * 8], dtype=np.float64).reshape(-1, 8)
    if not np.isfinite(n[:, 0]).all():
        raise DecodeError("a contact whose number is none")
    contacts = [r.RemoteContactForce(int(row[0]), row[1:4], row[4:7], float(row[7])) for row in n]
    return r.HandReport(
        t, h.tick, h.time, h.contacts_time, h.force_time, _array(h.position), _array(h.orientation),
        _array(h.velocity), _array(h.angular_velocity), _array(h.force), _array(h.held_force), h.energy,
        h.gripper if h.flags & m.HAND_HAS_GRIPPER else float("nan"), h.buttons, h.flags & m.HAND_ENERGY_SPENT != 0,
        h.flags & m.HAND_CORRECTIONS_HELD != 0, r.Trips(h.guard_active), contacts,
    )  # fmt: skip


# From a message to a report, by message class. Arrays are built here, once, so that the codec stays independent.
_CONVERT: Final[Dict[Any, Tuple[str, Callable[[float, Any], Any]]]] = {
    m.TrackerPosQuat: ("pose", lambda t, x: r.PoseReport(t, x.sensor, _array(x.position), _array(x.orientation))),
    m.TrackerVelocity: (
        "velocity",
        lambda t, x: r.VelocityReport(t, x.sensor, _array(x.velocity), _array(x.rotation), x.interval),
    ),
    m.TrackerAcceleration: (
        "acceleration",
        lambda t, x: r.AccelerationReport(t, x.sensor, _array(x.acceleration), _array(x.rotation), x.interval),
    ),
    m.ButtonChange: ("button", lambda t, x: r.ButtonReport(t, x.button, x.state != 0)),
    m.AnalogChannels: ("analog", lambda t, x: r.AnalogReport(t, _array(x.channels, dtype=np.float64))),
    m.Force: ("force", lambda t, x: r.ForceReport(t, _array(x.force))),
    m.Dop: ("depth", lambda t, x: r.DepthReport(t, x.depth)),
    m.Scp: ("contact_point", lambda t, x: r.ContactPointReport(t, _array(x.position), _array(x.orientation))),
    m.IsTouching: ("touching", lambda t, x: r.TouchingReport(t, x.touching != 0)),
    m.TouchedObject: ("touched_object", lambda t, x: r.TouchedObjectReport(t, x.object)),
    m.Angle: ("angle", lambda t, x: r.AngleReport(t, x.angle, x.touching != 0)),
    m.ForceError: ("force_error", lambda t, x: r.ForceErrorReport(t, x.code)),
    m.Text: ("text", lambda t, x: r.TextReport(t, r.Severity(min(x.severity, 2)), printable(x.text), x.level)),
    m.TrackerToRoom: ("to_room", lambda t, x: r.ToRoomReport(t, _array(x.position), _array(x.orientation))),
    m.TrackerUnitToSensor: (
        "unit_to_sensor",
        lambda t, x: r.UnitToSensorReport(t, x.sensor, _array(x.position), _array(x.orientation)),
    ),
    m.TrackerWorkspace: ("workspace", lambda t, x: r.WorkspaceReport(t, _array(x.min), _array(x.max))),
    m.TickReport: (
        "tick",
        lambda t, x: r.TickReport(
            t, x.tick, x.time, x.revision, _array(x.hand), _array(x.proxy), _array(x.velocity),
            _array(x.orientation), _array(x.force), x.depth, x.object, x.buttons, r.Trips(x.guard_active),
            r.Trips(x.guard_latched),
        ),
    ),
    m.ContactList: ("contacts", _contacts),
    m.HandState: ("hand", _hand),
    m.GuardState: (
        "guard",
        lambda t, x: r.GuardReport(t, r.Trips(x.active), r.Trips(x.latched), x.armed != 0, x.stopped != 0),
    ),
}  # fmt: skip
_LATEST: Final = frozenset(
    ("hand", "analog", "force", "depth", "contact_point", "touching", "touched_object", "angle", "tick", "contacts", "guard")
)
_BY_KIND: Final = {_NUMBERS[cls][0]: (_NUMBERS[cls][1].decode, *entry) for cls, entry in _CONVERT.items()}
_STATES: Final = _NUMBERS[m.ButtonStates][0]
_TEXT: Final = _NUMBERS[m.Text][0]

_SET_VERTEX_ROW = np.dtype(
    [("header", ">u4", 6), ("object", ">i4"), ("vertex", ">i4"), ("position", ">f4", 3), ("padding", "V4")]
)


def as_vertices(vertices: "npt.ArrayLike") -> "npt.NDArray[Any]":
    """(n, 3) positions in wire order. Raises ValueError for another shape, and for what is no number."""
    array = real_array(vertices, "vertices", "(n, 3) numbers")
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"vertices of shape {array.shape}: give (n, 3)")
    with np.errstate(over="ignore", invalid="ignore"):
        rows = np.ascontiguousarray(array, dtype=np.float32)
    finite = np.isfinite(rows)
    if not finite.all():
        wrong = int(np.argmin(finite.all(axis=1)))
        raise ValueError(
            f"vertex {wrong} is {shortened(array[wrong].tolist())}: give finite numbers, at most 3.4e38, or leave it out with its "
            "triangles"
        )
    return rows.astype(">f4")


def as_corners(corners: "npt.ArrayLike") -> "npt.NDArray[Any]":
    """(n, 3) positions in wire order, three for each triangle. Raises ValueError for another shape."""
    array = as_vertices(corners)
    if len(array) % 3:
        raise ValueError(f"corners of shape {array.shape}: give three rows for each triangle")
    return array


def as_triangles(triangles: "npt.ArrayLike", vertices: int) -> "npt.NDArray[Any]":
    """(m, 3) vertex numbers in wire order. Raises ValueError for another shape, or a vertex that is not there."""
    given = real_array(triangles, "triangles", "(m, 3) integers")
    if given.ndim != 2 or given.shape[1] != 3 or not (given.dtype.kind in "iu" or given.size == 0):
        raise ValueError(f"triangles of shape {given.shape} and type {given.dtype}: give (m, 3) integers")
    if given.size and (given.min() < 0 or given.max() >= vertices):
        wrong = np.argwhere((given < 0) | (given >= vertices))[0]
        raise ValueError(f"triangle {wrong[0]} names vertex {given[tuple(wrong)]}, the mesh has {vertices}")
    return np.ascontiguousarray(given, dtype=">i4")


#: Members of a contact in the order of the wire.
_CONTACT: Final = (
    ("id", 1), ("shape", 1), ("radius_m", 1), ("point_m", 3), ("normal", 3), ("axis", 3), ("velocity_m_per_s", 3),
    ("angular_velocity_rad_per_s", 3), ("stiffness_N_per_m", 1), ("damping_Ns_per_m", 1), ("static_friction", 1),
    ("dynamic_friction", 1), ("lifetime_s", 1), ("yields", 1),
)  # fmt: skip


def _contact_numbers(number: int, contact: RemoteContact) -> List[float]:
    """Raises ValueError for a vector that does not have three numbers, and for what is no finite number."""
    instance(contact, RemoteContact)
    numbers: List[float] = []
    for name, count in _CONTACT:
        value = getattr(contact, name)
        try:
            parts = (value,) if count == 1 else (*value,)
            if len(parts) != count or not all(map(math.isfinite, parts)):
                raise ValueError
        except (TypeError, ValueError, OverflowError) as error:
            expected = "a finite number" if count == 1 else "three finite numbers"
            raise ValueError(f"remote contact {number}: {name} is {shortened(value)}, expected {expected}") from error
        numbers += parts
    return numbers


def duration(seconds: float) -> float:
    """A time in seconds. Raises ValueError for what is no number, which no time would end. A negative one is over at
    once: a loop with a clock of its own has one when it is late."""
    if not is_number(seconds):
        raise ValueError(f"{shortened(seconds)}: give a time in seconds")
    return float(seconds)


#: The clients of this process.
_CLIENTS: "weakref.WeakSet[Core]" = weakref.WeakSet()


def _forked() -> None:
    """A forked process has copies of the sockets. They would keep a connection, and its forces, beyond the end of the
    process that made it, and two programs would write into one stream."""
    for client in tuple(_CLIENTS):
        if not client._finished:
            client._over = "belongs to the process that made it: connect after the fork"
            client._leave_to_parent()
            client._finished = True
            client._closed(client._over)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forked)


class Core(Commands):
    """Commands in, bytes out; bytes in, callbacks and latest reports out."""

    _ELSEWHERE = ""  # what a call from another place is told

    def __init__(self, address: Address, options: Options) -> None:
        self._options = options
        #: NAME of the device.
        self.device: Final = address.device
        #: HOST:PORT of the server.
        self.server: Final = address.server
        #: The newest report of each kind; changes while the client polls.
        self.latest = r.LatestReports()
        self._held_at_loss: Set[int] = set()  # buttons that were down when a connection ended; until the next states
        self._address = address
        self._peer: Optional[Peer] = None
        self._backlog: List[bytes] = []  # commands before the first connection
        self._backlog_bytes = 0
        self._held: Optional[List[bytes]] = None  # commands of a batch
        self._held_bytes = 0
        self._inbox: Deque[Arrival] = deque()
        self._inbox_bytes = 0
        self._arrived = 0.0
        self._offer: Optional[m.Capabilities] = None  # by the server of this connection
        self._answered = False  # the server has answered, or does not know the question
        self._heard = False
        self._pings = self._pongs = 0  # of this connection
        self._server_devices: List[str] = []
        self._subscription: Optional[m.Subscribe] = None
        self._update_rate: Optional[float] = None  # asked for after the subscription
        self._token = ""
        self._key = secrets.randbits(63) | 1  # by which the server knows the connections of this client
        self._heartbeats = False
        self._callbacks: Dict[str, List[Subscription[Any]]] = {kind: [] for kind in (*r.KINDS, "connection")}
        self._first_error = ""
        self._last_failure = ""
        self._dispatching = False
        self._finished = False  # close() was called
        self._over = "is closed"
        self._udp_target: Optional[Tuple[str, int]] = None
        self._counts = Statistics()
        self._connections_reported = 0
        self._ping_at = 0.0
        self._heartbeat_at = 0.0
        self._handshake_at = 0.0
        _CLIENTS.add(self)

    # --- the face moves bytes

    def _leave_to_parent(self) -> None:
        """In a forked process: closes its copies of the sockets, and sends nothing."""

    def _opened(self, udp: Optional[Tuple[str, int]]) -> None:
        """The TCP connection is up."""
        # Weakly, so that a client without a name ends at once: the server then ends its forces.
        self._peer = Peer(weakref.proxy(self), [self.device], udp)
        self._handshake_at = time.monotonic() + HANDSHAKE_S

    def _received(self, data: bytes) -> None:
        """Raises ProtocolError."""
        assert self._peer is not None
        self._counts.tcp_bytes_in += len(data)
        self._arrived = time.time()
        self._peer.feed(data)

    def _received_datagram(self, data: bytes) -> None:
        self._counts.udp_bytes_in += len(data)
        self._arrived = time.time()
        if self._peer is not None and self._inbox_bytes <= MAX_WAITING_BYTES:
            self._peer.feed_datagram(data)

    def _closed(self, reason: str) -> None:
        """The connection is gone; the reason must not be empty."""
        was_connected = self.connected
        self._last_failure = reason
        ended = reason == CLOSED_BY_SERVER or "reset by peer" in reason
        if ended and self._peer is not None and not was_connected:
            self._last_failure += (
                " before it answered; a server that asks for TLS needs 'hapticd tunnel',"
                " and a tunnel prints why it reaches no server"
            )
        self._peer = None
        self._udp_target = None
        self._heard = self._answered = False
        self._offer = None
        self._server_devices = []
        if was_connected:
            self._inbox.append((_LOST, 0, 0, time.time(), reason.encode()))

    def _run_timers(self) -> float:
        """Sends what is due, and returns the time (monotonic) of the next turn."""
        at = time.monotonic()
        peer = self._peer
        if peer is None:
            return at + PING_S
        if not peer.connected:
            return self._handshake_at
        following = at + PING_S
        if not self._heard:
            if at >= self._ping_at:
                self._ping_at = at + PING_S
                self._ping()
            following = min(following, self._ping_at)
        if self._heartbeats:
            if at >= self._heartbeat_at:
                self._heartbeat_at = at + HEARTBEAT_S
                self._put_now(m.Heartbeat(1))
            following = min(following, self._heartbeat_at)
        return following

    def _ping(self) -> None:
        if self._put_now(m.Ping()):
            self._pings += 1

    @property
    def _all_pongs(self) -> bool:
        """Servers answer in order: everything before the last ping has been handled."""
        return self._pongs >= self._pings > 0

    def _handshake_expired(self) -> bool:
        return self._peer is not None and not self._peer.connected and time.monotonic() >= self._handshake_at

    # --- the peer reports

    def _peer_connected(self) -> None:
        """Servers answer in order. The question for the capabilities precedes the ping, so a pong without
        capabilities before it means that the server does not know the question."""
        assert self._peer is not None
        self._counts.connections += 1
        self._pings = self._pongs = 0
        self._put_now(m.QueryCapabilities())
        if self._token:
            self._put_now(self._identity())
        if self._subscription is not None:
            self._put_now(self._subscription)
        if self._update_rate is not None:
            self._put_now(m.TrackerSetUpdateRate(self._update_rate))
        if self._heartbeats:
            self._put_now(m.Heartbeat(1))
        self._peer.stream.extend(self._backlog)
        self._peer.stream_bytes += self._backlog_bytes
        self._backlog, self._backlog_bytes = [], 0
        self._inbox.append((_CONNECTED, 0, 0, time.time(), b""))
        self._ping()  # also when a report arrives first: its pong answers the question for the capabilities
        self._ping_at = time.monotonic() + PING_S

    def _peer_described(self, sender: str) -> None:
        # Stock servers describe our own name back to us; that is no evidence of a device.
        if sender not in (self.device, "VRPN Control"):
            self._server_devices.append(sender)

    def _peer_listens(self, host: str, port: int) -> None:
        parts = host.split(".")
        if len(parts) == 4 and all(p.isdigit() and int(p) < 256 for p in parts) and 1 <= port <= 65535:
            self._udp_target = (host, port)
            assert self._peer is not None
            self._peer.use_datagrams = True

    def _peer_message(self, kind: int, sender: str, seconds: int, microseconds: int, payload: bytes) -> None:
        self._counts.messages_in += 1
        if sender != self.device:
            return
        self._heard = True
        if kind == _PONG:
            self._answered = True
            self._pongs += 1
        elif kind == _CAPABILITIES:
            try:
                self._offer = m.LAYOUTS[_CAPABILITIES].decode(payload)
                self._answered = True
            except DecodeError:
                self._counts.messages_damaged += 1
        else:
            self._inbox.append((kind, seconds, microseconds, self._arrived, payload))
            self._inbox_bytes += len(payload)

    # --- from arrivals to reports

    def _dispatch(self) -> int:
        """Runs the callbacks for everything that waits. An exception of a callback leaves; the rest waits on, and so does
        what a poll() in a callback brings: each might bring more."""
        if self._dispatching:
            return 0
        self._dispatching = True
        count = 0
        inbox = self._inbox
        try:
            for _ in range(len(inbox)):
                arrival = inbox.popleft()
                self._inbox_bytes -= len(arrival[4])
                count += 1
                self._handle(arrival)
        finally:
            self._dispatching = False
        return count

    def _handle(self, arrival: Arrival) -> None:
        kind, seconds, microseconds, arrived, payload = arrival
        entry = _BY_KIND.get(kind)
        stamp = seconds + microseconds * 1e-6
        if entry is not None:
            decode, name, convert = entry
            try:
                message = decode(payload)
                report = convert(stamp, message)
            except DecodeError:
                self._counts.messages_damaged += 1
                return
            if kind == _TEXT and message.severity >= 2 and not self._first_error:
                self._first_error = report.text
            self._deliver(name, report, arrived - stamp)
        elif kind == _STATES:
            self._handle_states(payload, stamp, arrived)
        elif kind in (_CONNECTED, _LOST):
            if kind == _LOST:
                self._held_at_loss.update(button for button, pressed in self.latest.pressed.items() if pressed)
                self.latest = r.LatestReports()
            else:
                self._connections_reported += 1
            self._call("connection", r.ConnectionReport(arrived, kind == _CONNECTED, payload.decode()))

    def _handle_states(self, payload: bytes, stamp: float, arrived: float) -> None:
        """Servers resend all button states periodically; report changes only, and once what a person let go while
        there was no connection."""
        try:
            states = m.LAYOUTS[_STATES].decode(payload).states
        except DecodeError:
            self._counts.messages_damaged += 1
            return
        for button in sorted(self._held_at_loss):
            if button >= len(states) or states[button] == 0:
                self._deliver("button", r.ButtonReport(stamp, button, False), arrived - stamp)
        for button, state in enumerate(states):
            if self.latest.pressed.get(button, False) != (state != 0):
                self._deliver("button", r.ButtonReport(stamp, button, state != 0), arrived - stamp)

    def _deliver(self, name: str, report: Any, latency: float) -> None:
        counts = self._counts.reports[name]
        counts.count += 1
        counts.latency.add(latency)
        if name in _LATEST:
            setattr(self.latest, name, report)
        elif name == "pose":
            self.latest.pose[report.sensor] = report
        elif name == "velocity":
            self.latest.velocity[report.sensor] = report
        elif name == "button":
            self._held_at_loss.discard(report.button)
            self.latest.pressed[report.button] = report.pressed
        self._call(name, report)

    def _call(self, name: str, report: Any) -> None:
        """One that raises does not keep the report from the others. Raises what the first one raised."""
        failure: Optional[Exception] = None
        for subscription in tuple(self._callbacks[name]):
            if subscription.active:
                try:
                    subscription._callback(report)
                except Exception as error:
                    failure = failure or error
        if failure is not None:
            raise failure

    def _raise_first_error(self) -> None:
        if self._options.throw_on_error and self._first_error:
            text, self._first_error = self._first_error, ""
            raise ServerError(f"{self.device}@{self.server}: {text}")

    # --- sending

    def _frame(self, message: Any) -> bytes:
        number, layout = _NUMBERS[type(message)]
        return frame(*now(), 0, number, layout.encode(message, finite=True))

    def _send(self, message: Any, fast: bool = False) -> None:
        if fast and self._held is None and self.connected:
            self._check_place()
            assert self._peer is not None
            one = self._frame(message)
            self._peer.send_fast(one)
            self._counts.messages_out += 1
            self._collected(len(one))
        else:
            self._send_all(message)

    def _send_all(self, *messages: Any) -> None:
        self._send_frames([self._frame(message) for message in messages], len(messages))

    def _send_frames(self, frames: List[bytes], messages: int) -> None:
        """Whole frames of commands, in this order: into the batch, to the peer, or kept for the first connection;
        dropped and counted while a later connection is lost. Raises ConnectionLost after close()."""
        self._check_open()
        size = sum(map(len, frames))
        if self._held is not None:
            self._held.extend(frames)
            self._held_bytes += size
            self._counts.messages_out += messages
            return
        if self.connected:
            assert self._peer is not None
            self._peer.stream.extend(frames)
            self._peer.stream_bytes += size
        elif self._counts.connections == 0:
            if self._backlog_bytes + size > max(self._options.queue_limit_bytes, BATCH_BYTES):
                raise ConnectError(f"{self._why_not_connected()}; {self._backlog_bytes + size} bytes wait to be sent")
            self._backlog.extend(frames)
            self._backlog_bytes += size
        else:
            self._counts.messages_dropped += messages
            return
        self._counts.messages_out += messages
        self._collected(size)

    def _collected(self, size: int) -> None:
        """Called with each command that was collected; a face may send, and sleep."""

    def _put_now(self, message: Any) -> bool:
        """Appends a message ahead of a batch that is held; false without a connection. The face sends it. Raises
        ConnectionLost after close()."""
        self._check_open()
        if not self.connected:
            self._counts.messages_dropped += 1
            return False
        assert self._peer is not None
        self._peer.send_frames(self._frame(message))
        self._counts.messages_out += 1
        return True

    def _is_used_elsewhere(self) -> bool:
        """Whether this call comes from another place than the one that uses the client at present."""
        raise NotImplementedError

    def _check_place(self) -> None:
        """Raises RuntimeError for a call that would mix its bytes with those of another thread."""
        if self._is_used_elsewhere():
            raise RuntimeError(f"this client of {self.device}@{self.server} {self._ELSEWHERE}")

    def __reduce_ex__(self, _: Any) -> NoReturn:
        """A copy would close the sockets of the first when it ends."""
        raise TypeError(f"a client of {self.device}@{self.server} cannot be copied or pickled: connect where it is used")

    @property
    def connected(self) -> bool:
        """Whether commands reach a server, as far as the client knows: it sees the end of a connection when it receives
        or sends. False after close()."""
        return self._peer is not None and self._peer.connected

    def _check_open(self) -> None:
        """Raises ConnectionLost after close(), and RuntimeError while another thread uses the client."""
        if self._finished:
            raise ConnectionLost(f"this client of {self.device}@{self.server} {self._over}")
        self._check_place()

    def _check_renewed(self) -> None:
        """Raises ConnectionLost when the connection has ended and no other will follow."""
        if not self.connected and self._counts.connections and not self._options.reconnect:
            raise ConnectionLost(f"connection to {self.server} lost: {self._why_not_connected()}")

    def _check_kept(self, connection: int) -> None:
        """After waiting for the system to accept everything: raises ConnectionLost without the connection of this number."""
        if not self._counts.connections:
            raise ConnectionLost(f"nothing is sent yet: {self._why_not_connected()}")
        if not self.connected or self._counts.connections != connection:
            raise ConnectionLost(f"connection to {self.server} lost while sending: {self._last_failure}")

    def _not_acknowledged(self) -> str:
        return f"{self.server} acknowledged nothing for {self._options.send_timeout:g} s"

    def _why_not_connected(self) -> str:
        server, failure = self.server, self._last_failure
        if "refused" in failure.lower():
            return (
                f"nothing listens on {server} ({failure}): start `hapticd serve` there, or correct host and port"
            )
        if not failure and not self._address.tcp_only:
            return (
                f"no server at {server} answers the UDP request: start `hapticd serve` there, correct host and port, "
                f"or, if a firewall blocks the connection from the server, connect to NAME@tcp://{server}"
            )
        return f"no VRPN server at {server}: {failure or 'no answer'}"

    def _no_device(self) -> str:
        others = ", ".join(map(printable, self._server_devices))
        # A server that hangs after its greeting has named nothing either.
        has = f"it has {others}" if others else "it has named none: it has no device, or it hangs"
        return f"no device '{self.device}' answers at {self.server}; {has}"

    def statistics(self) -> Statistics:
        """Counts since the client was constructed: a copy."""
        result = copy.deepcopy(self._counts)
        result.taken = time.monotonic()
        return result

    # --- features

    def _has(self, feature: int) -> bool:
        return self._offer is not None and self._offer.features & feature != 0

    def _require_now(self, feature: int, what: str) -> None:
        """After waiting for the answer: raises unless the device has the feature."""
        if not self._answered:
            if not self.connected:
                raise ConnectionLost(f"connection to {self.server} lost: {self._why_not_connected()}")
            raise ConnectError(
                f"device '{self.device}' at {self.server} did not answer the question for its capabilities"
            )
        self._refuse_other_makes(what)
        if not self._has(feature):
            raise Unsupported(f"cannot {what}: device '{self.device}' at {self.server} does not support it")

    def _refuse_other_makes(self, what: str) -> None:
        """Raises when the server has answered, and has no extensions. Does not wait."""
        if self._answered and self._offer is None:
            raise Unsupported(f"cannot {what}: {self.server} is a VRPN server without the extensions of hapticd")

    @property
    def capabilities(self) -> Optional[Capabilities]:
        """What the server and its device support; the client asks on every connection. None without a connection,
        before the answer, and for servers of other makes. Does not wait."""
        c = self._offer
        if c is None or not self.connected:
            return None
        features = (
            m.FEATURE_BULK_MESH, m.FEATURE_BATCH, m.FEATURE_SUBSCRIBE, m.FEATURE_STOP, m.FEATURE_HEARTBEAT,
            m.FEATURE_HOLD_HAND,
        )  # fmt: skip
        flags = [self._has(feature) for feature in features]
        box = tuple(c.workspace)
        return Capabilities(
            c.version, *flags, c.servo_rate, c.report_rate, c.peak_force, c.buttons, box[:3], box[3:],  # type: ignore
            remote_contacts=self._has(m.FEATURE_REMOTE_CONTACTS),
        )

    def _identity(self) -> m.Identify:
        return m.Identify(self._token, self._key)

    def _put_key(self) -> None:
        """Before a stop or a re-arm, so that the server knows this client again on its other connections, and on its next one. A
        token has told the key already."""
        if not self._token and self.connected:
            self._put_now(self._identity())

    # What is sent again on every connection is encoded before it is kept: a value that its message cannot carry raises
    # here, and not on the next connection.

    def _set_token(self, token: str) -> None:
        if not isinstance(token, str):
            raise ValueError(f"present_token(): {shortened(token)}: give a text")
        if token and not 16 <= len(utf8(token, "a token")) <= 128:
            raise ValueError(f"present_token(): {len(token.encode())} characters; a token has 16 to 128")
        self._check_open()
        self._frame(m.Identify(token, self._key))
        self._token = token
        if self.connected and token:
            self._put_now(self._identity())

    def _set_subscription(self, kinds: Reports, rate_Hz: float) -> None:
        self._check_open()
        subscription = m.Subscribe(kinds, rate_Hz)
        self._frame(subscription)
        self._subscription = subscription
        if rate_Hz > 0:
            self._update_rate = None
        if self.connected:
            self._put_now(subscription)

    def set_update_rate(self, rate_Hz: float) -> None:
        """Sets the report rate of this client, also for every new connection."""
        self._check_open()
        self._check_rate(rate_Hz)
        if self.connected:
            super().set_update_rate(rate_Hz)
        self._update_rate = rate_Hz

    @staticmethod
    def _check_rate(rate_Hz: float) -> None:
        if not is_number(rate_Hz) or not 0 <= rate_Hz < float("inf"):
            raise ValueError(f"a report rate of {shortened(rate_Hz)} Hz: give 0 (as it is) or more")

    def _set_heartbeats(self, enable: bool) -> None:
        self._check_open()
        self._heartbeats = bool(flag(enable))
        if self.connected:
            self._heartbeat_at = time.monotonic() + HEARTBEAT_S
            self._put_now(m.Heartbeat(int(self._heartbeats)))

    # --- streamed state

    def _put_contacts(self, contacts: Sequence[RemoteContact]) -> None:
        if not has_length(contacts):
            raise ValueError(f"{shortened(contacts)}: give a list of hapticd.RemoteContact")
        if len(contacts) > 16:
            raise ValueError(f"{len(contacts)} remote contacts: give the 16 nearest to the hand")
        numbers = [one for number, contact in enumerate(contacts) for one in _contact_numbers(number, contact)]
        of_this_server = self._connections_reported == self._counts.connections
        state_time_ns = self.latest.hand.tick_time_ns if of_this_server else 0
        self._put_now(m.RemoteContacts(time.monotonic_ns(), state_time_ns, numbers))

    def _put_force(self, force_N: Numbers, torque_Nm: Numbers, lifetime_s: float) -> None:
        self._put_now(m.HeldForce(time.monotonic_ns(), force_N, torque_Nm, lifetime_s))

    # --- batches and meshes

    def _begin_batch(self) -> None:
        if self._held is not None:
            raise RuntimeError("batch() inside batch(): batches do not nest")
        self._held, self._held_bytes = [], 0

    def _end_batch(self, connection: int, send: bool) -> None:
        """Sends what is held as one batch, or drops it."""
        frames, size = self._held or [], self._held_bytes
        self._held, self._held_bytes = None, 0
        if not send:
            return
        if not self.connected or self._counts.connections != connection:
            raise ConnectionLost(
                f"connection to {self.server} lost before a batch was complete; nothing of it was sent"
            )
        if size > MAX_COMMAND_BATCH_BYTES:
            raise ValueError(f"a batch of {size} bytes, at most {MAX_COMMAND_BATCH_BYTES}: send it in several")
        self._send_frames([self._frame(m.BatchBegin()), *frames, self._frame(m.BatchCommit())], 2)

    def _run_frames(self, cls: Any, object: int, first: int, rows: "npt.NDArray[Any]") -> List[bytes]:
        """Frames of MeshVertices or MeshTriangles; the rows are in wire order."""
        number, layout = _NUMBERS[cls]
        seconds, microseconds = now()
        data = memoryview(rows.reshape(-1).view(np.uint8))  # type: ignore[arg-type]
        frames = []
        for at in range(0, len(rows), m.MOST_IN_ONE_MESSAGE):
            count = min(m.MOST_IN_ONE_MESSAGE, len(rows) - at)
            head = layout.encode(cls(object, first + at, ()))[:-4] + (3 * count).to_bytes(4, "big")
            size = HEADER.size + len(head) + 12 * count
            header = HEADER.pack(size, seconds, microseconds, 0, number, 0)
            frames.append(b"".join((header, head, data[12 * at : 12 * (at + count)], bytes(padded(size) - size))))
        return frames

    def _vertex_frames(self, object: int, first: int, rows: "npt.NDArray[Any]") -> bytes:
        """Frames of set_vertex for all rows, made at once."""
        table = np.zeros(len(rows), dtype=_SET_VERTEX_ROW)
        number, layout = _NUMBERS[m.SetVertex]
        table["header"] = (HEADER.size + layout.payload_bytes, *now(), 0, number, 0)
        table["object"] = object
        table["vertex"] = np.arange(first, first + len(rows))
        table["position"] = rows
        return table.tobytes()

    def _mesh_frames(
        self, object: int, vertices: "npt.NDArray[Any]", triangles: "Optional[npt.NDArray[Any]]"
    ) -> Tuple[List[bytes], int]:
        """Frames and number of messages of a mesh: thousands of vertices per message where the server supports it,
        else one by one, after a message that removes the present mesh. Without triangles, consecutive triples of
        vertices are triangles."""
        clear = [self._frame(m.ClearTrimesh(object))]
        if triangles is not None and not len(triangles):
            return clear, 1  # servers take vertices without triangles for a list of corners
        if self._has(m.FEATURE_BULK_MESH):
            frames = clear + self._run_frames(m.MeshVertices, object, 0, vertices)
            if triangles is not None:
                frames += self._run_frames(m.MeshTriangles, object, 0, triangles)
            return frames, len(frames)
        corners = vertices if triangles is None else vertices[triangles.astype(np.int64).ravel()]
        return [*clear, self._vertex_frames(object, 0, corners)], 1 + len(corners)

    def _batched(self, frames: List[bytes]) -> List[bytes]:
        """The frames of an upload as a batch if it fits, so that no tick renders half a mesh."""
        fits = sum(map(len, frames)) <= MAX_COMMAND_BATCH_BYTES
        if self._held is not None or not fits or not self._has(m.FEATURE_BATCH):
            return frames
        return [self._frame(m.BatchBegin()), *frames, self._frame(m.BatchCommit())]

    def set_vertices(self, object: int, first: int, positions: "npt.ArrayLike") -> None:
        """Sets vertices from number `first` on, for meshes that deform: (n, 3), object units, object frame."""
        rows = as_vertices(positions)
        self._frame(m.SetVertex(object, first))  # raises for a wrong number
        if self._has(m.FEATURE_BULK_MESH):
            frames = self._run_frames(m.MeshVertices, object, first, rows)
            self._send_frames(frames, len(frames))
        elif len(rows):
            self._send_frames([self._vertex_frames(object, first, rows)], len(rows))

    # --- callbacks

    def _on(self, kind: str, callback: Callable[[Report], object]) -> "Subscription[Report]":
        return Subscription(self._callbacks[kind], function(callback, "a function that takes one report"))

    def on(self, kind: str, callback: Callable[[Any], object]) -> "Subscription[Any]":
        """Adds a callback for a kind of reports by its name, as in hapticd.reports.KINDS, or "connection"."""
        if not isinstance(kind, str) or kind not in self._callbacks:
            raise ValueError(f"no reports of kind {shortened(kind)}; there are {', '.join(self._callbacks)}")
        return self._on(kind, callback)

    def on_pose(self, callback: Callable[[r.PoseReport], object]) -> "Subscription[r.PoseReport]":
        """Adds a callback for each PoseReport."""
        return self._on("pose", callback)

    def on_velocity(self, callback: Callable[[r.VelocityReport], object]) -> "Subscription[r.VelocityReport]":
        """Adds a callback for each VelocityReport."""
        return self._on("velocity", callback)

    def on_acceleration(self, callback: Callable[[r.AccelerationReport], object]) -> "Subscription[r.AccelerationReport]":
        """Adds a callback for each AccelerationReport."""
        return self._on("acceleration", callback)

    def on_button(self, callback: Callable[[r.ButtonReport], object]) -> "Subscription[r.ButtonReport]":
        """On change, and once for each button that is down when a server connects."""
        return self._on("button", callback)

    def on_analog(self, callback: Callable[[r.AnalogReport], object]) -> "Subscription[r.AnalogReport]":
        """Adds a callback for each AnalogReport."""
        return self._on("analog", callback)

    def on_force(self, callback: Callable[[r.ForceReport], object]) -> "Subscription[r.ForceReport]":
        """Adds a callback for each ForceReport."""
        return self._on("force", callback)

    def on_depth(self, callback: Callable[[r.DepthReport], object]) -> "Subscription[r.DepthReport]":
        """Adds a callback for each DepthReport."""
        return self._on("depth", callback)

    def on_contact_point(self, callback: Callable[[r.ContactPointReport], object]) -> "Subscription[r.ContactPointReport]":
        """Adds a callback for each ContactPointReport."""
        return self._on("contact_point", callback)

    def on_touching(self, callback: Callable[[r.TouchingReport], object]) -> "Subscription[r.TouchingReport]":
        """Adds a callback for each TouchingReport."""
        return self._on("touching", callback)

    def on_touched_object(self, callback: Callable[[r.TouchedObjectReport], object]) -> "Subscription[r.TouchedObjectReport]":
        """Adds a callback for each TouchedObjectReport."""
        return self._on("touched_object", callback)

    def on_angle(self, callback: Callable[[r.AngleReport], object]) -> "Subscription[r.AngleReport]":
        """Adds a callback for each AngleReport."""
        return self._on("angle", callback)

    def on_force_error(self, callback: Callable[[r.ForceErrorReport], object]) -> "Subscription[r.ForceErrorReport]":
        """Adds a callback for each ForceErrorReport."""
        return self._on("force_error", callback)

    def on_text(self, callback: Callable[[r.TextReport], object]) -> "Subscription[r.TextReport]":
        """Adds a callback for each TextReport."""
        return self._on("text", callback)

    def on_to_room(self, callback: Callable[[r.ToRoomReport], object]) -> "Subscription[r.ToRoomReport]":
        """Adds a callback for each ToRoomReport."""
        return self._on("to_room", callback)

    def on_unit_to_sensor(self, callback: Callable[[r.UnitToSensorReport], object]) -> "Subscription[r.UnitToSensorReport]":
        """Adds a callback for each UnitToSensorReport."""
        return self._on("unit_to_sensor", callback)

    def on_workspace(self, callback: Callable[[r.WorkspaceReport], object]) -> "Subscription[r.WorkspaceReport]":
        """Adds a callback for each WorkspaceReport."""
        return self._on("workspace", callback)

    def on_tick(self, callback: Callable[[r.TickReport], object]) -> "Subscription[r.TickReport]":
        """Only after subscribe(Reports.TICK)."""
        return self._on("tick", callback)

    def on_contacts(self, callback: Callable[[r.ContactsReport], object]) -> "Subscription[r.ContactsReport]":
        """Only after subscribe(Reports.CONTACTS)."""
        return self._on("contacts", callback)

    def on_guard(self, callback: Callable[[r.GuardReport], object]) -> "Subscription[r.GuardReport]":
        """Adds a callback for each GuardReport."""
        return self._on("guard", callback)

    def on_connection(self, callback: Callable[[r.ConnectionReport], object]) -> "Subscription[r.ConnectionReport]":
        """Connections and losses from now on; the first connection is reported by the first poll."""
        return self._on("connection", callback)

    def on_hand(self, callback: Callable[[r.HandReport], object]) -> "Subscription[r.HandReport]":
        """Only after subscribe(Reports.HAND)."""
        return self._on("hand", callback)
