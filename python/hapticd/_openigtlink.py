"""Messages of OpenIGTLink as pure functions: bytes to values, values to bytes.

A message is a header of 58 bytes and a body. With header version 1 the body is the content; from version 2 on the content
stands between an extended header and metadata. Numbers are big-endian; texts in fixed fields end with a zero byte.
"""

import struct
from typing import Any, Iterator, List, NamedTuple, Tuple

import numpy as np
import numpy.typing as npt

HEADER = struct.Struct(">H12s20sQQQ")
#: A longer body is skipped.
MAX_BODY_BYTES = 64 << 20
#: A body that claims to be longer is taken for a stream of something else.
_CREDIBLE_BYTES = 1 << 30
_EXTENDED = struct.Struct(">HHII")
_POLYDATA = struct.Struct(">10I")
_STATUS_OK, _STATUS_NOT_READY = 1, 13
_US_ASCII = 3

#: ECMA-182, most significant bit first, from 0, without an inversion.
_POLYNOMIAL = 0x42F0E1EBA9EA3693
_ALL = (1 << 64) - 1
_LANES = 4096

Array = npt.NDArray[Any]


class StreamError(ValueError):
    """The header is none: where the next message begins is not known."""


class MessageError(ValueError):
    """The message is of no use; the next one begins behind it."""


class Header(NamedTuple):
    version: int
    type: str
    name: str
    size: int  # of the body, in bytes
    crc: int


# --- CRC


def _table() -> Array:
    entries = np.arange(256, dtype=np.uint64) << np.uint64(56)
    for _ in range(8):
        entries = _doubled(entries)
    return entries


def _doubled(values: Array) -> Array:
    """x times each polynomial."""
    return (values << np.uint64(1)) ^ (values >> np.uint64(63)) * np.uint64(_POLYNOMIAL)


def _times(values: Array, factor: int) -> Array:
    """Products of polynomials with one other."""
    result = np.zeros_like(values)
    for bit in range(63, -1, -1):
        result = _doubled(result)
        if factor >> bit & 1:
            result ^= values
    return result


_TABLE = _table()
_ENTRIES: List[int] = _TABLE.tolist()


