"""The TCP ends of the device; loopback only."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import struct
from collections.abc import Callable
from typing import cast

from sim_device.fault import Cut, Pause, Pieces
from sim_device.faults import Faults
from sim_device.modbus import TcpSession
from sim_device.wires import Session

HOST = "127.0.0.1"
RESET = struct.pack("ii", 1, 0)
"""SO_LINGER that makes a close a reset."""


class Link(asyncio.Protocol):
    """One client's connection, with a session of its own."""

    def __init__(self, port: Port) -> None:
        """A client of ``port``."""
        self._port, self._session, self._faults = port, port.session(), port.faults
        self._transport: asyncio.Transport | None = None
        self._pieces: Pieces = []
        self._stalled: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """A client has come."""
        self._transport = cast("asyncio.Transport", transport)
        if self._port.taken:
            self.close()
        self._port.links.add(self)

    def connection_lost(self, exc: Exception | None) -> None:
        """The client has gone, or the link was closed."""
        self._port.links.discard(self)
        if self._stalled is not None:
            self._stalled.cancel()

    def pause_writing(self) -> None:
        """The client does not read: take no more of its commands."""
        if self._transport is not None:
            self._transport.pause_reading()

    def resume_writing(self) -> None:
        """The client reads again."""
        if self._transport is not None and not self._transport.is_closing():
            self._transport.resume_reading()

    def data_received(self, data: bytes) -> None:
        """Commands."""
        arrived = self._faults.incoming(data)
        if echo := self._faults.echo(data):
            self._pieces.append(echo)
        for name, reply in self._session.feed(arrived):
            self._pieces += self._faults.outgoing(name, reply, self._session.language)
        if self._stalled is None:
            self._send()
        if isinstance(self._session, TcpSession) and self._session.broken:
            self.close()

    def _send(self) -> None:
        self._stalled = None
        run: list[bytes] = []
        cut: Cut | None = None
        while self._pieces and cut is None:
            piece = self._pieces.pop(0)
            if isinstance(piece, Pause):
                self._stalled = asyncio.get_running_loop().call_later(piece.seconds, self._send)
                break
            if isinstance(piece, Cut):
                cut = piece
            else:
                run.append(piece)
        if self._transport is not None and run:
            self._transport.write(b"".join(run))
        if cut is not None:
            self._cut(cut)

    def _cut(self, cut: Cut) -> None:
        self._pieces.clear()
        if self._transport is None:
            return
        if cut.how == "reset":
            line = self._transport.get_extra_info("socket")
            line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
            self._transport.abort()
        else:
            self._transport.close()
        if cut.how == "vanish":
            self._port.vanish(cut.seconds)
        elif cut.how == "taken":
            self._port.take(cut.seconds)

    def close(self) -> None:
        """Close the link; what is under way is lost."""
        if self._transport is not None:
            self._transport.abort()


class Port:
    """A listening port of the system's choice and the links to it."""

    def __init__(self, session: Callable[[], Session], faults: Faults) -> None:
        """Each client gets a ``session`` of its own."""
        self.session, self.faults = session, faults
        self.links: set[Link] = set()
        self.number = 0
        self.taken = False
        self._server: asyncio.Server | None = None
        self._opening: asyncio.Task[None] | None = None

    async def open(self) -> None:
        """Listen; again on the same port once it has one."""
        loop = asyncio.get_running_loop()
        self._server = await loop.create_server(lambda: Link(self), HOST, self.number, reuse_address=True)
        self.number = int(self._server.sockets[0].getsockname()[1])

    def vanish(self, seconds: float) -> None:
        """Nobody listens for some time."""
        if self._server is None:
            return
        self._server.close()
        self._server = None
        self.cut()
        self._opening = asyncio.get_running_loop().create_task(self._return(seconds))

    async def _return(self, seconds: float) -> None:
        await asyncio.sleep(seconds)
        await self.open()

    def take(self, seconds: float) -> None:
        """Every client is turned away for some time."""
        self.taken = True

        def free() -> None:
            self.taken = False

        asyncio.get_running_loop().call_later(seconds, free)

    def cut(self) -> None:
        """Close every link."""
        for link in list(self.links):
            link.close()

    def close(self) -> None:
        """Listen no more."""
        if self._opening is not None:
            self._opening.cancel()
        if self._server is not None:
            with contextlib.suppress(OSError):
                self._server.close()
        self.cut()
