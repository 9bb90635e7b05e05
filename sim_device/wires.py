"""Pseudo-terminals: the device's serial lines, with back-pressure and, if asked for, the pace of a baud rate."""

from __future__ import annotations

import asyncio
import contextlib
import os
import tty
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Protocol

from sim_device.fault import Cut, Language, Pause
from sim_device.faults import Faults
from sim_device.modbus import RtuSession
from sim_device.pacing import Pace

READ_SIZE = 1 << 16
FULL = 1 << 22
"""Bytes under way at which a line takes no more, so that a client who never reads costs no memory."""
TICK = 1e-3
"""s, the shortest wait of a paced line: bytes leave in the groups that this makes."""
HELD_UP = 0.05
"""s; a host that takes nothing for longer makes the line start its pace anew, not catch up."""
REPLUGGED = 0.1
"""s, the least time for which a serial port that was cut is gone."""
RTU_SILENCE = 0.05
"""s without a byte after which an unfinished RTU frame is garbage: a host's scheduler may part the bytes of a frame."""


class Session(Protocol):
    """A language on a line."""

    language: Language

    def feed(self, data: bytes) -> Iterator[tuple[str, bytes]]:
        """Take bytes in, yield replies with the names of their commands."""
        ...


class SerialLine:
    """One pty with a session behind it. The slave end stays open here, so that clients may come and go."""

    def __init__(self, session: Callable[[], Session], faults: Faults, baud: int | None, path: Path) -> None:
        """Open a pty in raw mode and serve it on the running loop; ``path`` is made a link to it."""
        self.path = path
        self._new_session, self._session, self._faults = session, session(), faults
        self._paced = baud is not None
        self._in_pace, self._out_pace = Pace(baud), Pace(baud)
        self._arriving: deque[tuple[float, bytes]] = deque()
        self._leaving: deque[memoryview | Pause | Cut] = deque()
        self._waiting = 0
        self._loop = asyncio.get_running_loop()
        self._writing: asyncio.TimerHandle | None = None
        self._arrival: asyncio.TimerHandle | None = None
        self._idle: asyncio.TimerHandle | None = None
        self._returning: asyncio.TimerHandle | None = None
        self._blocked = self._reading = False
        self._open()

    def _open(self) -> None:
        """A new pty behind the same path, as an adapter that is plugged in again has."""
        self._returning = None
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.path.symlink_to(os.ttyname(self._slave))
        self._there = True
        self._read_or_not()

    def _vanish(self) -> None:
        self.reset()
        self._there = False
        self._read_or_not()
        self.path.unlink(missing_ok=True)
        os.close(self._slave)
        os.close(self._master)

    def _read_or_not(self) -> None:
        wanted = self._waiting < FULL and self._there
        if wanted and not self._reading:
            self._loop.add_reader(self._master, self._readable)
        elif not wanted and self._reading:
            self._loop.remove_reader(self._master)
        self._reading = wanted

    def _readable(self) -> None:
        try:
            data = os.read(self._master, READ_SIZE)
        except (BlockingIOError, InterruptedError):
            return
        start = self._loop.time()
        if isinstance(self._session, RtuSession):
            start = max(start, self._out_pace.free_at + self._out_pace.silence)
        self._in_pace.begin(start)
        self._in_pace.take(len(data))
        self._arriving.append((self._in_pace.free_at, data))
        self._waiting += len(data)
        self._read_or_not()
        if self._arrival is None:
            self._arrive()

    def _arrive(self) -> None:
        self._arrival = None
        while self._arriving:
            at, data = self._arriving[0]
            if at > self._loop.time():
                self._arrival = self._loop.call_at(at, self._arrive)
                return
            self._arriving.popleft()
            self._waiting -= len(data)
            arrived = self._faults.incoming(data)
            if echo := self._faults.echo(data):
                self._put(echo)
            self._reply(self._session.feed(arrived), at)
            if not self._there:
                return
            if isinstance(self._session, RtuSession):
                if self._idle is not None:
                    self._idle.cancel()
                self._idle = self._loop.call_later(RTU_SILENCE, self._silent, self._session)

    def _silent(self, session: RtuSession) -> None:
        self._idle = None
        if not self._arriving:
            self._reply(session.silence(), self._loop.time())

    def _reply(self, replies: Iterator[tuple[str, bytes]], asked_at: float) -> None:
        for name, reply in replies:
            if isinstance(self._session, RtuSession) and self._paced:
                self._leaving.append(Pause(self._out_pace.silence))
            for piece in self._faults.outgoing(name, reply, self._session.language):
                if isinstance(piece, bytes):
                    self._put(piece)
                else:
                    self._leaving.append(piece)
        self._read_or_not()
        if self._writing is None and not self._blocked:
            self._out_pace.begin(asked_at)
            self._write()

    def _put(self, piece: bytes) -> None:
        if piece:
            self._leaving.append(memoryview(piece))
            self._waiting += len(piece)

    def _cut(self, cut: Cut) -> None:
        """Another client that has opened a serial line eats what is left of the reply; else the port goes."""
        if cut.how == "taken":
            self._leaving.clear()
            self._waiting = 0
            return
        self._vanish()
        self._returning = self._loop.call_later(max(cut.seconds, REPLUGGED), self._open)

    def _write(self) -> None:
        self._writing = None
        while self._leaving:
            piece, now = self._leaving[0], self._loop.time()
            if isinstance(piece, Pause):
                self._leaving.popleft()
                self._out_pace.pause((self._out_pace.free_at if self._paced else now) + piece.seconds)
                continue
            if isinstance(piece, Cut):
                self._leaving.popleft()
                self._cut(piece)
                return
            room = self._out_pace.room(now, len(piece))
            if room <= 0:
                soon = min(now + TICK, self._out_pace.due(len(piece)))
                self._writing = self._loop.call_at(max(self._out_pace.due(1), soon), self._write)
                return
            try:
                sent = os.write(self._master, piece[:room])
            except (BlockingIOError, InterruptedError):
                sent = 0
            self._out_pace.take(sent)
            self._waiting -= sent
            if sent < len(piece):
                self._leaving[0] = piece[sent:]
            else:
                self._leaving.popleft()
            if sent < room:
                self._blocked = True
                self._loop.add_writer(self._master, self._unblocked)
                break
        self._read_or_not()

    def _unblocked(self) -> None:
        self._loop.remove_writer(self._master)
        self._blocked = False
        if self._loop.time() - self._out_pace.free_at > HELD_UP:
            self._out_pace.pause(self._loop.time())
        self._write()

    def reset(self) -> None:
        """Power loss: what was on its way is gone, in both directions."""
        for timer in (self._writing, self._arrival, self._idle):
            if timer is not None:
                timer.cancel()
        self._writing = self._arrival = self._idle = None
        if self._blocked:
            self._loop.remove_writer(self._master)
            self._blocked = False
        self._leaving.clear()
        self._arriving.clear()
        self._waiting = 0
        self._session = self._new_session()
        if not self._there:
            return
        with contextlib.suppress(BlockingIOError, InterruptedError):
            while os.read(self._master, READ_SIZE):
                pass
        self._in_pace.restart(self._loop.time())
        self._out_pace.restart(self._loop.time())
        self._read_or_not()

    def close(self) -> None:
        """Close both ends."""
        if self._returning is not None:
            self._returning.cancel()
        if self._there:
            self._vanish()
