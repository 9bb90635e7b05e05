"""Readout against bare loops on the same wire: `make bench`. Ratios of medians of five, both sides in one run.

.venv/bin/python bench/wires.py [--only NAME] [--tries 5]
"""

import argparse
import asyncio
import logging
import os
import socket
import struct
import subprocess
import sys
import tempfile
import time
import zlib
from collections.abc import Callable
from itertools import count
from pathlib import Path
from statistics import median

import numpy as np
import serial
from pymodbus.client import AsyncModbusTcpClient

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))
from emulator import Emulator, address, until

from daq.chunks import Chunks
from daq.modbus import Modbus
from daq.modbus_device import ModbusDevice
from daq.profile import ModbusProfile, ScpiProfile, load_profile
from daq.readout import read_record
from daq.recorder import Device
from daq.scpi_device import ScpiDevice

Timed = Callable[[], None]


def ratio(name: str, reach: float, bare: Timed, ours: Timed, tries: int) -> None:
    """Print the share of the bare loop's speed that is reached; the two take turns, to see the same machine."""
    times: tuple[list[float], list[float]] = ([], [])
    for _ in range(tries):
        for call, spent in zip((bare, ours), times, strict=True):
            started = time.perf_counter()
            call()
            spent.append(time.perf_counter() - started)
    found = median(times[0]) / median(times[1])
    print(f"| {name} | {median(times[0]):.4f} | {median(times[1]):.4f} | {found:.3f} | {reach:g} |", flush=True)


def hold(emulator: Emulator, samples: int) -> None:
    """Let the emulator hold a record of `samples`."""
    with socket.create_connection(address(emulator.endpoints["scpi_tcp"])) as link, link.makefile("rw") as lines:
        lines.write(f"SWE:POIN {samples}\nTRIG:LEV 100\nINIT\n*OPC?\n")
        lines.flush()
        lines.readline()

        def condition() -> int:
            lines.write("STAT:OPER:COND?\n")
            lines.flush()
            return int(lines.readline())

        until(lambda: condition() == 40)
        emulator.do("release")
        until(lambda: condition() == 256, 30)


def scpi_device(port: str, baud: int) -> ScpiDevice:
    """The driver as a rig file without a profile has it."""
    profile, _ = load_profile("droptower-scpi", "scpi")
    assert isinstance(profile, ScpiProfile)
    return ScpiDevice(port, baud, profile, 1)


def modbus_device(port: str, baud: int) -> ModbusDevice:
    """As above."""
    profile, _ = load_profile("droptower-modbus", "modbus")
    assert isinstance(profile, ModbusProfile)
    return ModbusDevice(port, baud, 1, profile, 1)


FOLDER = tempfile.TemporaryDirectory()
"""Where chunks are noted; emptied at the end, as a run's are once it is saved."""
NUMBERS = count()


def noted() -> Path:
    """A new file for chunks."""
    return Path(FOLDER.name) / f"chunks-{next(NUMBERS)}"


def whole(device: Device) -> Timed:
    """Our readout of the held record, every check on, nothing noted from the time before."""
    device.resynchronise()
    header = device.header()

    def read() -> None:
        chunks = Chunks(noted(), header.as_json())
        assert not read_record(device, header, chunks, lambda done, total: None).gaps
        chunks.close()

    return read


def promised_tcp(endpoint: str, samples: int) -> Timed:
    """The bare loop with what the promise asks of every sample, each step bare: kept, CRC-32 twice, on disk."""
    link = socket.create_connection(address(endpoint))
    half = samples // 2

    def read() -> None:
        out = np.zeros(samples, dtype=np.int16)
        with noted().open("wb", buffering=0) as file:
            for start in (0, half):
                link.sendall(f"TRAC:DATA? CH1,{start},{half}\n".encode())
                came = bytearray()
                size = 2 * half + 2 + len(str(2 * half)) + 1
                while len(came) < size:
                    came += link.recv(1 << 18)
                part = np.frombuffer(came, dtype=">i2", count=half, offset=size - 1 - 2 * half).astype(np.int16)
                zlib.crc32(part.data)
                file.write(part.data)
                out[start : start + half] = part
        zlib.crc32(out.data)

    return read


