"""What a haptics server reports, as plain values.

Frame: positions, velocities and forces are in the frame of the client's world: +x right, +y up, +z towards the
user, until a workspace command changes it. Quaternions are x y z w. Units: servers send world units divided by
1000, so `_m` means metres when the client's world is in millimetres. Forces are newtons, whatever the world unit.
Time: every `time` is the wall clock of the server at the servo tick that produced the value, in seconds since 1970,
to a microsecond. Vectors are arrays of float64 that belong to the report.
"""

import enum
from typing import Any, Dict, Final, Iterator, List, NamedTuple, Tuple

import numpy as np
import numpy.typing as npt

from . import _messages

Array = npt.NDArray[np.float64]


class Trips(int):
    """A set of trips: the reasons for which the guard changes the force, as the bit field on the wire. A newer
    server may set bits that this version does not know."""

    @property
    def names(self) -> Tuple[str, ...]:
        """Names of the known trips in the order of their bits, such as ("speed", "stopped")."""
        return tuple(trip[0] for bit, trip in enumerate(_messages.TRIPS) if self & (1 << bit))

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __or__(self, other: int) -> "Trips":
        return Trips(int(self) | other)

    def __and__(self, other: int) -> "Trips":
        return Trips(int(self) & other)

    def __xor__(self, other: int) -> "Trips":
        return Trips(int(self) ^ other)

    __ror__, __rand__, __rxor__ = __or__, __and__, __xor__

    def explain(self) -> str:
        """One line for each trip: its name, what happened, what to do."""
        return "\n".join(
            f"{trip[0]}: {trip[1]} {trip[2]}" for bit, trip in enumerate(_messages.TRIPS) if self & (1 << bit)
        )

    def __repr__(self) -> str:
        return f"Trips({'+'.join(self.names) or 'none'})"


class ForceError(enum.IntEnum):
    """Error codes of VRPN's force device."""

    VALUE_OUT_OF_RANGE = 0
    DUTY_CYCLE = 1
    FORCE = 2
    OTHER = 3
    RECOVERED = 4  # no trip acts any more


class Severity(enum.IntEnum):
    """Severity of a text message; the numbers are VRPN's."""

    NORMAL = 0
    WARNING = 1
    ERROR = 2


class PoseReport(NamedTuple):
    """Pose of a sensor: 0 is the proxy, 1 the device itself, 2 the surface contact point."""

    time: float
    sensor: int
    position_m: Array  # (3,)
    orientation: Array  # (4,), from sensor to world


class VelocityReport(NamedTuple):
    """Velocity of a sensor, and the rotation that it performs within rotation_interval_s."""

    time: float
    sensor: int
    velocity_m_per_s: Array  # (3,)
    rotation: Array  # (4,)
    rotation_interval_s: float


class AccelerationReport(NamedTuple):
    """Acceleration of a sensor, and the change of its rotation. Servers of this project send none."""

    time: float
    sensor: int
    acceleration_m_per_s2: Array  # (3,)
    rotation: Array  # (4,)
    rotation_interval_s: float


class ButtonReport(NamedTuple):
    """A button was pressed or released. Buttons are counted from 0."""

    time: float
    button: int
    pressed: bool


class AnalogReport(NamedTuple):
    """The value of every analog channel. Channels of servers of this project: the opening of the gripper (rad) alone,
    and no report without a gripper; with Reports.CONTACT_ANALOG, under the name NAME.touch, and with `compat_mirrors` of
    the server: force x y z (N), depth (m), angle (degrees), touched object (-1: none), then the opening, where there is
    a gripper."""

    time: float
    channels: Array  # (n,)


class ForceReport(NamedTuple):
    """The force written to the device, on the hand, after the guard."""

    time: float
    force_N: Array  # (3,)


class DepthReport(NamedTuple):
    """Penetration depth: the distance from the device to the proxy along the surface normal, without what friction holds
    aside; 0 without contact."""

    time: float
    depth_m: float


class ContactPointReport(NamedTuple):
    """The surface contact point and the orientation of the stylus."""

    time: float
    position_m: Array  # (3,)
    orientation: Array  # (4,), from stylus to world


class TouchingReport(NamedTuple):
    """Whether anything is touched."""

    time: float
    touching: bool


class TouchedObjectReport(NamedTuple):
    """The object that is touched, -1 for none and for planes."""

    time: float
    object: int


class AngleReport(NamedTuple):
    """Angle between the stylus axis and the surface normal in degrees; 0 without contact."""

    time: float
    angle_deg: float
    touching: bool


