"""Addresses as VRPN writes them."""

import re
import socket
import threading
from contextlib import suppress
from typing import NamedTuple, Optional, Tuple

from ._codec import shortened, utf8
from ._peer import DEFAULT_PORT, MAX_NAME_BYTES
from .errors import ConnectError


class Address(NamedTuple):
    """One device of one server."""

    device: str
    host: str
    port: int
    tcp_only: bool

    @property
    def server(self) -> str:
        return f"{self.host}:{self.port}"


_FORM = re.compile(r"(?:(tcp:)|x-vrpn:)?(?://)?([^\s/@:]{1,255})(?::(.*))?", re.ASCII)


def parse(text: str) -> Address:
    """NAME@host, NAME@host:port or NAME@tcp://host:port. Raises ValueError for another form."""
    form = "NAME@host, NAME@host:port or NAME@tcp://host:port"
    if not isinstance(text, str):
        raise ValueError(f"device {shortened(text)}: expected {form}")
    device, at, rest = text.partition("@")
    if not at or not device or "\0" in device:
        raise ValueError(f"device {text!r}: expected {form}")
    size = len(utf8(device, "device"))
    if size > MAX_NAME_BYTES:
        raise ValueError(f"device {shortened(text)}: a name of {size} bytes, at most {MAX_NAME_BYTES}")
    if rest.startswith(("[", "tcp://[")) or rest.count("::"):
        raise ValueError(f"device {text!r}: IPv6 addresses are not supported; use a name or an IPv4 address")
    match = _FORM.fullmatch(rest)
    if match is None or (match.group(3) or "").startswith("/"):
        raise ValueError(f"device {text!r}: expected {form}")
    tcp, host, digits = match.groups()
    port = DEFAULT_PORT
    if digits is not None:
        if not re.fullmatch(r"[0-9]{1,5}", digits) or not 1 <= int(digits) <= 65535:
            raise ValueError(f"device {text!r}: port {digits!r}, expected 1 to 65535")
        port = int(digits)
    return Address(device, host, port, tcp is not None)


def resolve(address: Address) -> Tuple[str, int]:
    """Numeric IPv4 address and port; may block. Raises ConnectError for an unknown host."""
    try:
        found = socket.getaddrinfo(address.host, address.port, socket.AF_INET, socket.SOCK_STREAM)
    except (OSError, UnicodeError) as error:  # the latter for a name that no host can have
        raise ConnectError(f"no server at {address.server}: {error}") from error
    host, port = found[0][4][:2]
    return str(host), int(port)


class HostLookup:
    """The address of a host by its name: a server may come back under another address."""

    def __init__(self, address: Address) -> None:
        """Asks the system, which may block. Raises ConnectError for an unknown host."""
        self._asked = address
        self._thread: Optional[threading.Thread] = None
        #: The last address that is known, and the port.
        self.target = resolve(address)

    def ask_again(self) -> None:
        """In a thread of its own, because the system may take many seconds for the answer; nothing waits for it. Without
        an answer the last address stays."""
        is_number = self.target[0] == self._asked.host
        if is_number or (self._thread is not None and self._thread.is_alive()):
            return
        self._thread = threading.Thread(target=self._ask, name="find-host", daemon=True)
        with suppress(RuntimeError):  # no thread at this time: the next attempt asks
            self._thread.start()

    def _ask(self) -> None:
        with suppress(ConnectError):  # unknown at this time
            self.target = resolve(self._asked)


def local_towards(server: Tuple[str, int]) -> str:
    """Our own address on the way to the server. Sends nothing. Raises OSError."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.connect(server)
        return str(probe.getsockname()[0])
