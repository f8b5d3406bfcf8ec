"""Recordings of `hapticd serve --record` as numpy arrays. docs/recording-format.md describes the bytes.

    session = hapticd.Session("my.haptics")
    force = session.ticks["force_N"]           # (n, 3)
    for command in session.commands():
        print(command.time_ns, command.name, command.fields)
"""

import mmap
import os
import struct
import zlib
from typing import Any, Dict, Final, Iterator, List, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np
import numpy.typing as npt

from .errors import RecordingError
from .reports import Trips

_MAGIC: Final = b"HAPTICS\n"
_HEAD: Final = struct.Struct(">III")
_VERSION: Final = 2
# Kinds of blocks.
_HEADER, _SCENE, _PUBLISH, _TICKS, _LOST, _END, _LAW, _STREAM, _PASSIVITY, _MARKER, _MEMORY = range(1, 12)
_REMOTE_MEMORY, _LEFT, _WALL_OFFSET = 12, 13, 14
_MAX_CONTACTS: Final = 1024
#: By which a recording is known again: they hold its time and configuration.
_BEGINNING_BYTES: Final = 4096

_FIXED: Final = np.dtype(
    [
        ("flags", "u1"), ("tick", ">u8"), ("servo_time_ns", ">i8"), ("revision", ">u8"), ("control_stopped", "?"),
        ("control_armed", "?"), ("control_rearms", ">u8"), ("control_ramps", ">u4"), ("period_ns", ">i8"),
        ("wakeup_error_ns", ">i8"), ("compute_ns", ">i8"), ("overruns", ">u8"), ("skipped_periods", ">u8"),
        ("device_time_ns", ">i8"), ("hip_m", ">f8", 3), ("orientation_xyzw", ">f8", 4),
        ("velocity_m_per_s", ">f8", 3), ("angular_velocity_rad_per_s", ">f8", 3), ("buttons", ">u4"),
        ("hold", ">u4"), ("motor_temperature", ">f8"), ("proxy_m", ">f8", 3), ("rendered_force_N", ">f8", 3),
        ("contact_force_N", ">f8", 3), ("normal_force_N", ">f8", 3), ("touching", "?"), ("touched_object", ">i4"),
        ("proxy_depth_m", ">f8"), ("surface_normal", ">f8", 3), ("scp_m", ">f8", 3), ("contact_count", ">u4"),
        ("render_status", ">u4"), ("force_N", ">f8", 3), ("guard_active", ">u4"), ("guard_latched", ">u4"),
        ("guard_gain", ">f8"), ("guard_limit_N", ">f8"), ("guard_armed", "?"), ("guard_stopped", "?"),
        ("dropped", ">u8"),
    ]
)  # fmt: skip
_CONTACT: Final = np.dtype(
    [("object", ">i4"), ("triangle", ">u4"), ("point_m", ">f8", 3), ("normal", ">f8", 3), ("force_N", ">f8", 3)]
)
_HAVE_STATE, _WRITTEN, _PLACEMENT, _COUNTS, _GRIPPER = 1, 2, 4, 8, 16
_PLACEMENT_BYTES: Final = 12 * 8
_TRIPS: Final = 17  # of the format, whatever newer servers add
_COUNTS_BYTES: Final = 4 * _TRIPS

