"""Recorder, gate and interlock by Modbus, as `docs/device-protocol.md` has it."""

from collections.abc import Sequence

import numpy as np

from daq.errors import BadReply, DeviceError, LinkError
from daq.modbus import Modbus, join, split
from daq.recorder import Condition, Counts, GateReading, Header, Interlock, Settings, Status

WORD_16, WORD_32 = 0x0102, 0x01020304
WINDOW, WINDOW_SAMPLES = 0x1000, 0x10000 - 0x1000
SOURCES, SLOPES = ("INT", "IMM", "EXT"), ("POS", "NEG")
INIT, ABORT, ACKNOWLEDGE, CLEAR_ERRORS = 1, 2, 3, 4


class ModbusDevice:
    """A device on an RTU line or `tcp://`; see `daq.recorder.Device`."""

    def __init__(self, port: str, baud: int, unit_id: int) -> None:
        self._bus = Modbus(port, baud, unit_id)
        self._high_first = True
        self._at_once = 1
        self._window: tuple[int, int] | None = None

    def resynchronise(self) -> None:
        self._bus.drain()
        self._window = None
        first, *pair = self._bus.input(0, 3)
        if first != WORD_16 or pair not in ([0x0102, 0x0304], [0x0304, 0x0102]):
            raise BadReply(
                f"port {self._bus.port}: the known words read {first:04x} {pair[0]:04x}{pair[1]:04x}, not 0102 01020304"
            )
        self._high_first = pair == [0x0102, 0x0304]
        self._at_once = min(max(self._bus.input(4, 1)[0], 1), 16)

    def _join(self, registers: Sequence[int], signed: bool = False) -> int:
        return join(registers if self._high_first else registers[::-1], signed)

    def _split(self, value: int, registers: int) -> list[int]:
        parts = split(value, registers)
        return parts if self._high_first else parts[::-1]

    def identity(self) -> str:
        data = b"".join(r.to_bytes(2, "big") for r in self._bus.input(8, 32))
        return data.rstrip(b"\0").decode("ascii", "replace")

    def status(self) -> Status:
        r = self._bus.input(64, 9)
        return Status(Condition(r[0]), *(self._join(r[i : i + 2]) for i in (1, 3, 5, 7)))

    def configure(self, settings: Settings) -> None:
        s = settings
        self._bus.write(
            0,
            [
                *self._split(s.interval_ns, 2),
                *self._split(s.points, 2),
                *self._split(s.pretrigger, 2),
                SOURCES.index(s.source),
                s.level & 0xFFFF,
                SLOPES.index(s.slope),
                *self._split(s.delay_ns, 2),
            ],
        )

    def settings(self) -> Settings:
        r = self._bus.holding(0, 11)
        if r[6] >= len(SOURCES) or r[8] >= len(SLOPES):
            raise BadReply(f"port {self._bus.port}: trigger source {r[6]}, slope {r[8]} are not known")
        return Settings(
            interval_ns=self._join(r[0:2]),
            points=self._join(r[2:4]),
            pretrigger=self._join(r[4:6]),
            source=SOURCES[r[6]],
            level=join(r[7:8], signed=True),
            slope=SLOPES[r[8]],
            delay_ns=self._join(r[9:11]),
        )

    def _command(self, what: str, code: int) -> None:
        try:
            self._bus.write(16, [code])
        except DeviceError as e:
            raise DeviceError(f"{what} was refused: {e}{self._reason()}") from None

    def _reason(self) -> str:
        """The device's own error code. Read after a refusal, and cleared, so that the next one is not taken for it."""
        try:
            code = join(self._bus.input(86, 1), signed=True)
            self._bus.write(16, [CLEAR_ERRORS])
        except (LinkError, DeviceError):
            return ""
        return f" (error {code})" if code else ""

    def arm(self) -> None:
        self._command("INIT", INIT)

    def abort(self) -> None:
        self._command("ABOR", ABORT)

    def header(self) -> Header:
        r = self._bus.input(96, 28)
        channels = min(r[19], 4)
        return Header(
            record_id=self._join(r[0:2]),
            boot=self._join(r[2:4]),
            config_hash=self._join(r[4:6]),
            points=self._join(r[6:8]),
            interval_ns=self._join(r[8:10]),
            first_sample_ns=self._join(r[10:14], signed=True),
            trigger_us=self._join(r[14:18]),
            bits=r[18],
            crcs=tuple(self._join(r[20 + 2 * i : 22 + 2 * i]) for i in range(channels)),
        )

    def read(self, channel: int, start: int, count: int) -> Counts:
        out = np.empty(count, dtype=np.uint16)
        done = 0
        while done < count:
            at = start + done
            base = self._turn_page(channel, at)
            n = min(count - done, WINDOW_SAMPLES - (at - base))
            out[done : done + n] = self._bus.bulk(WINDOW + at - base, n, self._at_once)
            done += n
        return out.view(np.int16)

    def _turn_page(self, channel: int, at: int) -> int:
        """First sample of a window that holds sample `at`."""
        if self._window is None or self._window[0] != channel or not 0 <= at - self._window[1] < WINDOW_SAMPLES:
            self._window = None
            base = at - at % WINDOW_SAMPLES
            self._bus.write(32, [channel, *self._split(base, 2)])
            self._window = (channel, base)
        return self._window[1]

    def crc(self, channel: int, start: int, count: int) -> int:
        self._bus.write(36, [channel, *self._split(start, 2), *self._split(count, 2)])
        return self._join(self._bus.input(168, 2))

    def acknowledge(self, record_id: int, crc: int) -> None:
        self._bus.write(18, [*self._split(record_id, 2), *self._split(crc, 2)])
        self._command("the acknowledgement", ACKNOWLEDGE)

    def gate(self) -> GateReading:
        r = self._bus.input(128, 36)
        if r[2] > 8:
            raise BadReply(f"port {self._bus.port}: the gate announces {r[2]} edges, it holds 8")
        edges = tuple(self._join(r[4 + 4 * i : 8 + 4 * i], signed=True) for i in range(r[2]))
        return GateReading(self._join(r[0:2]), edges)

    def beam_free(self) -> bool:
        return self._bus.input(74, 1)[0] == 1

    def interlock(self) -> Interlock:
        return Interlock(self._bus.input(73, 1)[0])

    def close(self) -> None:
        self._bus.close()
