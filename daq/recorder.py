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


class Interlock(IntFlag):
    """Bits of the interlock input."""

    DOOR_CLOSED = 1 << 0
    CLAMPED = 1 << 1
    CATCHER_ON = 1 << 2
    READY = 1 << 3


@dataclass(frozen=True)
class Settings:
    """Settings of the recorder. Times in ns; level in ADC counts."""

    interval_ns: int
    points: int
    pretrigger: int
    level: int
    source: str = "INT"
    slope: str = "POS"
    delay_ns: int = 0

    def config_hash(self) -> int:
        """CRC-32 that the device computes of the same settings (device protocol, "Identity of a record")."""
        parts = (self.interval_ns, self.points, self.pretrigger, self.source, self.level, self.slope, self.delay_ns)
        return zlib.crc32(",".join(map(str, parts)).encode())


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
    """Header of the held record; times in ns and µs, CRC-32 a channel over little-endian samples."""

    record_id: int
    boot: int
    config_hash: int
    points: int
    interval_ns: int
    first_sample_ns: int
    trigger_us: int
    bits: int
    crcs: tuple[int, ...]

    def as_json(self) -> dict[str, Any]:
        return {**self.__dict__, "crcs": list(self.crcs)}

    @classmethod
    def from_json(cls, tree: dict[str, Any]) -> "Header":
        rest = {k: int(v) for k, v in tree.items() if k != "crcs"}
        return cls(**rest, crcs=tuple(tree["crcs"]))


@dataclass(frozen=True)
class GateReading:
    """Edges in ns against the trigger of record `record_id` (0: of none)."""

    record_id: int
    edges_ns: tuple[int, ...]


class Device(Protocol):
    """Recorder, gate and interlock behind one wire.

    Calls that read may be repeated. `arm`, `abort` and `acknowledge` are sent once: after a silence the state is read
    back instead. Every call raises LinkError (NoReply, BadReply) or DeviceError.
    """

    def resynchronise(self) -> None:
        """Drain the wire to silence and settle byte or word order by the device's known word."""
        ...

    def identity(self) -> str: ...
    def status(self) -> Status: ...
    def configure(self, settings: Settings) -> None: ...
    def settings(self) -> Settings: ...
    def arm(self) -> None: ...
    def abort(self) -> None: ...
    def header(self) -> Header: ...
    def read(self, channel: int, start: int, count: int) -> Counts: ...
    def crc(self, channel: int, start: int, count: int) -> int: ...
    def acknowledge(self, record_id: int, crc: int) -> None: ...
    def gate(self) -> GateReading: ...
    def beam_free(self) -> bool: ...
    def interlock(self) -> Interlock: ...
    def close(self) -> None: ...


def crc32(samples: Counts) -> int:
    """CRC-32 of samples as little-endian bytes."""
    return zlib.crc32(np.ascontiguousarray(samples, dtype="<i2").data)
