"""The client for asyncio.

    async with hapticd.aio.connect("Phantom@localhost") as hand:
        await hand.upload_mesh(0, *hapticd.sphere(30))
        hand.set_surface(0, hapticd.Surface(stiffness=0.8))
        async for report in hand.reports("force", seconds=5):
            print(report.force_N)

Reports arrive whenever the event loop runs; callbacks run there, too. Commands are plain calls, as in
hapticd.Client: they only collect, and the event loop sends them in its next turn. A command never sleeps, so a
program that sends much awaits flush_all() from time to time. What must wait for the server is a coroutine.
"""

import asyncio
import os
import socket
import time
import weakref
from collections import deque
from contextlib import asynccontextmanager, suppress
from contextvars import ContextVar
from typing import (
    TYPE_CHECKING, Any, AsyncIterator, Awaitable, Callable, Coroutine, Deque, Generator, List, NoReturn, Optional, Sequence, Set,
    Tuple, Type, Union,
)  # fmt: skip

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


#: The batches that this task is in: its own, and those in which it was made.
_BATCHES: "ContextVar[Tuple[object, ...]]" = ContextVar("hapticd_batches", default=())


class _Stream(asyncio.Protocol):
    # The event loop refers to its protocols, and they to their client weakly: it ends with its last name.

    def __init__(self, client: "weakref.ref[Client]", reverse: bool) -> None:
        self._client = client
        self._reverse = reverse
        self._transport: Optional[asyncio.Transport] = None
        self.lost: "asyncio.Future[None]" = asyncio.get_running_loop().create_future()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        client = self._client()
        if client is None:
            transport.abort()
        else:
            client._adopt(transport, self._reverse)

    def _owner(self) -> "Optional[Client]":
        """The client whose connection this is; none for a surplus or a former one, whose end must not end another."""
        client = self._client()
        return client if client is not None and client._transport is self._transport else None

    def data_received(self, data: bytes) -> None:
        client = self._owner()
        if client is not None:
            client._data(data)

    def pause_writing(self) -> None:
        client = self._owner()
        if client is not None:
            client._writable.clear()

    def resume_writing(self) -> None:
        client = self._owner()
        if client is not None:
            client._writable.set()

    def connection_lost(self, error: Optional[Exception]) -> None:
        self.lost.set_result(None)
        client = self._owner()
        if client is not None:
            client._gone(str(error) if error is not None else CLOSED_BY_SERVER)


class _Datagrams(asyncio.DatagramProtocol):
    def __init__(self, client: "weakref.ref[Client]") -> None:
        self._client = client

    def datagram_received(self, data: bytes, sender: Tuple[Any, ...]) -> None:
        client = self._client()
        if client is not None:
            client._datagram(data, str(sender[0]))


class _Requests(asyncio.DatagramProtocol):
    def __init__(self, client: "weakref.ref[Client]") -> None:
        self._client = client

    def error_received(self, error: Exception) -> None:
        client = self._client()
        if client is not None:
            client._last_failure = f"UDP request: {error}"


async def _stay_connected(reference: "weakref.ref[Client]") -> None:
    """Connects again and again, as long as the client has a name. Whatever waits has only the reference."""
    while True:
        lost = await _attempt(reference)
        if lost is not None:
            await lost.wait()
        client = reference()
        if client is None or client._finished or (client._counts.connections and not client._options.reconnect):
            return
        client._host.ask_again()
        del client
        await asyncio.sleep(RETRY_S)


async def _attempt(reference: "weakref.ref[Client]") -> Optional[asyncio.Event]:
    """One attempt to connect; the result is set when the connection ends."""
    client = reference()
    if client is None:
        return None
    client._lost.clear()
    client._target = client._host.target
    lost, host, target, tcp_only = client._lost, client._host, client._target, client._address.tcp_only
    del client
    try:
        if tcp_only:
            attempt = asyncio.get_running_loop().create_connection(lambda: _Stream(reference, False), *target)
            await asyncio.wait_for(attempt, 3.0)
        else:
            await _ask_for_connection(reference, host, target)
        return lost
    except asyncio.TimeoutError:
        failure = "no answer to the connection attempt"
    except ConnectionRefusedError:
        failure = "Connection refused"
    except OSError as error:
        failure = str(error)
    client = reference()
    if client is not None:
        client._last_failure = failure
    return None


