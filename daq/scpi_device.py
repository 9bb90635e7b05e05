"""Recorder, gate and interlock by SCPI, as `docs/device-protocol.md` has it."""

import numpy as np

from daq.errors import BadReply
from daq.recorder import Condition, Counts, GateReading, Header, Interlock, Settings, Status
from daq.scpi import Scpi
from daq.wire import Wire


class ScpiDevice:
    """A device on a serial line, `socket://` or `rfc2217://`; see `daq.recorder.Device`."""

    def __init__(self, port: str, baud: int) -> None:
        self._scpi = Scpi(Wire(port, baud))
        self._order = ">"

    def resynchronise(self) -> None:
        self._scpi.wire.drain()
        word = self._scpi.block("FORM:SENT?", 2)
        orders = {b"\x01\x02": ">", b"\x02\x01": "<"}
        if word not in orders:
            raise BadReply(f"{self._scpi.wire.port}: the known word reads {word.hex()}, not 0102 or 0201")
        self._order = orders[word]

    def identity(self) -> str:
        return self._scpi.query("*IDN?")

    def status(self) -> Status:
        condition, boot, held, last, config = self._scpi.numbers("TRAC:STAT?", 5)
        return Status(Condition(condition), boot, held, last, config)

    def configure(self, settings: Settings) -> None:
        s = settings
        self._scpi.command(
            f"SENS:SWE:TINT {s.interval_ns * 1e-9:.9e}",
            "SENS:SWE:OFFS:POIN 0",  # the old pre-trigger may exceed the new number of points
            f"SENS:SWE:POIN {s.points}",
            f"SENS:SWE:OFFS:POIN {-s.pretrigger}",
            f"TRIG:SOUR {s.source}",
            f"TRIG:LEV {s.level}",
            f"TRIG:SLOP {s.slope}",
            f"TRIG:DEL {s.delay_ns * 1e-9:.9e}",
            "FORM INT,16",
        )

    def settings(self) -> Settings:
        ask = self._scpi
        return Settings(
            interval_ns=round(ask.number("SENS:SWE:TINT?") * 1e9),
            points=int(ask.number("SENS:SWE:POIN?")),
            pretrigger=-int(ask.number("SENS:SWE:OFFS:POIN?")),
            level=int(ask.number("TRIG:LEV?")),
            source=ask.query("TRIG:SOUR?"),
            slope=ask.query("TRIG:SLOP?"),
            delay_ns=round(ask.number("TRIG:DEL?") * 1e9),
        )

    def arm(self) -> None:
        self._scpi.command("INIT")

    def abort(self) -> None:
        self._scpi.command("ABOR")

    def header(self) -> Header:
        numbers = self._scpi.numbers("TRAC:HEAD?")
        if len(numbers) < 10 or (numbers[0] and len(numbers) != 9 + numbers[8]):
            raise BadReply(f"{self._scpi.wire.port}: TRAC:HEAD? gave {len(numbers)} numbers: {numbers}")
        return Header(*numbers[:8], crcs=tuple(numbers[9:]))

    def read(self, channel: int, start: int, count: int) -> Counts:
        data = self._scpi.block(f"TRAC:DATA? CH{channel},{start},{count}", 2 * count)
        return np.frombuffer(data, dtype=f"{self._order}i2").astype(np.int16, copy=False)

    def crc(self, channel: int, start: int, count: int) -> int:
        return self._scpi.numbers(f"TRAC:CRC? CH{channel},{start},{count}", 1)[0]

    def acknowledge(self, record_id: int, crc: int) -> None:
        self._scpi.command(f"TRAC:ACK {record_id},{crc}")

    def gate(self) -> GateReading:
        record_id, count, *edges = self._scpi.numbers("GATE:DATA?")
        if len(edges) != count:
            raise BadReply(f"{self._scpi.wire.port}: GATE:DATA? announces {count} edges and gives {len(edges)}")
        return GateReading(record_id, tuple(edges))

    def beam_free(self) -> bool:
        return self._scpi.numbers("GATE:BEAM?", 1)[0] == 1

    def interlock(self) -> Interlock:
        return Interlock(self._scpi.numbers("INT:STAT?", 1)[0])

    def close(self) -> None:
        self._scpi.wire.close()