class ForceErrorReport(NamedTuple):
    """A trip acts on the force, or none does any more (RECOVERED). GuardReport says which."""

    time: float
    error: int  # see ForceError


class TextReport(NamedTuple):
    """A text of the server for a person, one line: the server's control characters arrive as U+FFFD. Refusals of commands
    arrive as Severity.ERROR, `level` then holds the refusal code of docs/wire-extensions.md."""

    time: float
    severity: Severity
    text: str
    level: int = 0


class ToRoomReport(NamedTuple):
    """Pose of the tracker's base in the room; the answer to request_to_room()."""

    time: float
    position_m: Array  # (3,)
    orientation: Array  # (4,)


class UnitToSensorReport(NamedTuple):
    """Mounting of the tracked unit on a sensor; the answer to request_unit_to_sensor(), once for each sensor."""

    time: float
    sensor: int
    position_m: Array  # (3,)
    orientation: Array  # (4,)


class WorkspaceReport(NamedTuple):
    """Reach of the device in the world; the answer to request_workspace()."""

    time: float
    min_m: Array  # (3,)
    max_m: Array  # (3,)


class TickReport(NamedTuple):
    """One complete servo tick; only after subscribe(Reports.TICK)."""

    time: float
    tick: int  # counted by the server from 1 without gaps
    tick_time_ns: int  # on the monotonic clock of the server
    revision: int  # of the scene that was rendered
    hand_m: Array  # (3,), haptic interface point: where the device is
    proxy_m: Array  # (3,)
    velocity_m_per_s: Array  # (3,), of the device
    orientation: Array  # (4,), from stylus to world
    force_N: Array  # (3,), on the hand, as written to the device
    depth_m: float
    object: int  # the object with the largest force, -1 for none
    buttons: int  # bit 0: button 0 is down
    guard_active: Trips  # trips that act in this tick
    guard_latched: Trips  # trips that hold the force at zero until rearm_forces()


class Contact(NamedTuple):
    """Contact with one object."""

    object: int  # -1: a plane
    point_m: Array  # (3,)
    normal: Array  # (3,), of length 1, out of the surface
    force_N: Array  # (3,), on the hand; the object receives the opposite


class ContactsReport(NamedTuple):
    """All contacts of one servo tick; empty once when the last contact ends. Only after
    subscribe(Reports.CONTACTS)."""

    time: float
    tick: int
    tick_time_ns: int
    contacts: List[Contact]


class GuardReport(NamedTuple):
    """State of the guard: why the force may differ from the rendered one. Sent on change and to each new client."""

    time: float
    active: Trips  # holds and latches that act now; clamps are not reported here
    latched: Trips  # trips that hold the force at zero until rearm_forces()
    armed: bool  # forces are enabled for the device
    stopped: bool  # a client stopped the forces


class RemoteContactForce(NamedTuple):
    """A contact of set_remote_contacts() that exerts force."""

    id: int
    proxy_m: Array  # (3,), the point of the rendered surface nearest to the device
    force_N: Array  # (3,), on the hand; the object receives the opposite
    depth_m: float


class HandReport(NamedTuple):
    """What a client needs that streams contacts or forces: the newest tick at the time of sending. Only after
    subscribe(Reports.HAND)."""

    time: float
    tick: int  # as in TickReport
    tick_time_ns: int  # on the monotonic clock of the server
    # When this client sent the newest contacts and force that the tick knows, by time.monotonic_ns(); 0: none.
    contacts_sent_ns: int
    force_sent_ns: int
    position_m: Array  # (3,), haptic interface point: where the device is
    orientation: Array  # (4,), from stylus to world
    velocity_m_per_s: Array  # (3,)
    angular_velocity_rad_per_s: Array  # (3,)
    force_N: Array  # (3,), on the hand, as written to the device: all forces together
    held_force_N: Array  # (3,), the part of set_force(), before the guard
    energy_J: float  # that the held force may still add to the hand
    gripper_rad: float  # NaN without a gripper
    buttons: int  # bit 0: button 0 is down
    energy_spent: bool  # the part of the held force that adds power is cut
    corrections_held: bool  # a remote contact moved without a stated velocity and waits for energy
    guard_active: Trips
    contacts: List[RemoteContactForce]


class ConnectionReport(NamedTuple):
    """The connection was established, or lost for the given reason."""

    time: float  # on the clock of the client
    connected: bool
    reason: str  # empty when connected


