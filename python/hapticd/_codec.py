"""Payloads of messages as values: the engine below the generated table of messages."""

import math
import struct
from contextlib import suppress
from numbers import Real
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

    def encode(self, message: M, finite: bool = False) -> bytes:
        """The payload of a message. Raises ValueError for a value that does not fit its field; `finite`: for a number that
        is not finite, too, as no command has any."""
        try:
            return self._encode(message, finite)
        except (struct.error, OverflowError, TypeError) as error:
            wrong = next(filter(None, map(_misfit, message, self.fields)), str(error))
            raise ValueError(f"{self.name}: {wrong}") from error

    def _encode(self, message: M, finite: bool) -> bytes:
        values: List[Any] = []
        tail = b""
        for value, field in zip(message, self.fields):
            if field.form in ("name", "text"):
                values.append(_text(value, field))
                continue
            numbers = (value,) if field.form == "one" else value
            if field.form == "list":
                if len(numbers) > field.count:
                    raise ValueError(f"{self.name}: {field.name} has {len(numbers)} values, at most {field.count}")
                values.append(len(numbers))
                tail = struct.pack(f">{len(numbers)}{field.letter}", *numbers)
            elif len(numbers) != field.count:
                raise ValueError(f"{self.name}: {field.name} is {shortened(value)}, expected {field.count} numbers")
            else:
                values.extend(numbers)
            if finite and field.letter in "fd" and not all(map(math.isfinite, numbers)):
                raise OverflowError  # encode() says which
        return self._struct.pack(*values) + tail


def shortened(value: Any) -> str:
    """A value as error texts name it."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 100 else text[:97] + "..."


def _misfit(value: Any, field: _Field) -> str:
    """Why a value does not fit its field; empty when it does."""
    if field.form in ("name", "text"):
        return "" if isinstance(value, str) else f"{field.name} is {shortened(value)}, expected a text"
    expected = _EXPECTED.get(field.letter, "a number")
    if field.form != "one" and not has_length(value):
        return f"{field.name} is {shortened(value)}, expected a list of numbers"
    for one in (value,) if field.form == "one" else value:
        try:
            struct.pack(">" + field.letter, one)
            if field.letter in "fd" and not math.isfinite(one):
                raise OverflowError
        except (struct.error, OverflowError, TypeError):
            return f"{field.name} {'is' if field.form == 'one' else 'has'} {shortened(one)}, expected {expected}"
    return ""


def _integer(bits: int, signed: bool) -> str:
    least = -(1 << (bits - 1)) if signed else 0
    return f"an integer from {least} to {least + (1 << bits) - 1}"


_EXPECTED = {letter: _integer(8 * struct.calcsize(">" + letter), letter.islower()) for letter in "BhiIqQ"}
_EXPECTED.update(d="a finite number", f="a finite number, at most 3.4e38")


def _text(value: str, field: _Field) -> bytes:
    if not isinstance(value, str):
        raise TypeError
    encoded = utf8(value, field.name)
    most = field.count - 1 if field.form == "text" else field.count
    if len(encoded) > most:
        raise ValueError(f"{field.name} {value!r} has {len(encoded)} bytes, at most {most}")
    if b"\0" in encoded:  # the receiver would take it for the end
        raise ValueError(f"{field.name} {value!r} has a NUL character")
    return encoded


#: What a terminal would obey, and what is no character: C0, DEL, C1 and two others.
_UNPRINTABLE = dict.fromkeys((*range(0x20), *range(0x7F, 0xA0), 0xFFFE, 0xFFFF), "\N{REPLACEMENT CHARACTER}")


def printable(text: str) -> str:
    """A text of somebody else as one line, safe for terminals: control characters become U+FFFD, as in the C++ client."""
    return text.translate(_UNPRINTABLE)


def utf8(text: str, what: str) -> bytes:
    """A text as messages carry it. Raises ValueError for half a character, as in names of files that are no UTF-8."""
    try:
        return text.encode()
    except UnicodeEncodeError as error:
        raise ValueError(f"{what} {shortened(text)}: give a text without surrogates, which UTF-8 cannot carry") from error


def has_length(value: Any) -> bool:
    """Whether a value is a list: an array of one number without axes has len(), too, which raises."""
    try:
        return len(value) >= 0
    except TypeError:
        return False


def is_number(value: Any) -> bool:
    """Whether a value is a number that a float can hold, and not NaN."""
    try:
        return isinstance(value, Real) and not math.isnan(value)
    except OverflowError:
        return False


def real_array(values: Any, what: str, expected: str) -> "npt.NDArray[Any]":
    """Numbers as an array; the names are for error texts. Raises ValueError for texts, complex and masked numbers, and rows of
    different lengths."""
    try:
        array = np.asarray(values)
        if array.dtype.kind == "O":
            array = array.astype(np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{what} {shortened(values)}: give {expected}") from error
    if array.dtype.kind not in "biuf":
        raise ValueError(f"{what} of type {array.dtype}: give {expected}")
    if isinstance(values, np.ma.MaskedArray) and np.any(values.mask):
        raise ValueError(f"{what} with masked values: give {expected}, without a mask")
    return array


def vector(values: Any, what: str, expected: str) -> "npt.NDArray[np.float64]":
    """Three finite numbers as an array; the names are for error texts. Raises ValueError."""
    with suppress(ValueError):
        array = real_array(values, what, expected).astype(np.float64)
        if array.shape == (3,) and np.isfinite(array).all():
            return array
    raise ValueError(f"{what} {shortened(values)}: give {expected}")


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