def bare_line(path: str, samples: int) -> Timed:
    """One query and plain 64 KiB reads of a pty."""
    size = 2 * samples
    fd = os.open(path, os.O_RDWR | os.O_NOCTTY)

    def read() -> None:
        os.write(fd, f"TRAC:DATA? CH1,0,{samples // 2};:TRAC:DATA? CH1,{samples // 2},{samples // 2}\n".encode())
        seen = 0
        while seen < size + 2 * (2 + len(str(size // 2))) + 2:
            seen += len(os.read(fd, 1 << 16))

    return read


def bare_tcp(endpoint: str, samples: int) -> Timed:
    """One query and plain 64 KiB reads of a socket."""
    link = socket.create_connection(address(endpoint))
    half = samples // 2

    def read() -> None:
        link.sendall(f"TRAC:DATA? CH1,0,{half};:TRAC:DATA? CH1,{half},{half}\n".encode())
        seen = 0
        while seen < 2 * samples + 2 * (2 + len(str(samples))) + 2:
            seen += len(link.recv(1 << 16))

    return read


def bare_rtu(path: str, samples: int, baud: int) -> Timed:
    """Requests one after the other, the silence kept, nothing checked."""
    from pymodbus.framer.rtu import FramerRTU

    requests: list[tuple[bytes, int]] = []
    for start in range(0, samples, 125):
        n = min(125, samples - start)
        body = struct.pack(">BBHH", 1, 4, 0x1000 + start, n)
        requests.append((body + FramerRTU.compute_CRC(body).to_bytes(2, "big"), 5 + 2 * n))

    def read() -> None:
        with serial.Serial(path, baud, timeout=5) as line:
            for request, size in requests:
                line.write(request)
                assert len(line.read(size)) == size
                time.sleep(1.75e-3)

    return read


def scpi_paced(baud: int, tries: int) -> None:
    samples = 100_000
    with Emulator("--baud", str(baud)) as emulator:
        hold(emulator, samples)
        device = scpi_device(emulator.endpoints["scpi_pty"], baud)
        bare = bare_line(emulator.endpoints["scpi_pty"], samples)
        ratio(f"SCPI block, pty at {baud:,} baud, 100,000 samples", 0.98, bare, whole(device), tries)
        device.close()


def rtu_paced(baud: int, reach: float, tries: int) -> None:
    samples = 20_000
    with Emulator("--baud", str(baud)) as emulator:
        hold(emulator, samples)
        device = modbus_device(emulator.endpoints["modbus_rtu"], baud)
        ours = whole(device)
        ratio(
            f"Modbus RTU, pty at {baud:,} baud, 20,000 samples", reach,
            bare_rtu(emulator.endpoints["modbus_rtu"], samples, baud), ours, tries,
        )  # fmt: skip
        device.close()


def scpi_unpaced(tries: int) -> None:
    samples = 1_000_000
    with Emulator() as emulator:
        hold(emulator, samples)
        pty, tcp = emulator.endpoints["scpi_pty"], emulator.endpoints["scpi_tcp"]
        device: Device = scpi_device(pty, 921600)
        ratio("SCPI, pty without pace, 1,000,000 samples", 0.6, bare_line(pty, samples), whole(device), 3 * tries)
        device.close()
        device = scpi_device(tcp, 921600)
        ratio("SCPI, TCP, 1,000,000 samples", 0.5, bare_tcp(tcp, samples), whole(device), 3 * tries)
        promised = promised_tcp(tcp, samples)
        ratio(
            "the same against a loop that keeps, checks and notes, each step bare",
            0,
            promised,
            whole(device),
            3 * tries,
        )
        device.close()


def modbus_tcp(tries: int) -> None:
    count = 500_000
    canned = subprocess.Popen(
        [sys.executable, Path(__file__).with_name("responder.py")], stdout=subprocess.PIPE, text=True
    )
    assert canned.stdout is not None
    port = int(canned.stdout.readline())
    bus = Modbus(f"tcp://127.0.0.1:{port}", 0, 1)

    def ours() -> None:
        for start in range(0, count, 50_000):
            bus.bulk(4, 0, min(50_000, count - start), 16)

    def pymodbus_async() -> None:
        async def read() -> None:
            client = AsyncModbusTcpClient("127.0.0.1", port=port)
            await client.connect()
            for _ in range(count // 125):
                assert len((await client.read_input_registers(0, count=125)).registers) == 125
            client.close()

        asyncio.run(read())

    link = socket.create_connection(("127.0.0.1", port))
    request = b"".join(struct.pack(">HHHBBHH", t, 0, 6, 1, 4, 0, 125) for t in range(16))

    def raw() -> None:
        asked = seen = 0
        total = count // 125
        while seen < total * 259:
            while asked < total and asked - seen // 259 < 16:
                link.sendall(request[:12] * min(16 - (asked - seen // 259), total - asked))
                asked += min(16 - (asked - seen // 259), total - asked)
            seen += len(link.recv(1 << 16))

    ratio("Modbus TCP, 500,000 registers, against pymodbus's async client", 5, pymodbus_async, ours, tries)
    ratio("Modbus TCP, 500,000 registers, against a raw pipelined loop", 0.3, raw, ours, tries)
    link.close()
    bus.close()
    canned.terminate()
    canned.wait()
    canned.stdout.close()


ROWS: dict[str, Callable[[int], None]] = {
    "modbus-tcp": modbus_tcp,
    "scpi-unpaced": scpi_unpaced,
    "rtu-921600": lambda tries: rtu_paced(921_600, 0.85, tries),
    "scpi-921600": lambda tries: scpi_paced(921_600, tries),
    "rtu-115200": lambda tries: rtu_paced(115_200, 0.95, tries),
    "scpi-115200": lambda tries: scpi_paced(115_200, tries),
}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", choices=list(ROWS), action="append")
    parser.add_argument("--tries", type=int, default=5)
    given = parser.parse_args()
    logging.getLogger("pymodbus").setLevel(logging.CRITICAL)
    print("| what | bare, s | ours, s | share of the bare speed | reach |\n|---|---|---|---|---|")
    for name in given.only or ROWS:
        print(f"measuring {name}", file=sys.stderr, flush=True)
        ROWS[name](given.tries)


if __name__ == "__main__":
    main()