async def _ask_for_connection(reference: "weakref.ref[Client]", host: HostLookup, target: Tuple[str, int]) -> None:
    loop = asyncio.get_running_loop()
    local = local_towards(target)
    adopted = loop.create_future()
    client = reference()
    if client is None:
        return
    client._adopted = adopted
    del client
    server = await loop.create_server(lambda: _Stream(reference, True), local, 0)
    request: Optional[asyncio.DatagramTransport] = None
    try:
        request, _ = await loop.create_datagram_endpoint(
            lambda: _Requests(reference), local_addr=(local, 0), remote_addr=target
        )
        text = f"{local} {server.sockets[0].getsockname()[1]}\0".encode()
        while not adopted.done():
            # A machine that changes its network has another address: the server cannot call it at the former one.
            if local_towards(target) != local:
                raise OSError("this machine has another address now")  # the next attempt names it
            if host.target != target:
                raise OSError("the server has another address now")  # the next attempt asks there
            request.sendto(text)
            await asyncio.wait([adopted], timeout=1.0)
            if not adopted.done():
                host.ask_again()
    finally:
        server.close()
        if request is not None:
            request.close()
    udp, _ = await loop.create_datagram_endpoint(lambda: _Datagrams(reference), local_addr=(local, 0))
    client = reference()
    if client is None:
        udp.close()
    else:
        client._begin(udp)


def _turn_of(reference: "weakref.ref[Client]") -> None:
    client = reference()
    if client is not None:
        client._turn()


async def _end_stream(transport: asyncio.Transport, send_timeout: float, longest: float) -> None:
    """Ends a stream behind what was written, and discards what arrives until the server has ended its own; see
    hapticd.Client.close()."""
    protocol, sock = transport.get_protocol(), transport.get_extra_info("socket")
    if not isinstance(protocol, _Stream):  # the stream has ended, and its transport has let go of it
        return
    end = Ending(send_timeout, longest)
    try:
        with suppress(OSError):  # the server has ended it already
            transport.write_eof()  # behind what waits in the transport
        while not protocol.lost.done():
            closed = sock is None or sock.fileno() < 0
            if end.is_over(transport.get_write_buffer_size() + (0 if closed else unacknowledged(sock))):
                break
            await asyncio.wait([protocol.lost], timeout=END_CHECK_S)
    finally:
        transport.abort()


def _end(stream: Optional[asyncio.Transport], send_timeout: float, *what: Any) -> None:
    if stream is not None:
        asyncio.get_running_loop().create_task(_end_stream(stream, send_timeout, float("inf")))
    for one in what:
        if isinstance(one, asyncio.BaseTransport):
            one.close()
        elif one is not None:
            one.cancel()


