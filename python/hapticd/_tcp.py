"""What the system knows of a TCP connection beyond its bytes, where it says so."""

import select
import socket
import struct
import sys
import time
from typing import Any, Optional

#: Options of the system's probes: macOS has another name for the first, and systems may lack some.
_PROBES = ((("TCP_KEEPIDLE", "TCP_KEEPALIVE"), 5), (("TCP_KEEPINTVL",), 5), (("TCP_KEEPCNT",), 3))
_LOSS_CHECK_S = 0.5
#: Of Linux's tcp_info: tcpi_unacked, tcpi_last_data_recv and tcpi_last_ack_recv, and tcpi_snd_wnd (since Linux 5.4).
_TCP_INFO = struct.Struct("=24xI24xII")
_TCP_INFO_WINDOW = slice(228, 232)


def unacknowledged(sock: socket.socket) -> int:
    """Bytes of a TCP stream that the system has and the peer has not acknowledged; 0 where the system does not say."""
    if sys.platform != "linux":
        return 0
    import fcntl
    import termios

    answer = fcntl.ioctl(sock.fileno(), termios.TIOCOUTQ, bytes(4))
    return int.from_bytes(answer, sys.byteorder)


def has_ended(sock: socket.socket) -> bool:
    """Whether the peer has ended a TCP connection, even while data that it sent before waits to be read; false where
    the system does not say."""
    if sys.platform != "linux":
        return False
    waiting = select.poll()
    waiting.register(sock.fileno(), select.POLLRDHUP)  # errors are reported in any case
    return bool(waiting.poll(0))


class LossWatch:
    """Notices that the peer's machine is gone, or the way to it, as the C++ client does. The system probes an idle peer
    after 5 s and ends the connection when three probes have no answer. While sent bytes wait for an acknowledgement it
    does not probe, and itself waits for a quarter of an hour: where it says so (on Linux), the peer is lost when nothing
    has come from it for the timeout. A peer whose program does not read still acknowledges, and is not lost; the timeout
    of the system (TCP_USER_TIMEOUT) would end it."""

    def __init__(self, sock: Any, timeout: float) -> None:
        """Raises OSError."""
        self._sock = sock
        self._timeout = timeout
        self._checked = time.monotonic()
        self._waited: Optional[float] = None  # since an acknowledgement became due
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for names, value in _PROBES:
            option = next((getattr(socket, name) for name in names if hasattr(socket, name)), None)
            if option is not None:
                sock.setsockopt(socket.IPPROTO_TCP, option, value)

    def is_lost(self) -> bool:
        """To be called at least every second. After a stall of this machine the answers are still in its queues, so the
        time between two checks counts for two seconds at most."""
        at = time.monotonic()
        gap = at - self._checked
        if sys.platform != "linux" or self._timeout <= 0 or gap < _LOSS_CHECK_S:
            return False
        self._checked = at
        info = self._sock.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, _TCP_INFO_WINDOW.stop)
        in_flight, *heard_ms = _TCP_INFO.unpack_from(info)
        closed = info[_TCP_INFO_WINDOW] == bytes(4)  # the peer takes no bytes at present
        if not in_flight or closed:
            self._waited = None
        elif self._waited is None:
            self._waited = 0.0
        else:
            self._waited = min(self._waited + min(gap, 2.0), min(heard_ms) / 1000)
        return self._waited is not None and self._waited >= self._timeout