# Members of each command, by its number: name, then (member, type). Types: i, I, d, f and ? as in struct, with a count
# before it; "text"; "list" and the type of an item.
_COMMANDS: Final[Dict[int, Tuple[str, Tuple[Tuple[str, str], ...]]]] = {
    0: ("ClientLeft", ()),
    1: ("SetObjectNumber", (("count", "i"),)),
    2: ("SetVertices", (("object", "i"), ("first", "i"), ("positions", "list3f"))),
    3: ("SetTriangles", (("object", "i"), ("first", "i"), ("triangles", "list3I"), ("makesMetres", "?"))),
    4: ("SetNormal", (("object", "i"),)),
    5: ("RemoveTriangle", (("object", "i"), ("triangle", "i"))),
    6: ("ClearMesh", (("object", "i"),)),
    7: ("TransformMesh", (("object", "i"), ("matrix", "16f"))),
    8: ("SetTrimeshType", (("object", "i"), ("type", "i"))),
    9: ("AddObject", (("object", "i"), ("parent", "i"))),
    10: ("AddObjectExScene", (("object", "i"),)),
    11: ("MoveToParent", (("object", "i"), ("parent", "i"))),
    12: ("RemoveObject", (("object", "i"),)),
    13: ("SetTransform", (("object", "i"), ("matrix", "16d"))),
    14: ("SetObjectPosition", (("object", "i"), ("position_m", "3d"))),
    15: ("SetObjectOrientation", (("object", "i"), ("axis", "3d"), ("angle_rad", "d"))),
    16: ("SetObjectScale", (("object", "i"), ("scale", "3d"))),
    17: ("SetTouchable", (("object", "i"), ("touchable", "?"))),
    18: ("SetSurfaceProperty", (("object", "i"), ("name", "text"), ("value", "d"))),
    19: (
        "SetSurface",
        (("object", "i"), ("stiffness", "d"), ("damping", "d"), ("staticFriction", "d"), ("dynamicFriction", "d")),
    ),
    20: ("SetTouchableFaces", (("faces", "i"),)),
    21: ("SetWorkspaceProjection", (("model", "16d"), ("projection", "16d"))),
    22: ("SetWorkspaceBox", (("model", "16d"), ("box", "6d"))),
    23: ("SetHapticOrigin", (("position_m", "3d"), ("axis", "3d"), ("angle_rad", "d"))),
    24: ("SetHapticScale", (("scale", "d"),)),
    25: ("SetSceneOrigin", (("position_m", "3d"), ("axis", "3d"), ("angle_rad", "d"))),
    26: (
        "DefineEffect",
        (
            ("type", "text"), ("index", "i"), ("gain", "d"), ("magnitude_N", "d"), ("duration_ms", "d"),
            ("frequency", "d"), ("position", "3d"), ("direction", "3d"),
        ),
    ),
    27: ("StartEffect", (("index", "i"),)),
    28: ("StopEffect", (("index", "i"),)),
    29: (
        "SetPlane",
        (
            ("index", "i"), ("plane", "4d"), ("stiffness", "d"), ("damping", "d"), ("staticFriction", "d"),
            ("dynamicFriction", "d"), ("recoveryCycles", "i"),
        ),
    ),
    30: (
        "SetPlaneDetail",
        (
            ("adhesionNormal_N", "d"), ("adhesionLateral_N", "d"), ("textureAmplitude_m", "d"),
            ("textureWavelength_m", "d"), ("buzzAmplitude_m", "d"), ("buzzFrequency_Hz", "d"),
        ),
    ),
    31: ("SetForceField", (("origin_m", "3d"), ("force_N", "3d"), ("jacobian_N_per_m", "9d"), ("radius_m", "d"))),
    32: ("SetConstraintEnabled", (("enabled", "?"),)),
    33: ("SetConstraintMode", (("mode", "i"),)),
    34: ("SetConstraintVector", (("which", "i"), ("value", "3d"))),
    35: ("SetConstraintStiffness", (("stiffness_N_per_m", "d"),)),
    36: ("StartCustomEffect", (("effect", "I"), ("parameters", "list1f"))),
    37: ("StopCustomEffect", ()),
    38: ("ResetScene", ()),
    39: ("BeginBatch", ()),
    40: ("CommitBatch", ()),
    41: ("ReleaseForces", ()),
    42: ("SetObjectName", (("object", "i"), ("text", "text"))),
    43: ("ContinueEffect", (("index", "i"), ("ran_ns", "q"))),
    44: ("RefuseBatch", ()),
    45: ("ContinueMesh", (("object", "i"), ("hasDeformed", "i"), ("edited_ns", "q"))),
    46: ("PauseRebuilds", (("pause_ns", "q"),)),
    47: ("ContinueCheck", (("object", "i"), ("isCurrent", "i"), ("due_ns", "q"))),
}  # fmt: skip


