"""Devices that speak no protocol of ours: a stand-in for an oscilloscope, and other people's servers on real wires."""

from __future__ import annotations

import asyncio
import os
import select
import socket
import threading
import tty
from collections.abc import Callable
from pathlib import Path

import numpy as np
from emulator import until
from numpy.typing import NDArray
from pymodbus import FramerType
from pymodbus.constants import ExcCodes
from pymodbus.server import ModbusSerialServer, ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice


class LineServer:
    """Text lines in, bytes out, over TCP; one thread a client."""

    def __init__(self, answer: Callable[[str], bytes]) -> None:
        self._answer = answer
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = f"socket://127.0.0.1:{self._server.getsockname()[1]}"
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        while True:
            try:
                link, _ = self._server.accept()
            except OSError:
                return
            threading.Thread(target=self._client, args=(link,), daemon=True).start()

    def _client(self, link: socket.socket) -> None:
        with link, link.makefile("rb") as lines:
            try:
                for line in lines:
                    if reply := self._answer(line.decode().strip()):
                        link.sendall(reply)
            except OSError:
                return

    def close(self) -> None:
        self._server.close()


def pulse(points: int, pretrigger: int, seed: int = 1) -> NDArray[np.uint8]:
    """A half sine on noise as eight bits, one byte a sample (points,)."""
    at = np.arange(points) - pretrigger + 20
    wave = 100 * np.sin(np.pi * np.clip(at / (0.3 * points), 0, 1))
    return np.clip(127 + wave + np.random.default_rng(seed).normal(0, 0.7, points), 0, 255).astype(np.uint8)


class Oscilloscope:
    """What the DS1000Z programming guide says of a single sweep and its memory, on two channels."""

    Y_INCREMENT, Y_ORIGIN, Y_REFERENCE = 0.04, 0, 127
    MOST = 250_000

    def __init__(self) -> None:
        self.state, self.source, self.start, self.stop = "STOP", 0, 1, 1
        self.told = {":ACQ:MDEP": "12000", ":TIM:MAIN:SCAL": "1e-3", ":TIM:MAIN:OFFS": "0", ":TRIG:EDG:LEV": "0",
                     ":TRIG:EDG:SLOP": "POS"}  # fmt: skip
        self.memory: list[NDArray[np.uint8]] = []
        self.spoil = 0
        """Replies with data whose last byte is still to be wrong."""
        self.commands: list[str] = []
        self._server = LineServer(self.answer)
        self.port = self._server.port

    @property
    def points(self) -> int:
        return int(self.told[":ACQ:MDEP"])

    @property
    def rate(self) -> float:
        return self.points / (12 * float(self.told[":TIM:MAIN:SCAL"]))

    def answer(self, line: str) -> bytes:
        head, _, value = line.partition(" ")
        self.commands.append(head)
        if head == ":SING":
            self.state = "WAIT"
        elif head in (":STOP", ":RUN"):
            self.state = {":STOP": "STOP", ":RUN": "RUN"}[head]
        elif head in self.told:
            self.told[head] = value
        elif head == ":WAV:SOUR":
            self.source = int(value.removeprefix("CHAN")) - 1
        elif head == ":WAV:STAR":
            self.start = int(value)
        elif head == ":WAV:STOP":
            self.stop = int(value)
        elif head.endswith("?"):
            return self._query(head).encode() + b"\n" if head != ":WAV:DATA?" else self._data()
        return b""

    def _query(self, head: str) -> str:
        if head == "*IDN?":
            return "RIGOL TECHNOLOGIES,DS1054Z,DS1ZA000000001,00.04.04"
        if head == ":SYST:ERR?":
            return '0,"No error"'
        if head == ":TRIG:STAT?":
            return self.state
        if head == ":ACQ:SRAT?":
            return f"{self.rate:.6e}"
        if head == ":WAV:PRE?":
            n = len(self.memory[0]) if self.memory else 0
            origin = float(self.told[":TIM:MAIN:OFFS"]) - 0.5 * n / self.rate
            y = f"{self.Y_INCREMENT:.6e},{self.Y_ORIGIN},{self.Y_REFERENCE}"
            return f"0,2,{n},1,{1 / self.rate:.6e},{origin:.6e},0,{y}"
        return self.told[head.removesuffix("?")]

    def _data(self) -> bytes:
        if self.state != "STOP" or not self.memory or self.stop - self.start + 1 > self.MOST:
            return b"#9000000000\n"
        data = bytearray(self.memory[self.source][self.start - 1 : self.stop].tobytes())
        if self.spoil:
            self.spoil -= 1
            data[-1] ^= 1
        return f"#9{len(data):09d}".encode() + bytes(data) + b"\n"

    def trigger(self, seed: int = 1) -> None:
        """A hit, while it waits for one."""
        until(lambda: self.state == "WAIT", what="waits for its trigger")
        self.capture(seed)

    def capture(self, seed: int) -> None:
        """A record, however it came to be."""
        before = round(self.points / 2 - float(self.told[":TIM:MAIN:OFFS"]) * self.rate)
        self.memory = [pulse(self.points, before, seed), pulse(self.points, before, seed + 100)]
        self.state = "STOP"

    def close(self) -> None:
        self._server.close()


