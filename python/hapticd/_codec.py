"""Payloads of messages as values: the engine below the generated table of messages."""

import struct
from typing import Any, Dict, Generic, List, NamedTuple, Sequence, Tuple, Type, TypeVar, Union

import numpy as np
import numpy.typing as npt

#: Any vector of numbers: a tuple, a list or a numpy array.
Numbers = Union[Sequence[float], "npt.NDArray[Any]"]
#: Three numbers; decoded messages have tuples.
Vec3 = Numbers
#: Four numbers, such as a quaternion x y z w.
Vec4 = Numbers

M = TypeVar("M", bound=Tuple[Any, ...])

HEADER = struct.Struct(">IIIiiI")
HEADER_BYTES = HEADER.size
MAX_FRAME_BYTES = 64024


class DecodeError(ValueError):
    """A payload does not have the layout of its message."""


class _Field(NamedTuple):
    name: str
    form: str  # "one", "array", "name", "text", "list"
    count: int  # type: ignore[assignment]  # of numbers, or bytes of a text, or the longest list
    count_letter: str = ""
    letter: str = ""


def _field(row: Tuple[Any, ...]) -> _Field:
    name, kind = row[0], row[1]
    if kind in ("name", "text"):
        return _Field(name, kind, row[2])
    if kind.startswith("list"):
        return _Field(name, "list", row[2], kind[4], kind[5])
    if len(row) == 3:
        return _Field(name, "array", row[2], "", kind)
    return _Field(name, "one", 1, "", kind)


class Layout(Generic[M]):
    """Wire name and layout of one message."""

    def __init__(self, cls: Type[M], name: str, rows: Tuple[Tuple[Any, ...], ...]) -> None:
        self.cls = cls
        self.name = name
        self.fields = tuple(_field(row) for row in rows)
        letters = ""
        picks: List[Union[int, slice]] = []
        self._texts: List[Tuple[int, _Field]] = []
        self._list = self.fields[-1] if self.fields and self.fields[-1].form == "list" else None
        at = 0
        for position, field in enumerate(self.fields):
            if field.form in ("name", "text"):
                letters += f"{field.count}s"
                self._texts.append((position, field))
            elif field.form == "list":
                letters += field.count_letter
            else:
                letters += field.letter * field.count
            width = field.count if field.form == "array" else 1
            picks.append(slice(at, at + width) if field.form == "array" else at)
            at += width
        self._struct = struct.Struct(">" + letters)
        self._picks = tuple(picks)
        self._flat = not self._texts and self._list is None
        self._plain = self._flat and all(isinstance(p, int) for p in picks)
        self.payload_bytes = self._struct.size
        self._make = cls._make  # type: ignore[attr-defined]

    def decode(self, payload: bytes) -> M:
        """The message of a payload. Raises DecodeError for a payload of another length."""
        try:
            if self._list is not None:
                return self._decode_list(payload)
            values = self._struct.unpack(payload)
        except struct.error as error:
            raise DecodeError(f"{self.name} of {len(payload)} bytes, expected {self.payload_bytes}") from error
        if self._plain:
            return self._make(values)  # type: ignore[no-any-return]
        items: List[Any] = [values[pick] for pick in self._picks]
        for position, field in self._texts:
            text = items[position].split(b"\0", 1)[0]
            items[position] = text.decode("utf-8", "replace")
        return self._make(items)  # type: ignore[no-any-return]

    def _decode_list(self, payload: bytes) -> M:
        assert self._list is not None
        values = self._struct.unpack_from(payload)
        number = values[-1]
        if not 0 <= number <= self._list.count or number != int(number):
            raise DecodeError(f"{self.name} with a list of {number} values, at most {self._list.count}")
        items: List[Any] = [values[pick] for pick in self._picks]
        items[-1] = struct.unpack_from(f">{int(number)}{self._list.letter}", payload, self._struct.size)
        return self._make(items)  # type: ignore[no-any-return]

    def encode(self, message: M) -> bytes:
        """The payload of a message. Raises ValueError for a value that does not fit its field."""
        values: List[Any] = []
        tail = b""
        for value, field in zip(message, self.fields):
            if field.form == "one":
                values.append(value)
            elif field.form == "array":
                if len(value) != field.count:
                    raise ValueError(f"{self.name}: {field.name} needs {field.count} numbers, got {len(value)}")
                values.extend(value)
            elif field.form == "list":
                if len(value) > field.count:
                    raise ValueError(f"{self.name}: {field.name} has {len(value)} values, at most {field.count}")
                values.append(len(value))
                tail = np.asarray(value).astype(">" + _DTYPES[field.letter]).tobytes()
            else:
                values.append(_text(value, field))
        try:
            return self._struct.pack(*values) + tail
        except (struct.error, OverflowError) as error:
            raise ValueError(f"{self.name}: {error}, got {message!r}") from error


_DTYPES = {"B": "u1", "h": "i2", "i": "i4", "I": "u4", "q": "i8", "Q": "u8", "f": "f4", "d": "f8"}


def _text(value: str, field: _Field) -> bytes:
    encoded = value.encode("utf-8")
    most = field.count - 1 if field.form == "text" else field.count
    if len(encoded) > most:
        raise ValueError(f"{field.name} {value!r} has {len(encoded)} bytes, at most {most}")
    if b"\0" in encoded:  # the receiver would take it for the end
        raise ValueError(f"{field.name} {value!r} has a NUL character")
    return encoded


def define(cls: Type[M], name: str, rows: Tuple[Tuple[Any, ...], ...]) -> Layout[M]:
    """The layout of a message class."""
    return Layout(cls, name, rows)


def padded(size: int) -> int:
    """The size with padding to a multiple of 8."""
    return (size + 7) & ~7


def frame(seconds: int, microseconds: int, sender: int, type_: int, payload: bytes) -> bytes:
    """A whole frame: header, payload, padding."""
    size = HEADER_BYTES + len(payload)
    return HEADER.pack(size, seconds, microseconds, sender, type_, 0) + payload + bytes(padded(size) - size)


def by_class(layouts: Sequence[Layout[Any]]) -> Dict[Type[Any], Tuple[int, Layout[Any]]]:
    """Position and layout of each message class."""
    return {layout.cls: (number, layout) for number, layout in enumerate(layouts)}