class _Cut(Exception):
    """A value reaches beyond its block."""


class _Unpacker:
    def __init__(self, data: memoryview) -> None:
        self.data = data
        self.at = 0

    def one(self, letter: str) -> Any:
        return self.many(letter, 1)[0]

    def many(self, letter: str, count: int) -> Tuple[Any, ...]:
        form = f">{count}{letter}"
        size = struct.calcsize(form)
        if self.at + size > len(self.data):
            raise _Cut
        self.at += size
        return struct.unpack_from(form, self.data, self.at - size)

    def text(self) -> str:
        return b"".join(self.many("c", self.one("I"))).decode("utf-8", "replace")

    def array(self, letter: str, count: int) -> "npt.NDArray[Any]":
        dtype = np.dtype(">" + letter)
        size = dtype.itemsize * count
        if self.at + size > len(self.data):
            raise _Cut
        self.at += size
        return np.frombuffer(self.data, dtype, count, self.at - size).astype(dtype.newbyteorder("="))

    def value(self, form: str) -> Any:
        if form == "text":
            return self.text()
        if form.startswith("list"):
            width = int(form[4])
            array = self.array(form[5], width * self.one("I"))
            return array.reshape(-1, width) if width > 1 else array
        if len(form) > 1:
            return self.array(form[-1], int(form[:-1]))
        return self.one(form)


class RecordedDevice(NamedTuple):
    """One haptic device of a recording."""

    names: Tuple[str, ...]
    driver: str
    model: str
    buttons: int
    scene: int  # number of its scene
    rate_Hz: float


class Command(NamedTuple):
    """A command as the scene applied it; "ClientLeft" when a client left. Members are named as in
    docs/recording-format.md; vectors and lists are arrays, matrices have 16 numbers."""

    time_ns: int  # since 1970
    scene: int
    client: int
    name: str
    fields: Dict[str, Any]


class Marker(NamedTuple):
    """A moment that a client marked."""

    time_ns: int  # since 1970
    text: str


class Lost(NamedTuple):
    """Data is missing because the disk was too slow."""

    what: str  # "ticks", "scene events" or "streamed values"
    device: int  # for ticks and streamed values
    count: int  # type: ignore[assignment]


def _names(columns: Union[str, Sequence[str]]) -> Sequence[str]:
    """A text is the name of one column, not a list of its letters."""
    return (columns,) if isinstance(columns, str) else columns


