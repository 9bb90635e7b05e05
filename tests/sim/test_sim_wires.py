"""What the wires promise: many clients, no lost byte, the pace of a serial line, no idle work."""

from __future__ import annotations

import struct
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from clients import Modbus, Rtu, Scpi, Tcp, record, take
from emulator import Emulator, until

PACED = 115_200


@pytest.fixture(scope="module")
def paced():
    with Emulator("--baud", str(PACED), "--seed", "5") as running:
        running.do("catcher", on=True)
        with Scpi(running.endpoints["scpi_tcp"]) as scpi:
            take(running, scpi)
        yield running


def test_clients_come_and_go_on_a_pty(shared_emulator: Emulator):
    for _ in range(5):
        with Scpi(shared_emulator.endpoints["scpi_pty"]) as scpi:
            assert scpi.ask("*OPC?") == "1"


def test_all_wires_are_served_at_once(shared_emulator: Emulator):
    ends = shared_emulator.endpoints
    with Scpi(ends["scpi_tcp"]) as scpi:
        take(shared_emulator, scpi, "TRIG:LEV 100", "SWE:POIN 200000")
        expected = record(scpi).tobytes()
    results: dict[str, list[bytes]] = {}

    def by_scpi(name: str, url: str) -> None:
        with Scpi(url, timeout=30) as client:
            results[name] = [record(client).tobytes() for _ in range(3)]

    def by_modbus(name: str, url: str) -> None:
        with Modbus(url) as client:
            results[name] = [client.samples(0, 20_000).tobytes() for _ in range(2)]

    jobs = [(by_scpi, "a", ends["scpi_tcp"]), (by_scpi, "b", ends["scpi_tcp"]), (by_scpi, "c", ends["scpi_pty"])]
    jobs += [(by_modbus, "d", ends["modbus_tcp"]), (by_modbus, "f", ends["modbus_rtu"])]
    threads = [threading.Thread(target=job, args=arguments) for job, *arguments in jobs]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert sorted(results) == ["a", "b", "c", "d", "f"]
    for name in "abc":
        assert all(taken == expected for taken in results[name]), name
    for name in "df":
        assert all(taken == expected[:40_000] for taken in results[name]), name


def test_a_client_who_does_not_read_loses_nothing_and_holds_nobody_up(shared_emulator: Emulator):
    ends = shared_emulator.endpoints
    with Scpi(ends["scpi_tcp"]) as scpi, Scpi(ends["scpi_pty"], timeout=30) as slow:
        take(shared_emulator, scpi, "TRIG:LEV 100", "SWE:POIN 1000000")
        slow.send("TRAC:DATA? CH1,0,500000")
        assert scpi.ask("*OPC?") == "1"
        expected = scpi.block("TRAC:DATA? CH1,0,500000")
        assert slow.port.read(9) == b"#71000000"
        assert slow.port.read(1_000_000) == expected
        assert slow.port.read(1) == b"\n"


def test_a_block_takes_the_wire_time_of_its_baud_rate(paced: Emulator):
    with Scpi(paced.endpoints["scpi_pty"], timeout=30) as scpi:
        scpi.ask("*OPC?")
        taken: list[float] = []
        for _ in range(3):
            started = time.monotonic()
            data = scpi.block("FETC?")
            taken.append(time.monotonic() - started)
    wire = 10 / PACED * (len(data) + len("FETC?\n") + len("#510000\n"))
    # Never faster than the wire; how much slower is the machine's affair, so the best of three counts.
    assert all(t > 0.99 * wire for t in taken)
    assert min(taken) == pytest.approx(wire, rel=0.05)


def test_rtu_frames_take_their_wire_time_and_silences(paced: Emulator):
    line, started = Rtu(paced.endpoints["modbus_rtu"]), time.monotonic()
    n = 40
    for k in range(n):
        line.exchange(struct.pack(">BHH", 4, 0x1000 + 120 * k, 125))
    taken = time.monotonic() - started
    line.close()
    wire = n * (10 / PACED * (8 + 255) + 2 * 1.75e-3)
    assert wire * 0.98 < taken


def test_tcp_is_not_paced(paced: Emulator):
    with Scpi(paced.endpoints["scpi_tcp"]) as scpi:
        started = time.monotonic()
        assert len(record(scpi)) == 5000
        assert time.monotonic() - started < 10 / PACED * 10_000, "the wire time of a paced line"


def test_an_idle_emulator_uses_next_to_no_processor(shared_emulator: Emulator):
    stat = Path(f"/proc/{shared_emulator.process.pid}/stat")

    def ticks() -> int:
        fields = stat.read_text().rsplit(")", 1)[1].split()
        return int(fields[11]) + int(fields[12])

    with Scpi(shared_emulator.endpoints["scpi_tcp"]) as scpi:
        scpi.done("TRIG:LEV 300")
        scpi.done("INIT")
        assert until(scpi.condition)
    before, end = ticks(), time.monotonic() + 1.0
    until(lambda: time.monotonic() > end)
    # A tick is 10 ms.
    assert ticks() - before <= 2


def test_pipelined_blocks_come_in_order_with_nothing_between(shared_emulator: Emulator):
    with Scpi(shared_emulator.endpoints["scpi_tcp"]) as scpi:
        take(shared_emulator, scpi)
        samples = record(scpi)
    client = Tcp(shared_emulator.endpoints["modbus_tcp"])
    frames = [client.frame(struct.pack(">BHH", 4, 0x1000 + 125 * k, 125)) for k in range(40)]
    client.socket.sendall(b"".join(frames))
    got = b"".join(client.reply()[1][2:] for _ in frames)
    client.close()
    assert np.array_equal(np.frombuffer(got, ">i2"), samples)
