"""The TCP ends of the device; loopback only."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import cast

from sim_device.faults import Faults, Pause, Pieces
from sim_device.modbus import TcpSession
from sim_device.wires import Session

HOST = "127.0.0.1"


class Link(asyncio.Protocol):
    """One client's connection, with a session of its own."""

    def __init__(self, session: Session, faults: Faults, links: set[Link]) -> None:
        """Serve ``session``; ``links`` lists those that are open."""
        self._session, self._faults, self._links = session, faults, links
        self._transport: asyncio.Transport | None = None
        self._pieces: Pieces = []
        self._stalled: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """A client has come."""
        self._transport = cast("asyncio.Transport", transport)
        self._links.add(self)

    def connection_lost(self, exc: Exception | None) -> None:
        """The client has gone, or the link was closed."""
        self._links.discard(self)
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
        for name, reply in self._session.feed(self._faults.incoming(data)):
            self._pieces += self._faults.outgoing(name, reply)
        if self._stalled is None:
            self._send()
        if isinstance(self._session, TcpSession) and self._session.broken:
            self.close()

    def _send(self) -> None:
        self._stalled = None
        run: list[bytes] = []
        while self._pieces:
            piece = self._pieces.pop(0)
            if isinstance(piece, Pause):
                self._stalled = asyncio.get_running_loop().call_later(piece.seconds, self._send)
                break
            run.append(piece)
        if self._transport is not None and run:
            self._transport.write(b"".join(run))

    def close(self) -> None:
        """Close the link; what is under way is lost."""
        if self._transport is not None:
            self._transport.abort()


async def serve(session: Callable[[], Session], faults: Faults) -> tuple[asyncio.Server, int, set[Link]]:
    """Open a port of the system's choice; returns the server, the port and the set of open links."""
    links: set[Link] = set()
    loop = asyncio.get_running_loop()
    server = await loop.create_server(lambda: Link(session(), faults, links), HOST, 0)
    return server, int(server.sockets[0].getsockname()[1]), links