class RegisterServer:
    """pymodbus's own server, TCP or RTU on a pty, over shared registers 0 to 9999; unit 1.

    written(at, values) is called with what a client writes; `put` sets registers from the test's side.
    """

    def __init__(self, rtu: bool, written: Callable[[int, list[int]], None] = lambda at, values: None) -> None:
        self._written, self._rtu = written, rtu
        self._registers: list[int] | None = None
        self._pending: list[tuple[int, list[int]]] = []
        self._loop = asyncio.new_event_loop()
        self._ready = threading.Event()
        self._ends: list[int] = []
        self.port = self._open_pty() if rtu else ""
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        self._ready.wait(10)

    def _open_pty(self) -> str:
        """Two ptys with a thread that carries bytes between them, as a cable does."""
        (a, a_slave), (b, b_slave) = os.openpty(), os.openpty()
        for slave in (a_slave, b_slave):
            tty.setraw(slave)
        self._ends = [a, b, a_slave, b_slave]
        self._server_path = os.ttyname(b_slave)

        def carry() -> None:
            while True:
                try:
                    for fd in select.select([a, b], [], [], 0.2)[0]:
                        os.write(b if fd == a else a, os.read(fd, 4096))
                except (OSError, ValueError):
                    return

        threading.Thread(target=carry, daemon=True).start()
        return os.ttyname(a_slave)

    async def _action(
        self, function: int, start: int, address: int, count: int, registers: list[int], values: list[int] | None
    ) -> ExcCodes | None:
        self._registers = registers
        for at, words in self._pending:
            registers[at : at + len(words)] = words
        self._pending.clear()
        if values is not None:
            self._written(address, list(values))
        for at, words in self._pending:
            registers[at : at + len(words)] = words
        self._pending.clear()
        return None

    def put(self, at: int, words: list[int]) -> None:
        """Set registers; they are there with the next request."""
        self._pending.append((at, words))

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._loop.run_until_complete(self._serve())

    async def _serve(self) -> None:
        data = SimData(0, count=10_000, values=0, datatype=DataType.REGISTERS)
        device = SimDevice(1, simdata=[data], action=self._action)
        if self._rtu:
            server = ModbusSerialServer(device, framer=FramerType.RTU, port=self._server_path, baudrate=115_200)
            await server.serve_forever(background=True)
        else:
            server = ModbusTcpServer(device, address=("127.0.0.1", 0))
            await server.serve_forever(background=True)
            assert server.transport is not None
            self.port = f"tcp://127.0.0.1:{server.transport.sockets[0].getsockname()[1]}"
        self._stop = asyncio.Event()
        self._ready.set()
        await self._stop.wait()
        await server.shutdown()

    def close(self) -> None:
        self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join(10)
        self._loop.close()
        for fd in self._ends:
            os.close(fd)


def write_rig(folder: Path, text: str) -> Path:
    """A rig file."""
    path = folder / "rig.toml"
    path.write_text(text)
    return path
