"""The synchronous client.

    with hapticd.connect("Phantom@localhost") as hand:     # connects, or raises and says why
        hand.set_surface(0, hapticd.Surface(stiffness=0.8))
        hand.upload_mesh(0, *hapticd.sphere(30))
        for report in hand.reports("force", seconds=5):    # sleeps, sends, receives
            print(report.force_N)
"""

import os
import selectors
import socket
import threading
import time
from collections import deque
from contextlib import contextmanager, suppress
from typing import Any, Callable, Deque, Iterator, List, Optional, Sequence, Tuple, Type

import numpy as np
import numpy.typing as npt

from . import _messages as m
from . import reports as r
from ._address import HostLookup, local_towards, parse
from ._codec import Numbers
from ._commands import function
from ._core import (
    BATCH_BYTES,
    CLOSED_BY_SERVER,
    END_CHECK_S,
    END_S,
    MAX_WAITING_BYTES,
    RETRY_S,
    STOP_BACKLOG_BYTES,
    Core,
    Ending,
    Options,
    UploadProgress,
    as_corners,
    as_triangles,
    as_vertices,
    duration,
    options_of,
)
from ._peer import ProtocolError
from ._tcp import LossWatch, has_ended, unacknowledged
from .errors import ConnectError, ConnectionLost
from .scene import Capabilities, RemoteContact, Reports

__all__ = ["Client", "connect"]

_RECEIVE_BYTES = 1 << 20
#: Ctrl-C while bytes are moved: how many were is not known, and what follows would not begin with a frame.
_INTERRUPTED = "interrupted in the middle of a message"
_CONNECT_PROGRESS = (10035, 36, 115, 11)  # WSAEWOULDBLOCK, EINPROGRESS (macOS, Linux), EAGAIN


