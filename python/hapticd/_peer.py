"""One side of one VRPN connection without a socket: bytes in, calls out; messages in, bytes out."""

import struct
import time
from typing import Dict, Final, List, Optional, Protocol, Sequence, Tuple

from . import _messages
from ._codec import HEADER, HEADER_BYTES, MAX_FRAME_BYTES, frame, padded

COOKIE_BYTES: Final = 24
COOKIE: Final = b"vrpn: ver. 07.38  0".ljust(COOKIE_BYTES, b"\0")
DEFAULT_PORT: Final = 3883
MAX_NAME_BYTES: Final = 95
MAX_DATAGRAM_BYTES: Final = 1472
_MAX_NAMES: Final = 2000
_SENDER, _TYPE, _UDP, _LOG = -1, -2, -3, -4
_LOWEST_TYPE: Final = -2000

#: Wire name of each message by its number here, which is the position in the table.
TYPE_NAMES: Final = tuple(layout.name for layout in _messages.LAYOUTS)
_NUMBER_OF: Final[Dict[bytes, int]] = {name.encode(): number for number, name in enumerate(TYPE_NAMES)}
UNKNOWN: Final = -1


class ProtocolError(Exception):
    """The peer violated the protocol: close the connection."""


class Handler(Protocol):
    """Receives what a peer reads."""

    def _peer_connected(self) -> None:
        """The peer's cookie is valid; messages can be sent from now on."""

    def _peer_described(self, sender: str) -> None:
        """The peer has a device of this name."""

    def _peer_listens(self, host: str, port: int) -> None:
        """The peer takes datagrams there."""

    def _peer_message(self, kind: int, sender: str, seconds: int, microseconds: int, payload: bytes) -> None:
        """A message; its kind is the position in the table, or UNKNOWN."""


def now() -> Tuple[int, int]:
    """Wall-clock time as messages carry it: seconds and microseconds."""
    microseconds = time.time_ns() // 1000
    return microseconds // 1000000, microseconds % 1000000


def _description(name: bytes) -> bytes:
    return struct.pack(">i", len(name) + 1) + name + b"\0"


def _short(text: bytes) -> str:
    return repr(text[:64].decode("latin-1"))


class Peer:
    """The state machine. The number of a sender or type on our side is its position in `senders` or the table."""

    def __init__(self, handler: Handler, senders: Sequence[str], udp: Optional[Tuple[str, int]]) -> None:
        self._handler = handler
        self._senders = senders
        self._udp = udp
        self._rest = b""
        self._their_senders: Dict[int, str] = {}
        self._their_types: Dict[int, int] = {}
        self.connected = False
        self.use_datagrams = False
        self.stream: List[bytes] = [COOKIE]
        self.stream_bytes = COOKIE_BYTES
        self._datagrams: List[bytes] = []

    # --- receiving

    def feed(self, data: bytes) -> None:
        """Takes bytes of the TCP stream, cut anywhere. Raises ProtocolError."""
        if self._rest:
            data = self._rest + data
        at = 0
        if not self.connected:
            if len(data) < COOKIE_BYTES:
                self._rest = data
                return
            self._read_cookie(data[:COOKIE_BYTES])
            at = COOKIE_BYTES
        at = self._read_frames(data, at, datagram=False)
        self._rest = data[at:] if at < len(data) else b""

    def feed_datagram(self, data: bytes) -> None:
        """Takes one datagram; ignores damaged ones and system messages, because datagrams can be forged."""
        if self.connected:
            self._read_frames(data, 0, datagram=True)

    def _read_frames(self, data: bytes, at: int, datagram: bool) -> int:
        unpack = HEADER.unpack_from
        end = len(data)
        types, senders, message = self._their_types, self._their_senders, self._handler._peer_message
        while end - at >= HEADER_BYTES:
            length, seconds, microseconds, sender, type_, _ = unpack(data, at)
            if not HEADER_BYTES <= length <= MAX_FRAME_BYTES:
                if datagram:
                    return end
                raise ProtocolError(f"frame of {length} bytes, expected {HEADER_BYTES} to {MAX_FRAME_BYTES}")
            following = at + ((length + 7) & ~7)
            if following > end:
                break
            payload = data[at + HEADER_BYTES : at + length]
            at = following
            if type_ >= 0:
                kind = types.get(type_)
                name = senders.get(sender)
                if kind is not None and name is not None:
                    message(kind, name, seconds, microseconds, payload)
            elif not datagram:
                self._read_system(type_, sender, payload)
        return at

    def _read_cookie(self, cookie: bytes) -> None:
        if not cookie.startswith(b"vrpn: ver. 07."):
            raise ProtocolError(f"it opened with {_short(cookie)}, expected 'vrpn: ver. 07.xx'")
        self.connected = True
        seconds, microseconds = now()
        if self._udp is not None:
            host, port = self._udp
            self.send_frames(frame(seconds, microseconds, port, _UDP, host.encode() + b"\0"))
        for number, name in enumerate(self._senders):
            self.send_frames(frame(seconds, microseconds, number, _SENDER, _description(name.encode())))
        for number, name in enumerate(TYPE_NAMES):
            self.send_frames(frame(seconds, microseconds, number, _TYPE, _description(name.encode())))
        self._handler._peer_connected()

    def _read_system(self, type_: int, sender: int, payload: bytes) -> None:
        if type_ in (_SENDER, _TYPE):
            if not 0 <= sender < _MAX_NAMES:
                raise ProtocolError(f"description of number {sender}, expected 0 to {_MAX_NAMES - 1}")
            if len(payload) < 5:
                raise ProtocolError(f"description of {len(payload)} bytes, expected at least 5")
            (length,) = struct.unpack_from(">i", payload)
            if not 1 <= length <= len(payload) - 4:
                raise ProtocolError(f"description says its name has {length} bytes, it has {len(payload) - 4}")
            name = payload[4 : 4 + length].split(b"\0", 1)[0]
            if type_ == _SENDER:
                self._their_senders[sender] = name.decode("utf-8", "replace")
                self._handler._peer_described(self._their_senders[sender])
            else:
                self._their_types[sender] = _NUMBER_OF.get(name, UNKNOWN)
        elif type_ == _UDP:
            if self._udp is not None:
                self._handler._peer_listens(payload.split(b"\0", 1)[0].decode("latin-1"), sender)
        elif type_ <= _LOWEST_TYPE:
            raise ProtocolError(f"message of type {type_}, the lowest is {_LOWEST_TYPE + 1}")

    # --- sending

    def send_frames(self, frames: bytes) -> None:
        """Appends whole frames to the TCP stream."""
        self.stream.append(frames)
        self.stream_bytes += len(frames)

    def send_fast(self, one: bytes) -> None:
        """Sends a frame by datagram where the connection has them."""
        if self.use_datagrams and len(one) <= MAX_DATAGRAM_BYTES:
            self._datagrams.append(one)
        else:
            self.send_frames(one)

    def take_stream(self) -> bytes:
        """The bytes to be written to the TCP stream."""
        stream, self.stream, self.stream_bytes = self.stream, [], 0
        return stream[0] if len(stream) == 1 else b"".join(stream)

    def take_datagrams(self) -> List[bytes]:
        """The datagrams to be sent, each with as many frames as fit."""
        result: List[bytes] = []
        for one in self._datagrams:
            if result and len(result[-1]) + len(one) <= MAX_DATAGRAM_BYTES:
                result[-1] += one
            else:
                result.append(one)
        self._datagrams = []
        return result


def header_bytes(payload_bytes: int) -> int:
    """Bytes of a frame with this payload."""
    return padded(HEADER_BYTES + payload_bytes)