class Client(Core):
    """One device of one server; see hapticd.Client for everything that both faces share. It belongs to one event
    loop. Made by connect()."""

    _ELSEWHERE = (
        "belongs to another event loop, or to the thread of one: asyncio.run_coroutine_threadsafe() or "
        "loop.call_soon_threadsafe() hands it a call"
    )

    def __init__(self, device: str, options: Options = Options()) -> None:
        super().__init__(parse(device), options)
        self._loop = asyncio.get_running_loop()
        self._transport: Optional[asyncio.Transport] = None
        self._udp: Optional[asyncio.DatagramTransport] = None
        self._loss: Optional[LossWatch] = None
        self._remote = ""
        self._early = b""  # of the stream, before the datagram socket exists
        self._lost = asyncio.Event()
        self._writable = asyncio.Event()
        self._writable.set()
        self._changed: Set["asyncio.Future[None]"] = set()
        self._collecting = asyncio.Lock()  # batches: one after the other, for they do not nest
        self._batch: Optional[object] = None  # that is collected
        self._sending = asyncio.Lock()  # batches and uploads
        self._timer: Optional[asyncio.TimerHandle] = None
        self._soon: Optional[asyncio.Handle] = None
        self._adopted: Optional["asyncio.Future[None]"] = None
        self._task: Optional["asyncio.Task[None]"] = None

    def _is_used_elsewhere(self) -> bool:
        running = asyncio._get_running_loop()
        return running is not self._loop and (running is not None or self._loop.is_running() or self._loop.is_closed())

    async def _start(self) -> None:
        self._host = await self._loop.run_in_executor(None, HostLookup, self._address)
        self._target = self._host.target  # of the attempt
        self._task = self._loop.create_task(_stay_connected(weakref.ref(self)))
        if self._options.connect_timeout > 0:
            try:
                await self.wait_connected(self._options.connect_timeout)
            except BaseException:
                await self.close()
                raise

    async def close(self) -> None:
        """Sends what is collected, waits until the server has read it, and closes all sockets, as
        hapticd.Client.close(); cancelled, it closes them at once. An `async with` block that is cancelled, as by Ctrl-C, waits
        no longer than 1 s. From its first step on every command, and everything that waits, raises ConnectionLost; `latest`
        is empty. Does nothing the second time. In another event loop than the client's it ends the connection without waiting.
        A client whose last name is gone closes, too, as hapticd.Client, as long as
        the event loop runs."""
        await self._close(float("inf"))

    async def _close(self, longest: float) -> None:
        if self._finished:
            return
        if self._is_used_elsewhere():
            self._finished = True
            sock = self._transport.get_extra_info("socket") if self._transport is not None else None
            if sock is not None:
                with suppress(OSError):  # it has ended already
                    sock.shutdown(socket.SHUT_RDWR)
            return
        if self.connected:
            self._push()
        self._finished = True
        transport = self._transport
        if transport is not None:
            self._gone("closed")
        self._deliver_all()  # ends waits that began before the first connection
        for running in (self._timer, self._soon, self._task):
            if running is not None:
                running.cancel()
        if transport is not None:
            await _end_stream(transport, self._options.send_timeout, longest)
            await asyncio.sleep(0)  # the transport closes its socket in the next turn
        if self._task is not None:
            await asyncio.wait([self._task])

    async def __aenter__(self) -> "Client":
        return self

    async def __aexit__(self, kind: Optional[Type[BaseException]], *_: object) -> None:
        interrupted = kind is not None and issubclass(kind, (asyncio.CancelledError, KeyboardInterrupt))
        await self._close(END_S if interrupted else float("inf"))

    def __del__(self) -> None:
        if hasattr(self, "_task") and not self._finished:
            with suppress(RuntimeError):  # the event loop has been closed, and its sockets with it
                self._loop.call_soon_threadsafe(
                    _end, self._transport, self._options.send_timeout, self._udp, self._timer, self._task
                )

    def _leave_to_parent(self) -> None:
        """The transports cannot close their sockets without the event loop, which is the parent's: other files take
        the places of the sockets."""
        nowhere = os.open(os.devnull, os.O_RDWR)
        for transport in (self._transport, self._udp):
            sock = transport.get_extra_info("socket") if transport is not None else None
            if sock is not None and sock.fileno() >= 0:
                os.dup2(nowhere, sock.fileno(), inheritable=False)
        os.close(nowhere)
        self._transport = self._udp = None

    # --- connecting

    def _adopt(self, transport: asyncio.Transport, reverse: bool) -> None:
        # A server that answers two requests connects twice.
        awaited = not reverse or (self._adopted is not None and not self._adopted.done())
        if self._transport is not None or self._finished or not awaited:
            transport.abort()
            return
        self._transport = transport
        with suppress(OSError):  # the server has ended it already
            self._loss = LossWatch(transport.get_extra_info("socket"), self._options.send_timeout)
        self._remote = str(transport.get_extra_info("peername")[0])
        if not reverse:
            self._begin(None)
        else:
            self._early = b""
            assert self._adopted is not None
            self._adopted.set_result(None)

    def _begin(self, udp: Optional[asyncio.DatagramTransport]) -> None:
        if self._transport is None:  # lost meanwhile
            if udp is not None:
                udp.close()
            return
        self._udp = udp
        self._opened(udp.get_extra_info("sockname")[:2] if udp is not None else None)
        self._push()
        early, self._early = self._early, b""
        if early:
            self._data(early)
        self._turn()

    def _gone(self, reason: str) -> None:
        if self._transport is None:
            return
        self._transport = self._loss = None
        if self._udp is not None:
            self._udp.close()
            self._udp = None
        self._closed(reason)
        self._writable.set()
        self._lost.set()
        self._deliver_all()

    def _abort(self, reason: str) -> None:
        transport = self._transport
        self._gone(reason)
        if transport is not None:
            transport.abort()

    # --- moving bytes

    def _data(self, data: bytes) -> None:
        if self._peer is None:
            self._early += data
            return
        try:
            self._received(data)
        except ProtocolError as error:
            return self._abort(f"it broke the VRPN protocol: {error}")
        self._push()
        self._deliver_all()

    def _datagram(self, data: bytes, sender: str) -> None:
        if sender == self._remote or (self._udp_target is not None and sender == self._udp_target[0]):
            self._received_datagram(data)
            self._deliver_all()

    def _deliver_all(self) -> None:
        """Runs callbacks; their exceptions go to the event loop's handler."""
        while True:
            try:
                self._dispatch()
                break
            except Exception as error:
                self._loop.call_exception_handler({"message": "a callback of a haptic client raised", "exception": error})
        for future in self._changed:
            if not future.done():
                future.set_result(None)
        self._changed.clear()

    def _push(self) -> None:
        peer, transport = self._peer, self._transport
        if peer is None or transport is None or transport.is_closing():
            return
        if peer.stream:
            data = peer.take_stream()
            self._counts.tcp_bytes_out += len(data)
            transport.write(data)
        if self._udp is not None and self._udp_target is not None:
            for datagram in peer.take_datagrams():
                self._counts.udp_bytes_out += len(datagram)
                self._udp.sendto(datagram, self._udp_target)

    def _collected(self, size: int) -> None:
        if self._soon is None:
            self._soon = self._loop.call_soon(self._push_soon)

    def _push_soon(self) -> None:
        self._soon = None
        self._push()

    def _turn(self) -> None:
        """Heartbeats, pings and the end of the handshake, when they are due."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._handshake_expired():
            return self._abort("it accepts connections, but does not answer as a VRPN server")
        if self._transport is None:
            return
        if self._loss is not None and not self._transport.is_closing() and self._loss.is_lost():
            return self._abort(self._not_acknowledged())
        at = self._run_timers()
        self._push()
        self._timer = self._loop.call_later(max(0.0, at - time.monotonic()), _turn_of, weakref.ref(self))

    def _peer_connected(self) -> None:
        super()._peer_connected()
        self._loop.call_soon(self._turn)

    async def _wait(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Waits until the condition holds; false after the timeout. Raises ConnectionLost after close()."""
        deadline = self._loop.time() + timeout
        while not condition():
            self._check_open()
            left = deadline - self._loop.time()
            if left <= 0:
                return False
            future = self._loop.create_future()
            self._changed.add(future)
            await asyncio.wait([future], timeout=left)
            self._changed.discard(future)
        return True

    # --- waiting, receiving

    async def wait_connected(self, timeout: float) -> None:
        """Waits for a connection and for an answer of the device, so many seconds. Raises ConnectError, and
        ConnectionLost after close()."""
        timeout, start = duration(timeout), self._loop.time()
        if not await self._wait(lambda: self.connected, timeout):
            raise ConnectError(f"{self.device}: {self._why_not_connected()}")
        left = timeout - (self._loop.time() - start)
        if not await self._wait(lambda: self._heard or not self.connected, max(left, 1.0)) or not self.connected:
            raise ConnectError(self._no_device() if self.connected else self._why_not_connected())

    async def wait_capabilities(self) -> Optional[Capabilities]:
        """What the server and its device support, after waiting for the answer. Raises ConnectError without a
        connection."""
        await self._wait_answer()
        return self.capabilities

    async def _wait_answer(self) -> None:
        if not self.connected:
            await self.wait_connected(self._options.connect_timeout)
        await self._wait(lambda: self._answered or not self.connected, max(self._options.connect_timeout, 1.0))

    async def _require(self, feature: int, what: str) -> None:
        await self._wait_answer()
        self._require_now(feature, what)

    async def poll(self, timeout: float) -> int:
        """Waits up to `timeout` seconds for the next reports, and returns how many arrived. Raises ServerError
        (Options.throw_on_error), and ConnectionLost after close()."""
        before = self._counts.messages_in
        await self._wait(lambda: self._counts.messages_in != before, duration(timeout))
        self._raise_first_error()
        return self._counts.messages_in - before

    async def reports(self, kind: str, seconds: float = float("inf")) -> AsyncIterator[Any]:
        """Iterates over the reports of one kind, as they arrive, for so many seconds. Raises ConnectionLost when the
        connection ends and Options.reconnect is false, ServerError (Options.throw_on_error), and ConnectionLost after
        close()."""
        async for batch in self._reports_in_batches(kind, seconds):
            for report in batch:
                yield report

    async def rows(self, kind: str, seconds: float = float("inf")) -> "AsyncIterator[npt.NDArray[Any]]":
        """Iterates over structured arrays with the reports of one kind, as they arrive, for so many seconds."""
        r.dtype_of(kind)
        async for batch in self._reports_in_batches(kind, seconds):
            yield r.rows_of(kind, batch)

    async def collect(self, kind: str, seconds: float) -> "npt.NDArray[Any]":
        """All reports of one kind of the next so many seconds, as one structured array."""
        parts = [rows async for rows in self.rows(kind, seconds)]
        return np.concatenate([np.empty(0, dtype=r.dtype_of(kind)), *parts])

    async def _reports_in_batches(self, kind: str, seconds: float) -> "AsyncIterator[List[Any]]":
        waiting: Deque[Any] = deque()

        def arrived() -> bool:
            if not waiting:
                self._check_renewed()
            return bool(waiting)

        with self.on(kind, waiting.append):
            deadline = self._loop.time() + duration(seconds)
            while True:
                await self._wait(arrived, min(deadline - self._loop.time(), 3600.0))
                if waiting:
                    batch = list(waiting)
                    waiting.clear()
                    yield batch
                self._raise_first_error()
                if self._loop.time() >= deadline:
                    return

    # --- sending

    def flush(self) -> None:
        """Gives what is collected to the event loop now."""
        self._check_place()
        self._push()

    async def flush_all(self) -> None:
        """Sends what is collected and waits until the system has accepted nearly all of it (64 KiB may wait). Raises
        ConnectionLost."""
        self._check_open()
        self._push()
        transport, connection = self._transport, self._counts.connections
        if transport is not None:
            left = transport.get_write_buffer_size()
            progress = self._loop.time()
            while not self._writable.is_set():
                try:
                    await asyncio.wait_for(self._writable.wait(), 0.1)
                except asyncio.TimeoutError:
                    waiting = transport.get_write_buffer_size()
                    if waiting < left:
                        left, progress = waiting, self._loop.time()
                    elif self._loop.time() - progress > self._options.send_timeout:
                        self._abort(
                            f"{self.server} accepted no data for {self._options.send_timeout:g} s; {waiting} bytes wait to "
                            "be sent"
                        )
        self._check_kept(connection)

    async def upload_mesh(
        self,
        object: int,
        vertices: "npt.ArrayLike",
        triangles: "npt.ArrayLike",
        progress: Optional[Callable[[UploadProgress], object]] = None,
    ) -> None:
        """Sends a mesh; see hapticd.Client.upload_mesh(). Cancelled before its first byte, it sends nothing; later,
        the event loop sends the rest. Uploads of several tasks follow each other; inside batch() it only collects."""
        rows = as_vertices(vertices)
        await self._upload(object, rows, as_triangles(triangles, len(rows)), progress)

    async def upload_corners(
        self, object: int, corners: "npt.ArrayLike", progress: Optional[Callable[[UploadProgress], object]] = None
    ) -> None:
        """The same for a list of corners, (n, 3): three consecutive ones are a triangle. Object units. Raises
        ValueError for another shape or a number of corners that is no multiple of three."""
        await self._upload(object, as_corners(corners), None, progress)

    async def _upload(
        self,
        object: int,
        vertices: "npt.NDArray[Any]",
        triangles: "Optional[npt.NDArray[Any]]",
        progress: Optional[Callable[[UploadProgress], object]],
    ) -> None:
        if progress is not None:
            function(progress, "a function that takes one hapticd.UploadProgress")
        await self._wait_answer()
        frames, messages = self._mesh_frames(object, vertices, triangles)
        if self._held is not None:
            self._send_frames(frames, messages)
            return
        frames = self._batched(frames)
        async with self._sending:
            await self._send_upload(frames, messages, progress)

    async def _send_upload(
        self, frames: List[bytes], messages: int, progress: Optional[Callable[[UploadProgress], object]]
    ) -> None:
        peer, total = self._peer, sum(map(len, frames))
        self._counts.messages_out += messages
        at = sent = 0
        try:
            while at < len(frames):
                if peer is None or peer is not self._peer:
                    raise ConnectionLost(f"connection to {self.server} lost during an upload: {self._last_failure}")
                first, before = at, sent
                while at < len(frames) and sent - before < 16 * BATCH_BYTES:
                    sent += len(frames[at])
                    at += 1
                peer.stream.extend(frames[first:at])
                await self.flush_all()
                if progress is not None:
                    progress(UploadProgress(sent, total))
        except BaseException:
            # Cancelled, or ended by the callback. A batch without its end would keep every later command.
            if peer is not None and peer is self._peer:
                peer.stream.extend(frames[at:])
                self._push()
            raise

    @asynccontextmanager
    async def batch(self) -> AsyncIterator[None]:
        """async with hand.batch(): everything that the block commands takes effect in one tick. The batch of another task
        begins when this one has ended; what else other tasks send meanwhile, uploads too, becomes part of it. See
        hapticd.Client.batch()."""
        if self._batch in _BATCHES.get():
            self._begin_batch()  # raises RuntimeError
        async with self._collecting:
            await self._require(m.FEATURE_BATCH, "make several changes visible at once")
            self._begin_batch()
            connection = self._counts.connections
            self._batch = object()
            within = _BATCHES.set((*_BATCHES.get(), self._batch))
            try:
                yield
                await self._sending.acquire()
            except BaseException:
                self._end_batch(connection, send=False)
                raise
            finally:
                self._batch = None
                with suppress(ValueError):  # it ends in another task than it began
                    _BATCHES.reset(within)
            try:
                self._end_batch(connection, send=True)
            finally:
                self._sending.release()

    # --- extensions; see hapticd.Client

    async def subscribe(self, kinds: Reports, rate_Hz: float = 0) -> None:
        """Chooses the kinds of reports that this client receives, and the highest rate; 0 keeps the rate."""
        self._check_rate(rate_Hz)
        if self.connected:
            await self._require(m.FEATURE_SUBSCRIBE, "choose reports")
        self._set_subscription(kinds, rate_Hz)
        self._push()

    def stop_forces(self) -> "Coroutine[Any, Any, None]":
        """Brings the force of the device to zero within one tick of its arrival, until rearm_forces(); on a second
        connection, too, while more than 64 KiB of this one may be ahead of it. The call itself sends the stop; the
        coroutine, which should be awaited, tells whether it arrives: it raises as hapticd.Client.stop_forces(). In
        another thread than the event loop's, the call does nothing, and asyncio.run_coroutine_threadsafe() hands the
        coroutine over."""
        return self._stop() if self._is_used_elsewhere() else self._stopped(self._send_stop())

    async def _stop(self) -> None:
        await self._stopped(self._send_stop())

    async def _stopped(self, sent: "Union[None, Exception, Awaitable[None]]") -> None:
        if isinstance(sent, Exception):
            raise sent
        if sent is not None:
            await sent
        else:
            self._check_arrival("forces not stopped")
        await self._require(m.FEATURE_STOP, "stop the forces")

    def _send_stop(self) -> "Union[None, Exception, Awaitable[None]]":
        """The second connection, when it needs one; or the reason why nothing was sent, which must not keep a program from
        its next call: the stop of another device, perhaps."""
        try:
            return self._put_stop()
        except Exception as error:
            return error

    def _put_stop(self) -> "Optional[Awaitable[None]]":
        backlog = self._peer.stream_bytes if self._peer is not None else 0
        if self._transport is not None:
            backlog += self._transport.get_write_buffer_size()
            sock = self._transport.get_extra_info("socket")
            if sock is not None and not self._transport.is_closing():
                backlog += unacknowledged(sock)
        behind = backlog > STOP_BACKLOG_BYTES and (not self._answered or self._has(m.FEATURE_STOP))
        self._put_key()
        if not self._put_now(m.StopForces()):
            raise ConnectionLost(f"forces not stopped: {self._why_not_connected()}")
        self._push()
        return self._loop.create_task(self._stop_beside(backlog)) if behind else None

    def _send_at_once(self, message: Any, failure: str) -> None:
        if not self._put_now(message):
            raise ConnectionLost(f"{failure}: {self._why_not_connected()}")
        self._push()
        self._check_arrival(failure)

    def _check_arrival(self, failure: str) -> None:
        """As in hapticd.Client. The event loop, too, tells of an end only in its next turn."""
        transport = self._transport
        if transport is not None:
            sock = transport.get_extra_info("socket")
            if transport.is_closing() or (sock is not None and has_ended(sock)):
                self._abort(CLOSED_BY_SERVER)
        if not self.connected:
            raise ConnectionLost(f"{failure}: {self._why_not_connected()}")

    async def _stop_beside(self, backlog: int) -> None:
        timeout = max(self._options.connect_timeout, 1.0)
        options = Options(connect_timeout=0, reconnect=False, send_timeout=END_S)
        deadline = self._loop.time() + timeout
        async with connect(f"{self.device}@tcp://{self._target[0]}:{self._target[1]}", options) as beside:
            sent = await beside._wait(lambda: beside.connected, timeout)
            if sent:
                beside._put_now(self._identity())
                beside._put_now(m.StopForces())
                beside._ping()
                beside._push()
                sent = await beside._wait(lambda: beside._all_pongs, max(0.0, deadline - self._loop.time()))
            if not sent:
                raise ConnectError(
                    f"stop not confirmed: it waits behind {backlog} bytes, and a second connection to {self.server} got "
                    f"no answer: {beside._why_not_connected()}"
                )

    async def rearm_forces(self) -> None:
        """Ends a stop and clears latched trips; the force ramps in over half a second. Acts only while its client is there, and
        raises, as hapticd.Client.rearm_forces()."""
        await self._require(m.FEATURE_STOP, "re-arm the forces")
        self._put_key()
        self._send_at_once(m.RearmForces(), "forces not re-armed")

    async def mark(self, text: str) -> None:
        """Marks a moment, such as "trial 3 begins"; see hapticd.Client.mark()."""
        self._send_at_once(m.Marker(0, text), "not marked")
        self._refuse_other_makes("mark a moment")

    def present_token(self, token: str) -> None:
        """Presents a token for a role, on every connection from now on: 16 to 128 characters (ValueError).
        An empty one presents none on later connections; the present one keeps its role. Without TLS, everybody on the
        way can read it. A refusal arrives as a text."""
        self._set_token(token)
        self._push()

    async def enable_heartbeat(self, enable: bool = True) -> None:
        """From now on the server disconnects this client and ends its effects when it receives no heartbeat for
        500 ms: a program that blocks the event loop that long is disconnected."""
        if self.connected:
            await self._require(m.FEATURE_HEARTBEAT, "watch the heartbeat")
        self._set_heartbeats(enable)
        self._push()
        self._turn()

    async def set_remote_contacts(self, contacts: Sequence[RemoteContact]) -> None:
        """Replaces this client's contacts, at most 16, for simulations that run in the client. Sent at once, even inside
        batch(), by TCP: datagrams can be forged. The newest value wins; call at a steady rate of 30 to 1000 Hz. The
        server renders them at its servo rate, moves them by their velocities, and takes over changes within 0.3 N/ms.
        Contacts that are not repeated end at the end of their lifetime, contacts that are absent from a later call
        fade out at once, all of them when the client leaves. Dropped without a connection. One client streams to a
        device at a time; the server refuses others with a text. HandReport has the force of each."""
        if self.connected:
            await self._require(m.FEATURE_REMOTE_CONTACTS, "stream contacts")
        self._put_contacts(contacts)
        self._push()

    async def set_force(self, force_N: Numbers, torque_Nm: Numbers = (0.0, 0.0, 0.0), lifetime_s: float = 0.1) -> None:
        """Has a force (N, world frame) held until the next call, at most for `lifetime_s` (0.01 to 0.1). Sent as
        set_remote_contacts(). The server changes it by at most 0.3 N/ms, and cuts the part that adds power to the hand
        when its budget of energy is spent (HandReport.energy_spent). A torque (N m) is felt only on devices that render
        it. Prefer set_remote_contacts() for everything that is stiff: a force is always late by the round trip."""
        if self.connected:
            await self._require(m.FEATURE_REMOTE_CONTACTS, "hold a force")
        self._put_force(force_N, torque_Nm, lifetime_s)
        self._push()

    async def hold_hand(
        self, position: Numbers, orientation: Numbers = (0.0, 0.0, 0.0, 1.0), buttons: int = 0
    ) -> None:
        """Takes hold of the simulated hand and moves it to the pose; world units, orientation x y z w."""
        if self.connected:
            await self._require(m.FEATURE_HOLD_HAND, "hold the hand")
        self._put_now(m.HoldHand(1, position, orientation, buttons))
        self._push()

    async def release_hand(self) -> None:
        """Releases the simulated hand. Disconnecting releases it, too."""
        if self.connected:
            await self._require(m.FEATURE_HOLD_HAND, "release the hand")
        self._put_now(m.HoldHand())
        self._push()


class _Connecting:
    """What connect() gives: to be awaited, or entered by `async with`."""

    def __init__(self, device: str, options: Options) -> None:
        self._device = device
        self._options = options
        self._client: Optional[Client] = None

    async def _open(self) -> Client:
        client = Client(self._device, self._options)
        await client._start()
        return client

    def __await__(self) -> Generator[Any, None, Client]:
        return self._open().__await__()

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> NoReturn:
            raise AttributeError(f"{name}: connect() gives the client to 'await connect(...)' or 'async with connect(...) as hand'")

    async def __aenter__(self) -> Client:
        self._client = await self._open()
        return self._client

    async def __aexit__(self, *reason: Any) -> None:
        assert self._client is not None
        await self._client.__aexit__(*reason)


def connect(device: str, options: Optional[Options] = None, **fields: Any) -> _Connecting:
    """`hand = await connect(...)` or `async with connect(...) as hand`; arguments as in hapticd.connect()."""
    return _Connecting(device, options_of(options, fields))
