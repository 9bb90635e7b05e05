"""What acquisition asks of a device, whatever wire it hangs on."""

import zlib
from dataclasses import dataclass
from enum import IntFlag
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Counts = NDArray[np.int16]


class Condition(IntFlag):
    """Bits of the SCPI operation status register; `HELD` is one of those left to the designer."""

    SWEEPING = 1 << 3
    MEASURING = 1 << 4
    WAITING_FOR_TRIGGER = 1 << 5
    WAITING_FOR_ARM = 1 << 6
    HELD = 1 << 8


STATES = {
    "idle": Condition(0),
    "filling": Condition.SWEEPING | Condition.WAITING_FOR_ARM,
    "armed": Condition.SWEEPING | Condition.WAITING_FOR_TRIGGER,
    "measuring": Condition.SWEEPING | Condition.MEASURING,
    "complete": Condition.HELD,
}
"""States as a profile names them."""


class Interlock(IntFlag):
    """Bits of the interlock input."""

    DOOR_CLOSED = 1 << 0
    CLAMPED = 1 << 1
    CATCHER_ON = 1 << 2
    READY = 1 << 3


Found = dict[str, int | float | str]
"""Settings as a recorder tells them: those that it has words for, by the names of `Settings`."""


@dataclass(frozen=True)
class Settings:
    """Settings of the recorder. Times in ns; level in ADC counts, or in volts where the recorder has it so."""

    interval_ns: int
    points: int
    pretrigger: int
    level: int | float
    source: str = "INT"
    slope: str = "POS"
    delay_ns: int = 0

    def config_hash(self) -> int:
        """CRC-32 that the device computes of the same settings (device protocol, "Identity of a record")."""
        parts = (self.interval_ns, self.points, self.pretrigger, self.source, self.level, self.slope, self.delay_ns)
        return zlib.crc32(",".join(map(str, parts)).encode())

    def differences(self, found: Found) -> list[str]:
        """What a recorder has taken otherwise, in words. Volts may be 2 % off: a converter has steps."""
        differ: list[str] = []
        for key, asked in self.__dict__.items():
            got = found.get(key, asked)
            near = isinstance(asked, float) and isinstance(got, float) and abs(got - asked) <= 0.02 * abs(asked)
            if got != asked and not near:
                differ.append(f"{key}: asked {asked}, got {got}")
        return differ


@dataclass(frozen=True)
class Status:
    """State of the recorder. `held` is the id of the held record or 0, `last` that of the last INIT."""

    condition: Condition
    boot: int
    held: int
    last: int
    config_hash: int


@dataclass(frozen=True)
class Header:
    """Header of the held record; times in ns and µs, CRC-32 a channel over little-endian samples.

    crcs : a channel each, None where the recorder has none; scales : (volts a count, volts at count 0) a channel, where
    the recorder says them
    """

    record_id: int
    boot: int
    config_hash: int
    points: int
    interval_ns: int
    first_sample_ns: int
    trigger_us: int
    bits: int
    crcs: tuple[int | None, ...]
    scales: tuple[tuple[float, float], ...] = ()

    def as_json(self) -> dict[str, Any]:
        tree = {**self.__dict__, "crcs": list(self.crcs), "scales": [list(s) for s in self.scales]}
        if not self.scales:
            del tree["scales"]
        return tree

    @classmethod
    def from_json(cls, tree: dict[str, Any]) -> "Header":
        rest = {k: int(v) for k, v in tree.items() if k not in ("crcs", "scales")}
        scales = tuple((float(a), float(b)) for a, b in tree.get("scales", []))
        return cls(**rest, crcs=tuple(tree["crcs"]), scales=scales)


@dataclass(frozen=True)
class GateReading:
    """Edges in ns against the trigger of record `record_id` (0: of none).

    on_clock : False where only the time between two edges means anything: a counter with a clock of its own. `passages`
    is then how often it has been passed in all.
    """

    record_id: int
    edges_ns: tuple[int, ...]
    on_clock: bool = True
    passages: int = 0


@dataclass(frozen=True)
class Chunk:
    """Samples, the CRC-32 that the recorder states of them, and the id of the record that it holds after that."""

    samples: Counts
    crc: int
    held: int


class Device(Protocol):
    """Recorder, gate and interlock behind one wire.

    Calls that read may be repeated. `arm`, `abort` and `acknowledge` are sent once: after a silence the state is read
    back instead. Every call raises LinkError (NoReply, BadReply) or DeviceError.
    """

    def resynchronise(self) -> None:
        """Drain the wire to silence, open it anew if it is gone, and settle byte or word order by the known word."""
        ...

    def identity(self) -> str: ...
    def status(self) -> Status: ...
    def configure(self, settings: Settings) -> None: ...
    def settings(self) -> Found: ...
    def arm(self) -> None: ...
    def abort(self) -> None: ...
    def header(self) -> Header: ...
    def chunk(self, channel: int, start: int, count: int) -> Chunk:
        """Samples with what proves them: a CRC-32, or a second reading where the recorder has none."""
        ...

    def acknowledge(self, record_id: int, crc: int) -> None: ...
    def gate(self) -> GateReading: ...
    def beam_free(self) -> bool | None:
        """None: the device does not say."""
        ...

    def interlock(self) -> Interlock: ...
    def close(self) -> None: ...


def crc32(samples: Counts) -> int:
    """CRC-32 of samples as little-endian bytes."""
    return zlib.crc32(np.ascontiguousarray(samples, dtype="<i2").data)
