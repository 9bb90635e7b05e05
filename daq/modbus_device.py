"""Recorder, gate and interlock by Modbus, as a profile has it."""

import struct
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from daq.errors import BadReply, DeviceError, LinkError
from daq.modbus import Modbus
from daq.profile import READ_BACK, ModbusData, ModbusProfile, Register, Write
from daq.recorder import (
    STATES,
    Chunk,
    Condition,
    Counts,
    Found,
    GateReading,
    Header,
    Interlock,
    Settings,
    Status,
    crc32,
)
from daq.scpi_device import placed, read_back
from daq.template import Value

_FORMS = {"u16": "H", "i16": "h", "u32": "I", "i32": "i", "u64": "Q", "i64": "q", "f32": "f"}
MOST = 125
MIDDLE = np.uint16(0x8000)
"""Taken off unsigned samples, so that the middle of their range is 0."""
STATUS = ("condition", "state", "boot", "held", "last", "config_hash")


class ModbusDevice:
    """A device on an RTU line or `tcp://`; see `daq.recorder.Device`. `channels`: of the rig file."""

    def __init__(self, port: str, baud: int, unit_id: int, profile: ModbusProfile, channels: int) -> None:
        self._bus = Modbus(port, baud, unit_id, profile.patience_s)
        self._profile, self._channels = profile, channels
        self._high_first = profile.order != "low-first"
        self._at_once = profile.at_once
        self._page: tuple[int, int] | None = None

    @property
    def _data(self) -> ModbusData:
        assert self._profile.data is not None, "a rig takes as its recorder only what is one"
        return self._profile.data

    def resynchronise(self) -> None:
        self._bus.drain()
        self._page = None
        if self._profile.order == "sentinel":
            self._settle_order(self._profile.registers["sentinel"])
        if "at_once" in self._profile.registers:
            self._at_once = min(max(self._whole("at_once"), 1), 16)

    def _settle_order(self, sentinel: Register) -> None:
        words = self._words([("sentinel", sentinel)])["sentinel"]
        assert sentinel.value is not None, "the profile was checked for it"
        for high_first in (True, False):
            if self._decode(sentinel, words, high_first) == sentinel.value:
                self._high_first = high_first
                return
        found = " ".join(f"{word:04x}" for word in words)
        raise BadReply(f"port {self._bus.port}: the known words read {found}, not {sentinel.value:#x}")

    # -- registers ---------------------------------------------------------------------------------------------------

    def _words(self, wanted: Iterable[tuple[str, Register]]) -> dict[str, list[int]]:
        """Registers of several values; those that touch are read in one request, so that they belong together."""
        found: dict[str, list[int]] = {}
        group: list[tuple[str, Register]] = []
        for name, register in sorted(wanted, key=lambda item: (item[1].function, item[1].at)):
            if group and not self._joins(group, register):
                found |= self._read_group(group)
                group = []
            group.append((name, register))
        return found | (self._read_group(group) if group else {})

    def _joins(self, group: list[tuple[str, Register]], register: Register) -> bool:
        first, last = group[0][1], group[-1][1]
        touches = register.at == last.at + last.size and register.function == first.function
        return touches and register.at + register.size - first.at <= MOST

    def _read_group(self, group: list[tuple[str, Register]]) -> dict[str, list[int]]:
        first, last = group[0][1], group[-1][1]
        words = self._bus.read(first.function, first.at, last.at + last.size - first.at)
        return {name: words[r.at - first.at : r.at - first.at + r.size] for name, r in group}

    def _decode(self, register: Register, words: Sequence[int], high_first: bool | None = None) -> Value:
        values = self._decode_all(register, words, high_first)
        return values[0]

    def _decode_all(self, register: Register, words: Sequence[int], high_first: bool | None = None) -> list[Value]:
        if register.type == "text":
            data = b"".join(word.to_bytes(2, "big") for word in words)
            return [data.rstrip(b"\0 ").decode("ascii", "replace")]
        each = register.size // register.length
        ordered = self._high_first if high_first is None else high_first
        out: list[Value] = []
        for at in range(0, len(words), each):
            parts = words[at : at + each] if ordered else words[at : at + each][::-1]
            value = struct.unpack(f">{_FORMS[register.type]}", struct.pack(f">{each}H", *parts))[0]
            out.append(value if register.scale == 1 else value * register.scale)
        return out

    def _values(self, *names: str) -> dict[str, Value]:
        """Those of the names that the profile has."""
        there = {name: self._profile.registers[name] for name in names if name in self._profile.registers}
        return {name: self._decode(there[name], words) for name, words in self._words(there.items()).items()}

    def _whole(self, name: str) -> int:
        return int(self._values(name)[name])

    def _write(self, writes: Iterable[Write], values: Mapping[str, Value]) -> None:
        for write in writes:
            words: list[int] = []
            for item in write.values:
                name, _, form = item.partition(":")
                words += self._encode(form, int(name) if name.isdigit() else values[name])
            self._bus.write(write.at, words)

    def _encode(self, form: str, value: Value) -> list[int]:
        number = float(value) if form == "f32" else round(float(value)) if isinstance(value, float) else int(value)
        try:
            data = struct.pack(f">{_FORMS[form]}", number)
        except struct.error:
            raise DeviceError(f"port {self._bus.port}: {value} does not fit a register of type {form}") from None
        words = list(struct.unpack(f">{len(data) // 2}H", data))
        return words if self._high_first else words[::-1]

    # -- the device --------------------------------------------------------------------------------------------------

    def identity(self) -> str:
        found = self._values("identity")
        return str(found["identity"]) if found else f"Modbus unit {self._bus.unit} on {self._bus.port}"

    def status(self) -> Status:
        return self._status_of(self._values(*STATUS))

    def _status_of(self, found: dict[str, Value]) -> Status:
        if "state" in found:
            word = str(found["state"])
            if word not in self._profile.states:
                known = ", ".join(self._profile.states)
                raise BadReply(f"port {self._bus.port}: its state reads {word}; the profile knows {known}")
            condition = STATES[self._profile.states[word]]
        else:
            condition = Condition(int(found["condition"]))
        return Status(condition, *(int(found.get(name, 0)) for name in ("boot", "held", "last", "config_hash")))

    def configure(self, settings: Settings) -> None:
        self._write(self._profile.writes.get("configure", []), placed(settings, self._profile.words))

    def settings(self) -> Found:
        told = {name: str(v) if name in ("source", "slope") else v for name, v in self._values(*READ_BACK).items()}
        return read_back(told, self._profile.words)

    def _command(self, what: str, writes: list[Write]) -> None:
        try:
            self._write(writes, {})
        except DeviceError as e:
            raise DeviceError(f"{what} was refused: {e}{self._reason()}") from None

    def _reason(self) -> str:
        """The device's own error code. Read after a refusal, and cleared, so that the next one is not taken for it."""
        if "error" not in self._profile.registers:
            return ""
        try:
            code = self._whole("error")
            self._write(self._profile.writes.get("clear_errors", []), {})
        except (LinkError, DeviceError):
            return ""
        return f" (error {code})" if code else ""

    def arm(self) -> None:
        self._command("arming", self._profile.writes["arm"])

    def abort(self) -> None:
        self._command("disarming", self._profile.writes["abort"])

    def header(self) -> Header:
        names = ("record", "record_boot", "record_hash", "record_points", "record_interval_ns", "record_first_ns",
                 "record_trigger_us", "record_bits", "record_channels", "y_increment", "y_origin")  # fmt: skip
        there = {n: self._profile.registers[n] for n in (*names, "record_crcs") if n in self._profile.registers}
        words = self._words(there.items())
        found = {name: self._decode_all(there[name], words[name]) for name in words}

        def whole(name: str, default: int = 0) -> int:
            return round(float(found[name][0])) if name in found else default

        channels = min(whole("record_channels", self._channels), 4)
        crcs = tuple(int(v) for v in found["record_crcs"][:channels]) if "record_crcs" in found else (None,) * channels
        scale = None
        if "y_increment" in found:
            increment = float(found["y_increment"][0])
            middle = int(MIDDLE) if self._data.type == "u16" else 0
            scale = increment, float(found.get("y_origin", [0])[0]) + middle * increment
        return Header(
            record_id=whole("record"), boot=whole("record_boot"), config_hash=whole("record_hash"),
            points=whole("record_points"), interval_ns=whole("record_interval_ns"),
            first_sample_ns=whole("record_first_ns"), trigger_us=whole("record_trigger_us"),
            bits=whole("record_bits", self._profile.bits), crcs=crcs,
            scales=() if scale is None else (scale,) * channels,
        )  # fmt: skip

    def chunk(self, channel: int, start: int, count: int) -> Chunk:
        samples = self._span(channel, start, count)
        if not self._profile.has_crc:
            return Chunk(samples, crc32(self._span(channel, start, count)), 0)
        self._write(self._profile.writes["span"], {"channel": channel, "start": start, "count": count})
        crc = self._whole("crc")
        return Chunk(samples, crc, self.status().held)

    def _span(self, channel: int, start: int, count: int) -> Counts:
        data = self._data
        out = np.empty(count, dtype=np.uint16)
        done = 0
        while done < count:
            at = start + done
            base = self._turn_page(channel, at)
            n = min(count - done, data.page_samples - (at - base))
            first = data.at + (channel - 1) * data.channel_step + at - base
            if n <= 0 or first + n > 0x10000:
                raise DeviceError(f"port {self._bus.port}: sample {at} lies beyond the window of {data.page_samples}")
            out[done : done + n] = self._bus.bulk(data.function, first, n, self._at_once, data.per_read)
            done += n
        return (out ^ MIDDLE if data.type == "u16" else out).view(np.int16)

    def _turn_page(self, channel: int, at: int) -> int:
        """First sample of a window that holds sample `at`."""
        data = self._data
        if not data.page:
            return 0
        if self._page is None or self._page[0] != channel or not 0 <= at - self._page[1] < data.page_samples:
            self._page = None
            base = at - at % data.page_samples
            count = data.page_samples
            self._write(
                data.page, {"channel": channel, "start": base, "count": count, "first": base, "last": base + count - 1}
            )
            self._page = (channel, base)
        return self._page[1]

    def acknowledge(self, record_id: int, crc: int) -> None:
        values: dict[str, Value] = {"record": record_id, "crc": crc}
        try:
            self._write(self._profile.writes["acknowledge"], values)
        except DeviceError as e:
            raise DeviceError(f"the acknowledgement was refused: {e}{self._reason()}") from None

    def gate(self) -> GateReading:
        registers = self._profile.registers
        if "gate_passages" in registers:
            found = self._values("gate_passages", "gate_blocked_s")
            blocked = round(float(found["gate_blocked_s"]) * 1e9)
            return GateReading(0, (0, blocked), on_clock=False, passages=int(found["gate_passages"]))
        names = ("gate_record", "gate_count", "gate_edges_ns")
        if any(name not in registers for name in names):
            raise DeviceError(f"port {self._bus.port}: its profile has no registers of a gate")
        words = self._words((name, registers[name]) for name in names)
        record, count = (int(self._decode(registers[n], words[n])) for n in names[:2])
        most = registers["gate_edges_ns"].length
        if count > most:
            raise BadReply(f"port {self._bus.port}: the gate announces {count} edges, it holds {most}")
        edges = self._decode_all(registers["gate_edges_ns"], words["gate_edges_ns"])
        return GateReading(record, tuple(int(edge) for edge in edges[:count]))

    def beam_free(self) -> bool | None:
        found = self._values("beam")
        return found["beam"] == 1 if found else None

    def interlock(self) -> Interlock:
        if "interlock" not in self._profile.registers:
            raise DeviceError(f"port {self._bus.port}: its profile has no register interlock")
        return Interlock(self._whole("interlock"))

    def close(self) -> None:
        self._bus.close()