class Client(Core):
    """One device of one server: hapticd's own, or any other that speaks VRPN.

    Thread: a client belongs to one thread and starts none, except to look its host up anew while it has no connection.
    Several clients may live in several threads. A call while another thread polls or waits raises RuntimeError, but
    stop_forces() and close() may come from any thread.

    Callbacks run in poll() and what polls (run_for(), reports(), rows()), in the order of arrival. An exception of a
    callback leaves poll() when the other callbacks have had the report; the remaining reports follow in the next poll(). A
    callback may call the client; what polls raises ConnectionLost when one has closed it.

    Commands are collected and sent by the next poll(), flush(), or when 64 KiB have accumulated. Every command may
    therefore sleep, while more than Options.queue_limit_bytes wait for a slow server; raise ConnectionLost, when the
    server accepts no data for Options.send_timeout or the connection ends during that sleep, and after close(); and
    raise ConnectError, when more than queue_limit_bytes wait for the first connection. Commands before the first
    connection are kept for it. Commands while a later connection is lost are dropped and counted: a restarted server
    has an empty scene, so rebuild it when on_connection() reports a connection. A refusal arrives as a text of severity
    error, see on_text(). A command of an extension raises Unsupported when the server or its device does not have it,
    and may wait for the server's answer to that question.
    """

    _ELSEWHERE = "is in use by another thread: connect one client for each thread; only stop_forces() and close() may come from any"

    def __init__(self, device: str, options: Options = Options()) -> None:
        address = parse(device)
        self._inside = 0  # the thread that moves bytes or sleeps
        self._pushing = False
        super().__init__(address, options)
        self._host = HostLookup(address)
        self._target = self._host.target  # of the attempt
        self._selector = selectors.DefaultSelector()
        self._sock: Optional[socket.socket] = None
        self._connecting = False
        self._udp: Optional[socket.socket] = None
        self._listener: Optional[socket.socket] = None
        self._request: Optional[socket.socket] = None
        self._request_text = b""
        self._loss: Optional[LossWatch] = None
        self._remote = ""  # numeric address of the server's side of the TCP connection
        self._request_at = 0.0
        self._retry_at = 0.0
        self._out: Deque[memoryview] = deque()
        self._out_bytes = 0
        self._uncounted = 0
        try:
            self._attempt()
            if options.connect_timeout > 0:
                self.wait_connected(options.connect_timeout)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Sends what is collected, waits until the server has read it and ended the connection, and closes all sockets.
        The server ends the client's forces. The wait ends, too, when a server that has received everything does not
        answer for 1 s, or when none receives anything for Options.send_timeout: the rest is then lost. Reports that
        arrive meanwhile are discarded. From then on every command, and everything that waits, raises ConnectionLost;
        `latest` and statistics() stay. Does nothing the second time. A `with` block that Ctrl-C ends waits no longer than
        1 s. A client whose last name is gone closes, too; a callback that uses the client is such a name, until the
        garbage collector runs. While another thread polls or waits, close() ends the connection without waiting, and that thread
        gets ConnectionLost."""
        self._close(float("inf"))

    def _close(self, longest: float) -> None:
        if self._finished:
            return
        if self._is_used_elsewhere():
            self._finished = True
            sock = self._sock
            if sock is not None:
                with suppress(OSError):  # it has ended already
                    sock.shutdown(socket.SHUT_RDWR)  # wakes the other thread
            return
        was_connected = self.connected
        if was_connected:
            self._push()
        self._finished = True
        try:
            if was_connected and self._sock is not None:
                with suppress(OSError):
                    self._end_stream(self._sock, longest)
        finally:
            self._close_sockets()

    def _close_sockets(self) -> None:
        self._drop_sockets()
        self._closed("closed")
        self._selector.close()

    def _end_stream(self, sock: socket.socket, longest: float) -> None:
        """Ends the stream behind what is collected, and discards what arrives until the server has ended its own: the
        system resets a connection that is closed with unread reports, and drops what it has not sent. Raises
        OSError."""
        end = Ending(self._options.send_timeout, longest)
        ended = False
        with selectors.DefaultSelector() as waiting:
            waiting.register(sock, selectors.EVENT_READ | selectors.EVENT_WRITE)
            while True:
                if not self._out and not ended:
                    sock.shutdown(socket.SHUT_WR)
                    waiting.modify(sock, selectors.EVENT_READ)
                    ended = True
                if end.is_over(self._out_bytes + unacknowledged(sock)):
                    return
                for _, events in waiting.select(END_CHECK_S):
                    if events & selectors.EVENT_READ and not sock.recv(_RECEIVE_BYTES):
                        return
                    if events & selectors.EVENT_WRITE:
                        self._write(sock)

    def __enter__(self) -> "Client":
        return self

    def __exit__(self, kind: Optional[Type[BaseException]], *_: object) -> None:
        interrupted = kind is not None and issubclass(kind, KeyboardInterrupt)
        self._close(END_S if interrupted else float("inf"))

    def __del__(self) -> None:
        if hasattr(self, "_selector"):
            with suppress(Exception):  # at the end of the interpreter, modules are gone
                self.close()

    # --- connecting

    def _watch(self, sock: socket.socket, events: int, call: "Callable[[Client, int], None]") -> None:
        """The call is a plain function: a bound method would refer to the client, which could then not end with its
        last name."""
        sock.setblocking(False)
        self._selector.register(sock, events, call)

    def _unwatch(self, sock: Optional[socket.socket]) -> None:
        if sock is not None:
            with suppress(KeyError):  # of an attempt that failed before it was watched
                self._selector.unregister(sock)
            sock.close()

    def _leave_to_parent(self) -> None:
        for sock in (self._sock, self._udp, self._listener, self._request):
            if sock is not None:
                sock.close()  # without unregister(): on Linux the selector's registrations are the parent's, too
        self._selector.close()

    def _drop_sockets(self) -> None:
        for sock in (self._sock, self._udp, self._listener, self._request):
            self._unwatch(sock)
        self._sock = self._udp = self._listener = self._request = None
        self._loss = None
        self._connecting = False
        self._out.clear()
        self._out_bytes = 0
        self._uncounted = 0

    def _attempt(self) -> None:
        self._retry_at = 0.0
        self._target = self._host.target
        try:
            if self._address.tcp_only:
                self._sock = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
                self._connecting = True
                self._watch(self._sock, selectors.EVENT_WRITE, Client._on_stream)
                status = self._sock.connect_ex(self._target)
                if status != 0 and status not in _CONNECT_PROGRESS:
                    raise OSError(status, "connect")
                self._request_at = time.monotonic() + 3.0
            else:
                self._ask_for_connection()
        except OSError as error:
            self._fail(str(error))

    def _ask_for_connection(self) -> None:
        local = local_towards(self._target)
        self._listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._listener.bind((local, 0))
        self._listener.listen(1)
        self._watch(self._listener, selectors.EVENT_READ, Client._on_accept)
        self._request = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._request.bind((local, 0))
        self._request.connect(self._target)
        self._watch(self._request, selectors.EVENT_READ, Client._on_request_answer)
        self._request_text = f"{local} {self._listener.getsockname()[1]}\0".encode()
        self._request_at = 0.0

    def _on_request_answer(self, _: int) -> None:
        if self._request is None:
            return
        try:
            self._request.recv(2048)
        except BlockingIOError:
            pass
        except OSError as error:
            self._last_failure = f"UDP request: {error.strerror}"

    def _on_accept(self, _: int) -> None:
        if self._listener is None:
            return
        try:
            self._sock = self._listener.accept()[0]
        except OSError:
            return
        self._unwatch(self._listener)
        self._unwatch(self._request)
        self._listener = self._request = None
        try:
            local = self._sock.getsockname()[0]
            self._udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._udp.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
            self._udp.bind((local, 0))
            self._watch(self._udp, selectors.EVENT_READ, Client._on_datagrams)
            self._watch(self._sock, selectors.EVENT_READ, Client._on_stream)
        except OSError as error:
            return self._fail(str(error))
        self._adopt((local, self._udp.getsockname()[1]))

    def _adopt(self, udp: Optional[Tuple[str, int]]) -> None:
        assert self._sock is not None
        try:
            self._remote = str(self._sock.getpeername()[0])
            self._sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._loss = LossWatch(self._sock, self._options.send_timeout)
        except OSError as error:  # the server has ended it already
            return self._fail(str(error))
        self._connecting = False
        self._opened(udp)
        self._push()

    def _fail(self, reason: str) -> None:
        self._drop_sockets()
        self._closed(reason)
        if self._counts.connections == 0 or self._options.reconnect:
            self._retry_at = time.monotonic() + RETRY_S
            self._host.ask_again()

    # --- moving bytes

    def _on_stream(self, events: int) -> None:
        sock = self._sock
        if sock is None:
            return
        if self._connecting:
            status = sock.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
            if status != 0:
                return self._fail(os.strerror(status))
            return self._adopt(None)
        if events & selectors.EVENT_READ:
            try:
                data = sock.recv(_RECEIVE_BYTES)
                if not data:
                    return self._fail(CLOSED_BY_SERVER)
                self._received(data)
            except BlockingIOError:
                pass
            except ProtocolError as error:
                return self._fail(f"it broke the VRPN protocol: {error}")
            except OSError as error:
                return self._fail(str(error))
            except BaseException:
                self._fail(_INTERRUPTED)
                raise
        self._push()

    def _on_datagrams(self, _: int) -> None:
        if self._udp is None:
            return
        target = self._udp_target[0] if self._udp_target is not None else ""
        for _ in range(1000):
            try:
                data, sender = self._udp.recvfrom(65536)
            except (BlockingIOError, ConnectionError):
                return
            # Only datagrams from the peer of the TCP connection count.
            if sender[0] in (self._remote, target):
                self._received_datagram(data)

    def _write(self, sock: socket.socket) -> None:
        """Raises OSError."""
        with suppress(BlockingIOError):
            while self._out:
                sent = sock.send(self._out[0])
                self._counts.tcp_bytes_out += sent
                self._out_bytes -= sent
                if sent == len(self._out[0]):
                    self._out.popleft()
                else:
                    self._out[0] = self._out[0][sent:]

    def _push(self) -> None:
        """Gives collected bytes to the system, as far as it accepts them without waiting. What a signal handler collects
        meanwhile goes with them."""
        if not self._pushing:
            try:  # also for a Ctrl-C between this line and the next
                self._pushing = True
                self._push_now()
            finally:
                self._pushing = False

    def _push_now(self) -> None:
        peer, sock = self._peer, self._sock
        if peer is None or sock is None or self._connecting:
            return
        self._uncounted = 0
        try:
            while True:
                if peer.stream:
                    data = memoryview(peer.take_stream())
                    self._out.append(data)
                    self._out_bytes += len(data)
                self._write(sock)
                if not peer.stream:
                    break
        except OSError as error:
            return self._fail(str(error))
        except BaseException:
            self._fail(_INTERRUPTED)
            raise
        if self._udp is not None and self._udp_target is not None:
            for datagram in peer.take_datagrams():
                try:
                    self._counts.udp_bytes_out += self._udp.sendto(datagram, self._udp_target)
                except OSError:
                    pass  # as good as lost on the way
        events = selectors.EVENT_READ if self._inbox_bytes <= MAX_WAITING_BYTES else 0
        if self._out:
            events |= selectors.EVENT_WRITE
        if events and self._selector.get_key(sock).events != events:
            self._selector.modify(sock, events, Client._on_stream)

    def _step(self, timeout: float) -> None:
        """Sends, sleeps up to the timeout until something arrives or is due, receives. Runs no callbacks."""
        self._check_open()
        try:
            self._inside = threading.get_ident()
            self._move(timeout)
        finally:
            self._inside = 0
            if self._finished:  # by close() in another thread
                self._close_sockets()

    def _is_used_elsewhere(self) -> bool:
        return self._inside not in (0, threading.get_ident())

    def _move(self, timeout: float) -> None:
        at = time.monotonic()
        until = at + min(timeout, 3600.0)  # select() refuses longer times
        if self._sock is None and self._listener is None:
            if self._retry_at:
                if at >= self._retry_at:
                    self._attempt()
                else:
                    until = min(until, self._retry_at)
        if self._request is not None:
            if at >= self._request_at:
                if self._request_at:
                    self._host.ask_again()
                self._request_at = at + 1.0
                try:
                    # A machine that changes its network has another address: the server cannot call it at the former one.
                    moved = local_towards(self._target) != self._request.getsockname()[0]
                    if moved or self._host.target != self._target:
                        self._drop_sockets()
                        self._attempt()
                    else:
                        self._request.send(self._request_text)
                except OSError as error:
                    self._last_failure = f"UDP request: {error.strerror}"
            until = min(until, self._request_at)
        if self._connecting:
            if at >= self._request_at:
                self._fail("no answer to the connection attempt")
            else:
                until = min(until, self._request_at)
        if self._handshake_expired():
            self._fail("it accepts connections, but does not answer as a VRPN server")
        if self._loss is not None and self._loss.is_lost():
            self._fail(self._not_acknowledged())
        if self._sock is not None and not self._connecting:
            until = min(until, self._run_timers())
        self._push()
        for key, events in self._select(max(0.0, until - time.monotonic())):
            key.data(self, events)

    def _select(self, timeout: float) -> "List[Tuple[selectors.SelectorKey, int]]":
        if not self._selector.get_map():
            # Between two attempts no socket exists, and Windows refuses to wait for none.
            time.sleep(min(timeout, RETRY_S))
            return []
        return self._selector.select(timeout)

    def _wait(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Sends and receives, without callbacks, until the condition holds; false after the timeout."""
        deadline = time.monotonic() + timeout
        while not condition():
            left = deadline - time.monotonic()
            if left <= 0:
                return False
            self._step(left)
        return True

    def _collected(self, size: int) -> None:
        self._uncounted += size
        if self._uncounted < BATCH_BYTES:
            return
        self._push()
        if self._out_bytes > max(self._options.queue_limit_bytes, 1):
            self._drain_to(self._options.queue_limit_bytes // 2)

    def _drain_to(self, limit: int, on_step: Optional[Callable[[], object]] = None) -> None:
        connection = self._counts.connections
        self._push()
        progress = time.monotonic()
        left = self._out_bytes
        while self.connected and self._counts.connections == connection and self._out_bytes > limit:
            self._step(0.1)
            if self._out_bytes < left:
                left = self._out_bytes
                progress = time.monotonic()
                if on_step is not None:
                    on_step()
            elif time.monotonic() - progress > self._options.send_timeout:
                why = (
                    f"{self.server} accepted no data for {self._options.send_timeout:g} s; {self._out_bytes} bytes wait "
                    "to be sent"
                )
                self._fail(why)
                raise ConnectionLost(why)
        self._check_kept(connection)

    # --- polling

    def poll(self, timeout: float = 0.0) -> int:
        """Sends what is collected, sleeps up to `timeout` seconds until something arrives, runs the callbacks for it,
        and returns the number of reports that arrived. 0 does not sleep. Called from a callback, it runs no
        callbacks. Raises what callbacks raise, ServerError (Options.throw_on_error), and ConnectionLost after
        close()."""
        self._check_open()
        timeout = duration(timeout)
        count = self._dispatch()
        deadline = time.monotonic() + timeout
        while not (count and self._inbox):  # else callbacks polled, and the rest waits for the next call
            self._step(0.0 if count else max(0.0, deadline - time.monotonic()))
            count += self._dispatch()
            if count or time.monotonic() >= deadline:
                break
        self._push()
        self._raise_first_error()
        return count

    def run_for(self, seconds: float) -> None:
        """Polls for the whole duration. Raises as poll()."""
        left = duration(seconds)
        deadline = time.monotonic() + left
        while left > 0:
            self.poll(left)
            left = deadline - time.monotonic()

    def reports(self, kind: str, seconds: float = float("inf")) -> Iterator[Any]:
        """Iterates over the reports of one kind, as they arrive, for so many seconds: "pose", "force", "tick" and so
        on, see hapticd.reports.KINDS; "tick", "contacts" and "hand" arrive only after subscribe(). Raises as poll(), and
        ConnectionLost when the connection ends and Options.reconnect is false."""
        waiting: Deque[Any] = deque()
        with self.on(kind, waiting.append):
            deadline = time.monotonic() + duration(seconds)
            while True:
                while waiting:
                    yield waiting.popleft()
                left = deadline - time.monotonic()
                if left <= 0:
                    return
                self._check_renewed()
                self.poll(min(left, 3600.0))

    def rows(self, kind: str, seconds: float = float("inf")) -> "Iterator[npt.NDArray[Any]]":
        """Iterates over structured arrays with the reports of one kind, one for each poll that brought some, for so
        many seconds. Columns are the fields of the report (contacts: one row for each contact). Raises as reports()."""
        r.dtype_of(kind)
        waiting: List[Any] = []
        with self.on(kind, waiting.append):
            left = duration(seconds)
            deadline = time.monotonic() + left
            while left > 0:
                self._check_renewed()
                self.poll(min(left, 3600.0))
                if waiting:
                    rows = r.rows_of(kind, waiting)
                    waiting.clear()
                    yield rows
                left = deadline - time.monotonic()

    def collect(self, kind: str, seconds: float) -> "npt.NDArray[Any]":
        """All reports of one kind of the next so many seconds, as one structured array."""
        return np.concatenate([np.empty(0, dtype=r.dtype_of(kind)), *self.rows(kind, seconds)])

    def flush(self) -> None:
        """Sends what is collected as far as the system accepts it without waiting."""
        self._check_place()
        self._push()

    def flush_all(self) -> None:
        """Sends what is collected and waits until the system has accepted all of it. Raises ConnectionLost."""
        self._check_open()
        self._drain_to(0)

    def wait_connected(self, timeout: float) -> None:
        """Waits for a connection and for an answer of the device, so many seconds. Raises ConnectError, and
        ConnectionLost after close()."""
        self._check_open()
        timeout, start = duration(timeout), time.monotonic()
        if not self._wait(lambda: self.connected, timeout):
            raise ConnectError(f"{self.device}: {self._why_not_connected()}")
        left = timeout - (time.monotonic() - start)
        if not self._wait(lambda: self._heard or not self.connected, max(left, 1.0)) or not self.connected:
            raise ConnectError(self._no_device() if self.connected else self._why_not_connected())

    def wait_capabilities(self) -> Optional[Capabilities]:
        """What the server and its device support, after waiting for the answer. Raises ConnectError without a
        connection."""
        self._wait_answer()
        return self.capabilities

    def _wait_answer(self) -> None:
        if not self.connected:
            self.wait_connected(self._options.connect_timeout)
        connection = self._counts.connections
        over = lambda: self._answered or not self.connected or self._counts.connections != connection  # noqa: E731
        self._wait(over, max(self._options.connect_timeout, 1.0))

    def _require(self, feature: int, what: str) -> None:
        self._wait_answer()
        self._require_now(feature, what)

    # --- meshes, batches

    def upload_mesh(
        self,
        object: int,
        vertices: "npt.ArrayLike",
        triangles: "npt.ArrayLike",
        progress: Optional[Callable[[UploadProgress], object]] = None,
    ) -> None:
        """Sends a mesh, (n, 3) positions in object units and (m, 3) vertex numbers, counter-clockwise seen from the
        front, and returns when the system has accepted all of it; calls `progress` meanwhile, the last time with all
        bytes. A server of this project receives it in a batch, so that no tick renders part of the mesh; other
        servers receive three set_vertex() per triangle. Replaces the mesh that the object has; set_vertices()
        changes parts of it. Inside batch() it only collects. Raises ValueError for a wrong shape or a triangle with an
        index outside the vertices, ConnectError and ConnectionLost. Ctrl-C, or an exception of `progress`, ends the upload
        and the connection: the server then takes back what it has of the batch, and the client reconnects."""
        rows = as_vertices(vertices)
        self._upload(object, rows, as_triangles(triangles, len(rows)), progress)

    def upload_corners(
        self, object: int, corners: "npt.ArrayLike", progress: Optional[Callable[[UploadProgress], object]] = None
    ) -> None:
        """The same for a list of corners, (n, 3): three consecutive ones are a triangle. Object units. Raises
        ValueError for another shape or a number of corners that is no multiple of three."""
        self._upload(object, as_corners(corners), None, progress)

    def _upload(
        self,
        object: int,
        vertices: "npt.NDArray[Any]",
        triangles: "Optional[npt.NDArray[Any]]",
        progress: Optional[Callable[[UploadProgress], object]],
    ) -> None:
        if progress is not None:
            function(progress, "a function that takes one hapticd.UploadProgress")
        self._wait_answer()
        frames, messages = self._mesh_frames(object, vertices, triangles)
        if self._held is not None:
            self._send_frames(frames, messages)
            return
        self.flush_all()
        frames = self._batched(frames)
        total = sum(map(len, frames))
        self._counts.messages_out += messages
        peer = self._peer
        assert peer is not None
        report = progress or (lambda _: None)
        try:
            peer.stream.extend(frames)
            self._drain_to(0, lambda: report(UploadProgress(total - self._out_bytes, total)) if self._out_bytes else None)
        except BaseException:
            # A server takes back what it has of a batch when the connection ends, and only then.
            if peer is self._peer and (self._out or peer.stream):
                self._fail("an upload was interrupted")
            raise
        report(UploadProgress(total, total))

    @contextmanager
    def batch(self) -> Iterator[None]:
        """with hand.batch(): everything that the block commands takes effect in one tick. The commands are collected
        here and sent at its end. Nothing is sent when it raises, or when the connection ends meanwhile
        (ConnectionLost). At most 256 MiB (ValueError). Batches do not nest (RuntimeError)."""
        if self._held is None:
            self._require(m.FEATURE_BATCH, "make several changes visible at once")
        self._begin_batch()
        connection = self._counts.connections
        try:
            yield
        except BaseException:
            self._end_batch(connection, send=False)
            raise
        self._end_batch(connection, send=True)

    # --- extensions

    def subscribe(self, kinds: Reports, rate_Hz: float = 0) -> None:
        """Chooses the kinds of reports that this client receives, and the highest rate; 0 keeps the rate. It replaces
        the previous choice and is repeated on every new connection. Raises ValueError for a negative or infinite
        rate."""
        self._check_rate(rate_Hz)
        if self.connected:
            self._require(m.FEATURE_SUBSCRIBE, "choose reports")
        self._set_subscription(kinds, rate_Hz)
        self._push()

    def stop_forces(self) -> None:
        """Brings the force of the device to zero within one tick of its arrival, until rearm_forces(). Sent at once,
        ahead of everything collected, even inside batch(). While more than 64 KiB of this connection are unsent or
        unacknowledged, the stop may wait behind them, so the client also opens a second TCP connection to the server,
        sends the stop there and waits for the server's confirmation. Heartbeats continue meanwhile. Raises
        ConnectionLost without a connection, also when the server has ended it and nothing has been polled since
        (where the system says so: on Linux), and ConnectError when the second connection is not confirmed within
        Options.connect_timeout (at least 1 s). May be called from any thread, and by a signal handler: while the client is in
        use, only the second connection is used."""
        if self._pushing or self._is_used_elsewhere():
            if self._answered:
                self._require_now(m.FEATURE_STOP, "stop the forces")
            return self._stop_beside("this connection is in use", heartbeats=False)
        backlog = self._out_bytes + (self._peer.stream_bytes if self._peer is not None else 0)
        if self._sock is not None and not self._connecting:
            backlog += unacknowledged(self._sock)
        behind = backlog > STOP_BACKLOG_BYTES and (not self._answered or self._has(m.FEATURE_STOP))
        self._put_key()
        if not self._put_now(m.StopForces()):
            raise ConnectionLost(f"forces not stopped: {self._why_not_connected()}")
        self._push()
        if behind:
            self._stop_beside(f"it waits behind {backlog} bytes")
        else:
            self._check_arrival("forces not stopped")
        self._require(m.FEATURE_STOP, "stop the forces")

    def _send_at_once(self, message: Any, failure: str) -> None:
        """Sends a message ahead of a batch that is held. Raises ConnectionLost as stop_forces() does; its text begins
        with what has failed."""
        if not self._put_now(message):
            raise ConnectionLost(f"{failure}: {self._why_not_connected()}")
        self._push()
        self._check_arrival(failure)

    def _check_arrival(self, failure: str) -> None:
        """After sending: raises ConnectionLost when nothing receives at the other end. The system accepts the first
        bytes for a server that is gone, so only the state of the connection tells."""
        if self._sock is not None and has_ended(self._sock):
            self._fail(CLOSED_BY_SERVER)
        if not self.connected:
            raise ConnectionLost(f"{failure}: {self._why_not_connected()}")

    def _stop_beside(self, why: str, heartbeats: bool = True) -> None:
        """The server handles the messages of a connection in order, so the pong confirms the stop."""
        timeout = max(self._options.connect_timeout, 1.0)
        deadline = time.monotonic() + timeout
        options = Options(connect_timeout=0, reconnect=False, send_timeout=END_S)
        with Client(f"{self.device}@tcp://{self._target[0]}:{self._target[1]}", options) as beside:
            sent = False
            while not (sent and beside._all_pongs) and time.monotonic() < deadline:
                if not sent and beside.connected:
                    sent = beside._put_now(self._identity()) and beside._put_now(m.StopForces())
                    beside._ping()
                beside._step(0.005)
                if heartbeats:
                    self._step(0.0)
            if not (sent and beside._all_pongs):
                raise ConnectError(
                    f"stop not confirmed: {why}, and a second connection to {self.server} got no answer: "
                    f"{beside._why_not_connected()}"
                )

    def rearm_forces(self) -> None:
        """Ends a stop and clears latched trips; the force ramps in over half a second. It keeps its place behind the
        commands sent before it, and never undoes a stop that is sent after it. It acts only while its client is there: a program that
        ends waits until a GuardReport says that the device is not stopped any more, or the stop stands. Waits for a connection up to
        Options.connect_timeout (ConnectError); raises ConnectionLost when the connection turns out to have ended."""
        self._require(m.FEATURE_STOP, "re-arm the forces")
        self._put_key()
        self._send_at_once(m.RearmForces(), "forces not re-armed")

    def mark(self, text: str) -> None:
        """Marks a moment, such as "trial 3 begins": the server records it and reports it to all clients. Sent at once,
        even inside batch(). An empty text marks the time alone. Raises ValueError for more than 255 bytes of UTF-8,
        ConnectionLost as stop_forces(), and Unsupported when the server has answered that it knows no markers."""
        self._send_at_once(m.Marker(0, text), "not marked")
        self._refuse_other_makes("mark a moment")

    def present_token(self, token: str) -> None:
        """Presents a token for a role, on every connection from now on: 16 to 128 characters (ValueError).
        An empty one presents none on later connections; the present one keeps its role. Without TLS, everybody on the
        way can read it. A refusal arrives as a text."""
        self._set_token(token)
        self._push()

    def enable_heartbeat(self, enable: bool = True) -> None:
        """From now on the server disconnects this client and ends its effects when it receives no heartbeat for
        500 ms. The client sends ten heartbeats per second while it polls or waits: a program that hangs, or does not
        poll for 500 ms, is disconnected. Repeated on every new connection."""
        if self.connected:
            self._require(m.FEATURE_HEARTBEAT, "watch the heartbeat")
        self._set_heartbeats(enable)
        self._push()

    def set_remote_contacts(self, contacts: Sequence[RemoteContact]) -> None:
        """Replaces this client's contacts, at most 16, for simulations that run in the client. Sent at once, even inside
        batch(), by TCP: datagrams can be forged. The newest value wins; call at a steady rate of 30 to 1000 Hz. The
        server renders them at its servo rate, moves them by their velocities, and takes over changes within 0.3 N/ms.
        Contacts that are not repeated end at the end of their lifetime, contacts that are absent from a later call
        fade out at once, all of them when the client leaves. Dropped without a connection. One client streams to a
        device at a time; the server refuses others with a text. HandReport has the force of each."""
        if self.connected:
            self._require(m.FEATURE_REMOTE_CONTACTS, "stream contacts")
        self._put_contacts(contacts)
        self._push()

    def set_force(self, force_N: Numbers, torque_Nm: Numbers = (0.0, 0.0, 0.0), lifetime_s: float = 0.1) -> None:
        """Has a force (N, world frame) held until the next call, at most for `lifetime_s` (0.01 to 0.1). Sent as
        set_remote_contacts(). The server changes it by at most 0.3 N/ms, and cuts the part that adds power to the hand
        when its budget of energy is spent (HandReport.energy_spent). A torque (N m) is felt only on devices that render
        it. Prefer set_remote_contacts() for everything that is stiff: a force is always late by the round trip."""
        if self.connected:
            self._require(m.FEATURE_REMOTE_CONTACTS, "hold a force")
        self._put_force(force_N, torque_Nm, lifetime_s)
        self._push()

    def hold_hand(
        self, position: Numbers, orientation: Numbers = (0.0, 0.0, 0.0, 1.0), buttons: int = 0
    ) -> None:
        """Takes hold of the simulated hand and moves it to the pose: position in world units, orientation x y z w from
        stylus to world, bit 0 of `buttons`: button 0 is down. The hand follows with a person's dynamics, and surfaces
        push it back. One client holds the hand at a time; the server refuses others with a text."""
        if self.connected:
            self._require(m.FEATURE_HOLD_HAND, "hold the hand")
        # Sent reliably: a datagram that arrives after the release would take the hand again.
        self._put_now(m.HoldHand(1, position, orientation, buttons))
        self._push()

    def release_hand(self) -> None:
        """Releases the simulated hand. Disconnecting releases it, too."""
        if self.connected:
            self._require(m.FEATURE_HOLD_HAND, "release the hand")
        self._put_now(m.HoldHand())
        self._push()


def connect(device: str, options: Optional[Options] = None, **fields: Any) -> Client:
    """Opens NAME@host or NAME@host:port (VRPN's default: a request by UDP, a TCP connection from the server, fast
    reports by UDP), or NAME@tcp://host:port (one TCP connection, which passes most firewalls). The port is 3883
    unless given. Options by name: connect("Phantom@localhost", throw_on_error=True). Raises ValueError for another
    form, and ConnectError when there is no such server or device within connect_timeout."""
    return Client(device, options_of(options, fields))