def crc64(data: bytes) -> int:
    """The CRC of a body. Long bodies are cut into pieces whose CRCs are computed side by side."""
    if len(data) < 8 * _LANES:
        crc = 0
        for byte in data:
            crc = (crc << 8 & _ALL) ^ _ENTRIES[crc >> 56 ^ byte]
        return crc
    length = -(-len(data) // _LANES)
    pieces = np.zeros(_LANES * length, dtype=np.uint8)
    pieces[_LANES * length - len(data) :] = np.frombuffer(data, dtype=np.uint8)  # zeros in front change nothing
    crcs = np.zeros(_LANES, dtype=np.uint64)
    for column in np.ascontiguousarray(pieces.reshape(_LANES, length).T):
        crcs = (crcs << np.uint64(8)) ^ _TABLE[(crcs >> np.uint64(56)).astype(np.uint8) ^ column]
    shift = _power(8 * length)
    while len(crcs) > 1:
        crcs = _times(crcs[0::2], shift) ^ crcs[1::2]
        shift = int(_times(np.array([shift], dtype=np.uint64), shift)[0])
    return int(crcs[0])


def _power(exponent: int) -> int:
    """x to this exponent."""
    result, square = np.array([1], dtype=np.uint64), np.array([2], dtype=np.uint64)
    while exponent:
        if exponent & 1:
            result = _times(result, int(square[0]))
        square = _times(square, int(square[0]))
        exponent >>= 1
    return int(result[0])


# --- Reading


def _text(field: bytes) -> str:
    return field.split(b"\0", 1)[0].decode("utf-8", "replace")


def parse_header(data: bytes) -> Header:
    """Raises StreamError."""
    version, kind, name, _, size, crc = HEADER.unpack(data)
    if not 1 <= version <= 3:
        raise StreamError(f"a header of version {version}, expected 1 to 3: is this an OpenIGTLink client?")
    if size > _CREDIBLE_BYTES:
        raise StreamError(f"a message {_text(kind)!r} of {size} bytes, at most {MAX_BODY_BYTES} are read")
    return Header(version, _text(kind), _text(name), size, crc)


def content_of(header: Header, body: bytes) -> bytes:
    """The content of a message. Raises MessageError for a wrong CRC, and for an extended header or metadata beyond the body."""
    crc = crc64(body)
    if crc != header.crc:
        raise MessageError(f"its CRC is {header.crc:016x}, that of its body is {crc:016x}: the bytes changed on their way")
    if header.version == 1:
        return body
    if len(body) < _EXTENDED.size:
        raise MessageError(f"a body of {len(body)} bytes has no room for the extended header of {_EXTENDED.size}")
    extended, metadata_header, metadata, _ = _EXTENDED.unpack_from(body)
    end = len(body) - metadata_header - metadata
    if not _EXTENDED.size <= extended <= end:
        raise MessageError(f"an extended header of {extended} and metadata of {metadata_header + metadata} in a body of {len(body)} bytes")
    return body[extended:end]


def read_transform(content: bytes) -> "npt.NDArray[np.float64]":
    """A 4x4 matrix with the translation in [:3, 3], millimetres. Raises MessageError."""
    if len(content) != 48:
        raise MessageError(f"its content has {len(content)} bytes, expected 48")
    numbers = np.frombuffer(content, dtype=">f4")
    if not np.isfinite(numbers).all():
        raise MessageError(f"its matrix is {numbers.tolist()}, expected finite numbers")
    matrix = np.eye(4)
    matrix[:3] = numbers.reshape(4, 3).T
    return matrix


def read_string(content: bytes) -> str:
    """A text; bytes that are no UTF-8 become U+FFFD. Raises MessageError."""
    if len(content) < 4 or len(content) != 4 + int.from_bytes(content[2:4], "big"):
        raise MessageError(f"its content of {len(content)} bytes is not as long as it states")
    return content[4:].decode("utf-8", "replace")


def read_polydata(content: bytes) -> Tuple[Array, Array]:
    """Points (n, 3) and triangles (m, 3) of polygons and triangle strips; vertices, lines and attributes are left out. Raises
    MessageError."""
    if len(content) < _POLYDATA.size:
        raise MessageError(f"its content of {len(content)} bytes has no room for the table of {_POLYDATA.size}")
    points, _, vertices, _, lines, polygons, polygon_bytes, strips, strip_bytes, _ = _POLYDATA.unpack_from(content)
    at_polygons = _POLYDATA.size + 12 * points + vertices + lines
    at_strips = at_polygons + polygon_bytes
    if at_strips + strip_bytes > len(content):
        raise MessageError(f"its parts have {at_strips + strip_bytes} bytes, but the content {len(content)}")
    positions = np.frombuffer(content, ">f4", 3 * points, _POLYDATA.size).reshape(-1, 3).astype(np.float32)
    wrong = np.flatnonzero(~np.isfinite(positions).all(axis=1))
    if wrong.size:
        raise MessageError(f"point {wrong[0]} is {positions[wrong[0]].tolist()}, expected finite numbers")
    fans = [_fan(cells) for cells in _cells(content[at_polygons:at_strips], polygons, "polygons")]
    bands = [_band(cells) for cells in _cells(content[at_strips : at_strips + strip_bytes], strips, "triangle strips")]
    triangles = np.concatenate([np.empty((0, 3), dtype=np.uint32), *fans, *bands])
    if triangles.size and triangles.max() >= points:
        raise MessageError(f"a triangle names point {triangles.max()}, there are {points}")
    return positions, triangles.astype(np.int32)


def _cells(data: bytes, count: int, what: str) -> Iterator[Array]:
    """Point numbers of cells, (cells, corners): one array for each number of corners."""
    wrong = MessageError(f"{count} {what} do not fill their {len(data)} bytes")
    if len(data) % 4 or 4 * count > len(data):
        raise wrong
    words = np.frombuffer(data, dtype=">u4").astype(np.uint32)
    if count and len(words) % count == 0:
        rows = words.reshape(count, -1)
        if (rows[:, 0] == rows.shape[1] - 1).all():
            yield rows[:, 1:]
            return
    starts, at = np.empty(count, dtype=np.int64), 0
    for cell in range(count):
        if at >= len(words):
            raise wrong
        starts[cell] = at
        at += 1 + int(words[at])
    if at != len(words):
        raise wrong
    sizes = words[starts]
    starts = starts[np.argsort(sizes, kind="stable")]
    each, counts = np.unique(sizes, return_counts=True)
    for size, first in zip(each.tolist(), np.split(starts, np.cumsum(counts)[:-1])):
        yield words[first[:, None] + np.arange(1, size + 1)]


def _fan(cells: Array) -> Array:
    """Triangles of convex polygons."""
    second, third = cells[:, 1:-1], cells[:, 2:]
    triangles: Array = np.stack([np.broadcast_to(cells[:, :1], third.shape), second, third], axis=-1).reshape(-1, 3)
    return triangles


def _band(cells: Array) -> Array:
    """Triangles of strips; every second one has its corners the other way round."""
    triangles: Array = np.stack([cells[:, :-2], cells[:, 1:-1], cells[:, 2:]], axis=-1)
    triangles[:, 1::2] = triangles[:, 1::2, [1, 0, 2]]
    triangles = triangles.reshape(-1, 3)
    return triangles


# --- Writing


def message(type: str, name: str, content: bytes, time_s: float) -> bytes:
    """A whole message with a header of version 1, which every receiver reads."""
    stamp = int(time_s * (1 << 32)) & _ALL
    return HEADER.pack(1, type.encode("ascii"), name.encode("ascii"), stamp, len(content), crc64(content)) + content


def transform_content(matrix: Array) -> bytes:
    """Content of TRANSFORM: the columns of the matrix, without its last row."""
    return np.asarray(matrix, dtype=np.float64)[:3].T.astype(">f4").tobytes()


def string_content(text: str) -> bytes:
    """Content of STRING."""
    data = text.encode("ascii")
    return struct.pack(">HH", _US_ASCII, len(data)) + data


def capability_content(types: Tuple[str, ...]) -> bytes:
    """Content of CAPABILITY: the types that the sender reads."""
    return b"".join(type.encode("ascii").ljust(12, b"\0") for type in types)


def status_content(problem: str) -> bytes:
    """Content of STATUS; an empty text: all is well."""
    code, name = (_STATUS_NOT_READY, b"NotReady") if problem else (_STATUS_OK, b"OK")
    return struct.pack(">Hq20s", code, 0, name) + problem.encode("utf-8", "replace") + b"\0"