class Ticks:
    """The ticks of one device, column by column: ticks["force_N"] is an array of n rows, read from the file at the
    first use and kept. Lengths in metres, forces in newtons, in the device's frame. `columns` names all columns; those
    of `hapticd export --to csv` have the same names here (vectors as one column), and NaN where the CSV is empty. A
    column that was not read before the session was closed raises ValueError."""

    _DERIVED = ("time_ns", "depth_m", "object", "normal", "contact_point_m", "gripper_rad", "have_state", "written",
                "T_world_device", "guard_counts")  # fmt: skip

    def __init__(self, session: "Session", offsets: "npt.NDArray[np.int64]") -> None:
        self._session = session
        self._offsets = offsets
        self._cache: Dict[str, npt.NDArray[Any]] = {}

    @property
    def columns(self) -> Tuple[str, ...]:
        """Names of all columns."""
        return (*(self._DERIVED), *(name for name in (_FIXED.names or ()) if name != "flags"))

    def __len__(self) -> int:
        return len(self._offsets)

    def __iter__(self) -> Iterator[str]:
        """The names of the columns, as a DataFrame has them."""
        return iter(self.columns)

    def __contains__(self, column: object) -> bool:
        return column in self.columns

    def __getitem__(self, column: str) -> "npt.NDArray[Any]":
        if isinstance(column, (list, slice)):
            raise KeyError(f"{column}: give the name of one column; to_array() takes several, and a column takes rows")
        if column not in self._cache:
            if column not in self.columns and column != "flags":
                raise KeyError(f"no column {column!r}; there are {', '.join(self.columns)}")
            array = self._derive(column) if column in self._DERIVED else self._read(column)
            array.setflags(write=False)
            self._cache[column] = array
        return self._cache[column]

    def _read(self, column: str) -> "npt.NDArray[Any]":
        assert _FIXED.fields is not None
        dtype, offset = _FIXED.fields[column][:2]
        return self._session._gather(self._offsets + offset, dtype)

    def _has(self, flag: int) -> "npt.NDArray[np.bool_]":
        return np.not_equal(self["flags"] & flag, 0)

    def _tail(self) -> "npt.NDArray[np.int64]":
        """Where the optional parts of each tick begin."""
        tail: npt.NDArray[np.int64] = self._offsets + (_FIXED.itemsize + _CONTACT.itemsize * self["contact_count"].astype(np.int64))
        return tail

    def _carried(self, has: "npt.NDArray[np.bool_]", values: "npt.NDArray[Any]") -> "npt.NDArray[Any]":
        """Values of the ticks that have one; the others have that of the tick before."""
        if not len(values):
            return np.zeros((len(self), *values.shape[1:]), values.dtype)
        return np.asarray(values[np.maximum(np.cumsum(has) - 1, 0)])

    def _derive(self, column: str) -> "npt.NDArray[Any]":
        touching = self["touching"] if column in ("depth_m", "object") else None
        if column == "time_ns":
            return self._session._wall(self["servo_time_ns"])
        if column == "depth_m":
            return np.where(touching, self["proxy_depth_m"], 0.0)  # type: ignore[arg-type]
        if column == "object":
            return np.where(touching, self["touched_object"], np.int32(-1))  # type: ignore[arg-type]
        if column == "normal":
            return self._of_touched("normal", 0.0)
        if column == "contact_point_m":
            return self._of_touched("point_m", np.nan)
        if column == "have_state":
            return self._has(_HAVE_STATE)
        if column == "written":
            return self._has(_WRITTEN)
        placement, counts = self._has(_PLACEMENT), self._has(_COUNTS)
        if column == "T_world_device":
            flat = self._session._gather(self._tail()[placement], np.dtype((">f8", 12)))
            return self._carried(placement, np.ascontiguousarray(flat.reshape(-1, 4, 3).transpose(0, 2, 1)))
        behind = self._tail() + placement * _PLACEMENT_BYTES
        if column == "guard_counts":
            return self._carried(counts, self._session._gather(behind[counts], np.dtype((">u4", _TRIPS))))
        gripper = self._has(_GRIPPER)
        opening = np.full(len(self), np.nan)
        at = behind + counts * _COUNTS_BYTES
        opening[gripper] = self._session._gather(at[gripper], np.dtype(">f8"))
        return opening

    def to_array(self, columns: Union[str, Sequence[str]]) -> "npt.NDArray[Any]":
        """The columns as one structured array; the name of one column is that column."""
        arrays = {name: self[name] for name in _names(columns)}
        table = np.empty(len(self), dtype=[(name, a.dtype, a.shape[1:]) for name, a in arrays.items()])
        for name, array in arrays.items():
            table[name] = array
        return table

    def to_pandas(self, columns: Union[str, Sequence[str], None] = None) -> Any:
        """A DataFrame with time_ns as index; vectors become columns such as force_N_x; the name of one column is that
        column. Needs pandas."""
        import pandas  # type: ignore[import]

        if columns is None:
            columns = ("tick", "hip_m", "proxy_m", "velocity_m_per_s", "force_N", "depth_m", "object", "buttons")
        table: Dict[str, Any] = {}
        for name in _names(columns):
            array = self[name]
            if array.ndim == 1:
                table[name] = array
            else:
                flat = array.reshape(len(self), -1)
                axes = "xyzw" if flat.shape[1] <= 4 else [str(i) for i in range(flat.shape[1])]
                table.update({f"{name}_{axis}": flat[:, i] for i, axis in zip(range(flat.shape[1]), axes)})
        return pandas.DataFrame(table, index=pandas.Index(self["time_ns"], name="time_ns"))

    def _contacts_at(self) -> "Tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]":
        """For each contact the number of its tick's row, and where it stands in the file."""
        number = self["contact_count"].astype(np.int64)
        which = np.repeat(np.arange(len(self)), number)
        nth = np.arange(len(which)) - np.repeat(np.cumsum(number) - number, number)
        return which, self._offsets[which] + _FIXED.itemsize + nth * _CONTACT.itemsize

    def _of_touched(self, field: str, free: float) -> "npt.NDArray[Any]":
        """A vector of the contact with the touched object."""
        which, at = self._contacts_at()
        assert _CONTACT.fields is not None
        dtype, offset = _CONTACT.fields["object"][:2]
        object_ = self._session._gather(at + offset, dtype)
        mask = self["touching"][which] & (object_ == self["touched_object"][which])
        dtype, offset = _CONTACT.fields[field][:2]
        values = np.full((len(self), 3), free)
        values[which[mask]] = self._session._gather(at[mask] + offset, dtype)
        return values

    def contacts(self) -> "npt.NDArray[Any]":
        """One row for each contact of each tick: time_ns, tick, object, triangle, point_m, normal, force_N."""
        which, at = self._contacts_at()
        table = np.empty(len(which), dtype=[("time_ns", "i8"), ("tick", "u8"), *_CONTACT.newbyteorder("=").descr])
        table["time_ns"], table["tick"] = self["time_ns"][which], self["tick"][which]
        assert _CONTACT.fields is not None
        for name, field in _CONTACT.fields.items():
            table[name] = self._session._gather(at + field[1], field[0])
        return table

    def guard(self) -> "npt.NDArray[Any]":
        """The state of the guard in the first tick and wherever it changed: time_ns, tick, active, latched (bits, see
        Trips), armed, stopped."""
        state = self.to_array(("guard_active", "guard_latched", "guard_armed", "guard_stopped"))
        changed = np.ones(len(self), dtype=bool)
        changed[1:] = state[1:] != state[:-1]
        rows = np.empty(
            int(changed.sum()),
            dtype=[("time_ns", "i8"), ("tick", "u8"), ("active", "u4"), ("latched", "u4"), ("armed", "?"), ("stopped", "?")],
        )
        rows["time_ns"], rows["tick"] = self["time_ns"][changed], self["tick"][changed]
        for name in ("active", "latched", "armed", "stopped"):
            rows[name] = state["guard_" + name][changed]
        return rows