def _zeros() -> Array:
    return np.zeros(3)


def _identity() -> Array:
    return np.array([0.0, 0.0, 0.0, 1.0])


class LatestReports:
    """The newest report of each kind. Each has the time 0 until the first one arrives; all are reset when the
    connection is lost."""

    def __init__(self) -> None:
        self.pose: Dict[int, PoseReport] = {}  # by sensor
        self.velocity: Dict[int, VelocityReport] = {}  # by sensor
        self.pressed: Dict[int, bool] = {}  # by button
        self.analog = AnalogReport(0.0, np.zeros(0))
        self.force = ForceReport(0.0, _zeros())
        self.depth = DepthReport(0.0, 0.0)
        self.contact_point = ContactPointReport(0.0, _zeros(), _identity())
        self.touching = TouchingReport(0.0, False)
        self.touched_object = TouchedObjectReport(0.0, -1)
        self.angle = AngleReport(0.0, 0.0, False)
        none = Trips(0)
        self.tick = TickReport(
            0.0, 0, 0, 0, _zeros(), _zeros(), _zeros(), _identity(), _zeros(), 0.0, -1, 0, none, none
        )
        self.contacts = ContactsReport(0.0, 0, 0, [])
        self.guard = GuardReport(0.0, none, none, False, False)
        self.hand = HandReport(
            0.0, 0, 0, 0, 0, _zeros(), _identity(), _zeros(), _zeros(), _zeros(), _zeros(), 0.0, float("nan"), 0, False,
            False, none, [],
        )  # fmt: skip


#: Report class of each kind, in the order of the C++ ReportKind.
KINDS: Final[Dict[str, Any]] = {
    "pose": PoseReport,
    "velocity": VelocityReport,
    "acceleration": AccelerationReport,
    "button": ButtonReport,
    "analog": AnalogReport,
    "force": ForceReport,
    "depth": DepthReport,
    "contact_point": ContactPointReport,
    "touching": TouchingReport,
    "touched_object": TouchedObjectReport,
    "angle": AngleReport,
    "force_error": ForceErrorReport,
    "text": TextReport,
    "to_room": ToRoomReport,
    "unit_to_sensor": UnitToSensorReport,
    "workspace": WorkspaceReport,
    "tick": TickReport,
    "contacts": ContactsReport,
    "guard": GuardReport,
    "hand": HandReport,
}

_VECTORS = {
    "position_m": 3, "orientation": 4, "velocity_m_per_s": 3, "acceleration_m_per_s2": 3, "rotation": 4,
    "force_N": 3, "min_m": 3, "max_m": 3, "hand_m": 3, "proxy_m": 3, "point_m": 3, "normal": 3,
    "angular_velocity_rad_per_s": 3, "held_force_N": 3,
}  # fmt: skip
_TYPES = {float: "f8", int: "i8", bool: "?", Trips: "u4", Severity: "i4"}


def dtype_of(kind: str) -> "np.dtype[Any]":
    """The structured dtype of rows of this kind; kinds with texts or lists of varying length have none
    (ValueError)."""
    if kind == "contacts":  # one row for each contact
        return np.dtype([("time", "f8"), ("tick", "u8"), ("tick_time_ns", "i8"), ("object", "i8"),
                         ("point_m", "f8", 3), ("normal", "f8", 3), ("force_N", "f8", 3)])  # fmt: skip
    if not isinstance(kind, str) or kind not in KINDS or kind in ("text", "analog"):
        known = ", ".join(name for name in KINDS if name not in ("text", "analog"))
        raise ValueError(f"no rows of kind {kind!r}; there are {known}")
    columns: List[Any] = []
    for name, type_ in KINDS[kind].__annotations__.items():
        if name == "contacts":  # their number varies
            continue
        if name in _VECTORS:
            columns.append((name, "f8", _VECTORS[name]))
        elif name in ("tick", "revision"):
            columns.append((name, "u8"))
        else:
            columns.append((name, _TYPES[type_]))
    return np.dtype(columns)


def rows_of(kind: str, reports: List[Any]) -> "npt.NDArray[Any]":
    """Reports of one kind as a structured array."""
    if kind == "contacts":
        rows = [(r.time, r.tick, r.tick_time_ns, *contact) for r in reports for contact in r.contacts]
        return np.array(rows, dtype=dtype_of(kind))
    table = np.empty(len(reports), dtype=dtype_of(kind))
    for column, name in enumerate(table.dtype.names or ()):
        table[name] = [report[column] for report in reports]
    return table