class Session:
    """A recording. The file is mapped into memory; opening it reads the heads of its blocks and, with `verify`, checks
    their checksums. Like every reader of this format it stops before the first damaged or incomplete block: `remark`
    then names its byte. A recording that is still written is read as far as it was when it was opened. Raises RecordingError
    for a file that is no recording, and later when another program has cut or overwritten the file; and OSError."""

    def __init__(self, path: "Union[str, os.PathLike[str]]", verify: bool = True) -> None:
        self.path = os.fspath(path)
        with open(self.path, "rb") as file:
            size = os.fstat(file.fileno()).st_size
            if size < len(_MAGIC) or file.read(len(_MAGIC)) != _MAGIC:
                raise RecordingError(f"'{self.path}' is not a recording of hapticd: it does not start with HAPTICS")
            self._map = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        self._bytes = memoryview(self._map)
        self._beginning = bytes(self._bytes[:_BEGINNING_BYTES])
        self._data: npt.NDArray[np.uint8] = np.frombuffer(self._map, dtype=np.uint8)
        self._ticks: Dict[int, Ticks] = {}
        self._ended = False
        self._closed = False
        self._damage = ""
        try:
            self._index(verify)
            self._read_header()
            self._read_law()
            self._read_wall_offsets()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Releases the file. Columns that were read stay valid; what would read the file raises ValueError."""
        self._closed = True
        self._data = np.empty(0, dtype=np.uint8)
        self._bytes.release()
        try:
            self._map.close()
        except BufferError:
            pass  # closed with the last array that still refers to it

    def __enter__(self) -> "Session":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _index(self, verify: bool) -> None:
        """Positions and lengths of all whole blocks."""
        self._blocks: List[Tuple[int, int, int]] = []  # kind, start of the content, length
        data, size, at = self._bytes, len(self._bytes), len(_MAGIC)
        unpack, crc32, append = _HEAD.unpack_from, zlib.crc32, self._blocks.append
        while at < size:
            if at + _HEAD.size > size:
                self._damage = f"the block at byte {at} is cut"
                return
            if data[at : at + len(_MAGIC)] == _MAGIC:
                self._damage = f"another recording begins at byte {at}"
                return
            kind, length, check = unpack(data, at)
            start = at + _HEAD.size
            if start + length > size:
                self._damage = f"the block at byte {at} is cut"
                return
            if verify and crc32(data[start : start + length], crc32(data[at : at + 8])) != check:
                self._damage = f"the checksum of the block at byte {at} does not match"
                return
            append((kind, start, length))
            at = start + length

    def _check_open(self) -> None:
        """Before each read. The system ends a program that reads a mapped file behind its end."""
        if self._closed:
            raise ValueError(f"the session of '{self.path}' is closed")
        if self._map.size() < len(self._bytes) or self._bytes[: len(self._beginning)] != self._beginning:
            raise RecordingError(f"another program has cut or overwritten '{self.path}' since it was opened: open it again")

    def _content(self, start: int, length: int) -> _Unpacker:
        self._check_open()
        return _Unpacker(self._bytes[start : start + length])

    def _fail(self, at: int, what: str) -> RecordingError:
        return RecordingError(f"'{self.path}', block at byte {at - _HEAD.size}: {what}")

    def _read_header(self) -> None:
        if not self._blocks or self._blocks[0][0] != _HEADER:
            raise RecordingError(f"'{self.path}' has no whole header{': ' + self._damage if self._damage else ''}")
        _, start, length = self._blocks[0]
        unpack = self._content(start, length)
        try:
            #: Version of the format.
            self.version = int(unpack.one("I"))
            if not 1 <= self.version <= _VERSION:
                raise self._fail(
                    start,
                    f"the file has version {self.version} of the format, this program reads versions 1 to {_VERSION}; "
                    "use the hapticd that wrote it",
                )
            #: Program that recorded, with its version.
            self.program = unpack.text()
            #: Wall time minus servo time at the start.
            self.wall_offset_ns = int(unpack.one("q"))
            #: Configuration of the server, as TOML.
            self.config = unpack.text()
            #: Devices of the recording.
            self.devices = tuple(self._read_device(unpack) for _ in range(unpack.one("I")))
        except _Cut:
            raise self._fail(start, "the length of the header does not match its content") from None
        finally:
            unpack.data.release()

    @staticmethod
    def _read_device(unpack: _Unpacker) -> RecordedDevice:
        names = tuple(unpack.text() for _ in range(unpack.one("I")))
        driver, model = unpack.text(), unpack.text()
        buttons, scene = unpack.one("i"), unpack.one("I")
        # Scene: four enumerations, the workspace, six numbers, two truths, the limits (i i I I Q Q Q Q).
        unpack.many("i", 4)
        unpack.many("d", 12 - 1)
        unpack.many("?", 2)
        unpack.many("I", 4)
        unpack.many("Q", 4)
        rate = unpack.one("d")
        # Renderer: radius, shading. Guard: three truths, four numbers, speed_ticks, one number, five times.
        unpack.many("d", 1)
        unpack.many("?", 1)
        unpack.many("?", 3)
        unpack.many("d", 4)
        unpack.many("i", 1)
        unpack.many("d", 1)
        unpack.many("q", 5)
        return RecordedDevice(names, driver, model, buttons, scene, rate)

    def _read_law(self) -> None:
        #: Number of the force law.
        self.law = 1
        if len(self._blocks) > 1 and self._blocks[1][0] == _LAW:
            _, start, length = self._blocks[1]
            try:
                self.law = int(self._content(start, length).one("I"))
            except _Cut:
                raise self._fail(start, "the force law is truncated") from None
        self._ended = any(kind == _END for kind, _, _ in self._blocks[-4:])

    def _read_wall_offsets(self) -> None:
        """From which servo times on the offset is another, because the wall clock was set, and the offsets."""
        found: Dict[int, int] = {}
        for kind, start, length in self._blocks:
            if kind != _WALL_OFFSET:
                continue
            unpack = self._content(start, length)
            try:
                time, found[time] = unpack.one("q"), unpack.one("q")
            except _Cut:
                raise self._fail(start, "a damaged wall offset") from None
        times = sorted(found)
        self._wall_set = np.array(times, dtype=np.int64)
        self._wall_offsets = np.array([self.wall_offset_ns, *(found[time] for time in times)], dtype=np.int64)

    def _wall(self, time: Any) -> "npt.NDArray[np.int64]":
        """Wall times of servo times."""
        return np.asarray(time + self._wall_offsets[np.searchsorted(self._wall_set, time, "right")])

    @property
    def remark(self) -> str:
        """Why the recording is not whole; empty when it is."""
        if self._damage:
            return self._damage + "; everything before it was read"
        if not self._ended:
            return "the recording has no end: the server was killed or is still recording"
        return ""

    def _device(self, device: Union[int, str]) -> int:
        if isinstance(device, str):
            for number, one in enumerate(self.devices):
                if device in one.names:
                    return number
            known = ", ".join(name for one in self.devices for name in one.names)
            raise KeyError(f"no device {device!r} in '{self.path}'; there is {known}")
        if device not in range(len(self.devices)):
            raise KeyError(f"no device {device!r} in '{self.path}'; there are {len(self.devices)}")
        return device

    @property
    def ticks(self) -> Ticks:
        """The ticks of the first device."""
        return self.ticks_of(0)

    def ticks_of(self, device: Union[int, str]) -> Ticks:
        """The ticks of a device by its number or one of its names."""
        self._check_open()
        number = self._device(device)
        if number not in self._ticks:
            self._ticks[number] = Ticks(self, self._find_ticks(number))
        return self._ticks[number]

    def _find_ticks(self, device: int) -> "npt.NDArray[np.int64]":
        """Where each tick begins. Ticks vary in length, so all runs are walked at once: their first ticks, then their
        second ticks, and so on."""
        blocks = np.array([(s, s + n) for kind, s, n in self._blocks if kind == _TICKS], dtype=np.int64).reshape(-1, 2)
        short = blocks[blocks[:, 1] - blocks[:, 0] < 4]
        if len(short):
            raise self._fail(int(short[0, 0]), "a block of ticks is truncated")
        blocks = blocks[self._gather(blocks[:, 0], np.dtype(">u4")) == device]
        at, end = blocks[:, 0] + 4, blocks[:, 1]
        found: List[npt.NDArray[np.int64]] = []
        assert _FIXED.fields is not None
        count_at = _FIXED.fields["contact_count"][1]
        whole = len(self._data)
        while len(at):
            inside = at < end
            at, end = at[inside], end[inside]
            if np.any(at + _FIXED.itemsize > np.minimum(end, whole)):
                raise self._fail(int(at[at + _FIXED.itemsize > end][0]), "a damaged tick")
            flags = self._data[at]
            contacts = self._gather(at + count_at, np.dtype(">u4")).astype(np.int64)
            following = (
                at
                + (_FIXED.itemsize + contacts * _CONTACT.itemsize)
                + ((flags & _PLACEMENT) != 0) * _PLACEMENT_BYTES
                + ((flags & _COUNTS) != 0) * _COUNTS_BYTES
                + ((flags & _GRIPPER) != 0) * 8
            )
            wrong = (contacts > _MAX_CONTACTS) | (following > end)
            if np.any(wrong):
                raise self._fail(int(at[wrong][0]), "a damaged tick")
            found.append(at)
            at = following
        return np.sort(np.concatenate([np.empty(0, dtype=np.int64), *found]))

    def _gather(self, at: "npt.NDArray[np.int64]", dtype: "np.dtype[Any]") -> "npt.NDArray[Any]":
        """Values at these bytes of the file, in the machine's order."""
        self._check_open()
        base, shape = (dtype.subdtype or (dtype, ()))[:2]
        if not len(at):
            return np.empty((0, *shape), base.newbyteorder("="))
        # One item for each byte of the file, overlapping: numpy copies items faster than rows.
        width = dtype.itemsize
        items: npt.NDArray[Any] = np.ndarray((len(self._data) - width + 1,), f"V{width}", self._data, 0, (1,))
        return items[at].view(base).reshape(len(at), *shape).astype(base.newbyteorder("="))

    def commands(self) -> Iterator[Command]:
        """The commands of all scenes in the order of their execution."""
        for kind, start, length in self._blocks:
            if kind != _SCENE:
                continue
            unpack = self._content(start, length)
            try:
                scene, client, time, number = unpack.one("I"), unpack.one("I"), unpack.one("q"), unpack.one("H")
                if number not in _COMMANDS:
                    raise self._fail(start, f"unknown scene command number {number}; use the hapticd that wrote the file")
                name, members = _COMMANDS[number]
                fields = {member: unpack.value(form) for member, form in members}
            except _Cut:
                raise self._fail(start, "a scene event is truncated") from None
            yield Command(int(self._wall(time)), scene, client, name, fields)

    @property
    def markers(self) -> Tuple[Marker, ...]:
        """The moments that clients marked, such as "trial 3 begins", in the order in which the server received them.
        Raises RecordingError for a damaged one."""
        self._check_open()
        found = []
        for kind, start, length in self._blocks:
            if kind != _MARKER:
                continue
            unpack = self._content(start, length)
            try:
                found.append(Marker(int(self._wall(unpack.one("q"))), unpack.text()))
            except _Cut:
                raise self._fail(start, "a marker is truncated") from None
            if unpack.at != length:
                raise self._fail(start, "a marker is longer than its content")
        return tuple(found)

    @property
    def lost(self) -> Tuple[Lost, ...]:
        """Where data is missing; empty in most recordings. Raises RecordingError for a damaged statement."""
        self._check_open()
        found = []
        for kind, start, length in self._blocks:
            if kind == _LOST:
                unpack = self._content(start, length)
                try:
                    what, device, count = unpack.one("i"), unpack.one("I"), unpack.one("Q")
                except _Cut:
                    raise self._fail(start, "a loss is truncated") from None
                found.append(Lost({0: "ticks", 1: "scene events"}.get(what, "streamed values"), device, count))
        return tuple(found)

    @staticmethod
    def trips(bits: int) -> Trips:
        """The trips of a guard column, with their names."""
        return Trips(int(bits))
