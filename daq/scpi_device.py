"""Recorder, gate and interlock by SCPI, as a profile has it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from daq.errors import BadReply, DeviceError
from daq.profile import Query, ScpiData, ScpiHeader, ScpiProfile
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
from daq.scpi import Scpi
from daq.template import Value, render
from daq.wire import Wire

_DTYPES = {"i8": "i1", "u8": "u1", "i16": "i2", "u16": "u2"}
_ORDERS = {b"\x01\x02": ">", b"\x02\x01": "<"}


def placed(settings: Settings, words: dict[str, dict[str, str]]) -> dict[str, Value]:
    """Settings as the names that a profile's templates know."""
    s = settings
    interval, window = s.interval_ns * 1e-9, s.interval_ns * 1e-9 * s.points
    return {
        "interval_ns": s.interval_ns, "interval_s": interval, "rate_Hz": 1e9 / s.interval_ns, "points": s.points,
        "pretrigger": s.pretrigger, "pretrigger_s": s.pretrigger * interval, "window_s": window,
        "center_s": s.delay_ns * 1e-9 + window / 2 - s.pretrigger * interval, "level": s.level,
        "delay_ns": s.delay_ns, "delay_s": s.delay_ns * 1e-9,
        "source": words.get("source", {}).get(s.source, s.source),
        "slope": words.get("slope", {}).get(s.slope, s.slope),
    }  # fmt: skip


def read_back(told: dict[str, float | str], words: dict[str, dict[str, str]]) -> Found:
    """Settings by our names and units, of what a recorder tells by its own."""
    found: Found = {}
    for name, value in told.items():
        if name in ("source", "slope"):
            ours = {theirs: own for own, theirs in words.get(name, {}).items()}
            found[name] = ours.get(str(value), str(value))
        elif name == "rate_Hz":
            found["interval_ns"] = round(1e9 / float(value)) if float(value) else 0
        elif name in ("interval_s", "delay_s"):
            found[name.replace("_s", "_ns")] = round(float(value) * 1e9)
        else:
            number = float(value)
            found[name] = int(number) if number.is_integer() else number
    return found


class ScpiDevice:
    """A device on a serial line or a socket; see `daq.recorder.Device`. `channels`: how many the rig file names."""

    def __init__(self, port: str, baud: int, profile: ScpiProfile, channels: int) -> None:
        self._scpi = Scpi(Wire(port, baud, profile.patience_s), profile.errors)
        self._profile, self._channels = profile, channels
        self._order = "<" if profile.data is not None and profile.data.order == "low-first" else ">"

    @property
    def _data(self) -> ScpiData:
        assert self._profile.data is not None, "a rig takes as its recorder only what is one"
        return self._profile.data

    @property
    def _header(self) -> ScpiHeader:
        assert self._profile.header is not None, "as above"
        return self._profile.header

    def resynchronise(self) -> None:
        self._scpi.wire.drain()
        self._scpi.errors()  # of what was garbled on the way: nobody shall take them for a refusal of the next command
        if self._profile.data is None or self._profile.data.sentinel is None:
            return
        word = self._scpi.block(self._profile.data.sentinel, 2)
        if word not in _ORDERS:
            raise BadReply(f"{self._scpi.wire.port}: the known word reads {word.hex()}, not 0102 or 0201")
        self._order = _ORDERS[word]

    def identity(self) -> str:
        return self._scpi.query(self._profile.identity)

    def status(self) -> Status:
        asked = self._profile.status
        assert asked is not None, "a rig takes as its recorder only what is one"
        return self._status_of(self._scpi.query(asked.query))

    def _status_of(self, reply: str) -> Status:
        asked = self._profile.status
        assert asked is not None, "as above"
        if asked.states is not None:
            if reply not in asked.states:
                known = ", ".join(asked.states)
                raise BadReply(f"{self._scpi.wire.port}: {asked.query} gave {reply[:60]!r}; the profile knows {known}")
            return Status(STATES[asked.states[reply]], 0, 0, 0, 0)
        fields = asked.fields or []
        values = dict(zip(fields, self._scpi.whole_numbers(asked.query, reply, len(fields)), strict=True))
        return Status(Condition(values.pop("condition")), **values)

    def configure(self, settings: Settings) -> None:
        values = placed(settings, self._profile.words)
        self._scpi.command(*(render(template, values) for template in self._profile.configure))

    def settings(self) -> Found:
        told: dict[str, float | str] = {}
        for name, asked in self._profile.settings.items():
            told[name] = self._field(asked) if name in ("source", "slope") else self._number(asked)
        return read_back(told, self._profile.words)

    def _field(self, asked: Query) -> str:
        fields = self._scpi.query(asked.query).split(",")
        if len(fields) <= asked.field:
            raise BadReply(f"{self._scpi.wire.port}: {asked.query} has no field {asked.field}: {fields}")
        return fields[asked.field].strip()

    def _number(self, asked: Query) -> float:
        text = self._field(asked)
        try:
            return float(text) * asked.scale
        except ValueError:
            raise BadReply(
                f"{self._scpi.wire.port}: {asked.query} was answered {text[:60]!r}, not with a number"
            ) from None

    def arm(self) -> None:
        self._scpi.command(*self._profile.arm)

    def abort(self) -> None:
        self._scpi.command(*self._profile.abort)

    def header(self) -> Header:
        asked = self._header
        if not (asked.commands or asked.scaled):
            return self._as_header([self._fields(asked.query)])
        told: list[dict[str, float]] = []
        for channel in range(1, self._channels + 1):
            self._scpi.send(*(render(template, {"channel": channel}) for template in asked.commands))
            told.append(self._fields(render(asked.query, {"channel": channel})))
        return self._as_header(told)

    def _fields(self, query: str) -> dict[str, float]:
        names = self._header.fields
        values = self._scpi.some_numbers(query)
        if len(values) < len(names) or (names[-1] != "crcs" and len(values) > len(names)):
            raise BadReply(f"{self._scpi.wire.port}: {query} gave {len(values)} numbers for {len(names)}: {values}")
        told = {name: value for name, value in zip(names, values, strict=False) if name not in ("-", "crcs")}
        if names[-1] == "crcs":
            crcs = values[len(names) - 1 :]
            if told.get("record") and len(crcs) != told.get("channels", len(crcs)):
                raise BadReply(
                    f"{self._scpi.wire.port}: {query} gave {len(crcs)} check sums for {told['channels']:g} channels"
                )
            told |= {f"crc{n}": crc for n, crc in enumerate(crcs)}
        return told

    def _as_header(self, told: list[dict[str, float]]) -> Header:
        first = told[0]
        if len({t["points"] for t in told}) > 1:
            raise BadReply(
                f"{self._scpi.wire.port}: the channels have {[t['points'] for t in told]} points, not as many"
            )
        interval = first.get("interval_ns", first.get("x_increment_s", 0) * 1e9) or self._header.interval_ns or 0
        start = first.get("first_ns", first.get("x_origin_s", 0) * 1e9) or self._header.first_ns or 0
        crcs = [int(first[f"crc{n}"]) for n in range(len(first)) if f"crc{n}" in first]
        middle = {"u8": 1 << 7, "u16": 1 << 15}.get(self._data.type, 0)
        scales = tuple(
            (t["y_increment"], (middle - t.get("y_origin", 0) - t.get("y_reference", 0)) * t["y_increment"])
            for t in told
            if self._header.scaled
        )
        return Header(
            record_id=int(first.get("record", 0)), boot=int(first.get("boot", 0)),
            config_hash=int(first.get("config_hash", 0)), points=int(first["points"]), interval_ns=round(interval),
            first_sample_ns=round(start), trigger_us=int(first.get("trigger_us", 0)),
            bits=int(first.get("bits", self._header.bits or 16)),
            crcs=tuple(crcs) if crcs else (None,) * self._channels, scales=scales,
        )  # fmt: skip

    def _ask_span(self, channel: int, start: int, count: int) -> tuple[list[str], dict[str, Value]]:
        first = start + self._data.base
        values: dict[str, Value] = {
            "channel": channel, "start": start, "count": count, "first": first, "last": first + count - 1
        }  # fmt: skip
        return [*(render(t, values) for t in self._data.commands), render(self._data.query, values)], values

    def chunk(self, channel: int, start: int, count: int) -> Chunk:
        lines, values = self._ask_span(channel, start, count)
        status = self._profile.status
        assert status is not None, "a rig takes as its recorder only what is one"
        if self._profile.crc is None or status.fields is None:
            samples, again = self._span(channel, start, count), self._span(channel, start, count)
            return Chunk(samples, crc32(again), 0)
        # Samples, check sum and state in one write: a round trip instead of three.
        self._scpi.send(*lines, crc := render(self._profile.crc, values), status.query)
        samples = self._samples(lines[-1], count)
        stated = self._scpi.whole_numbers(crc, self._scpi.line(crc), 1)[0]
        return Chunk(samples, stated, self._status_of(self._scpi.line(status.query)).held)

    def _span(self, channel: int, start: int, count: int) -> Counts:
        parts: list[Counts] = []
        for at in range(start, start + count, self._data.most):
            n = min(self._data.most, start + count - at)
            lines, _ = self._ask_span(channel, at, n)
            self._scpi.send(*lines)
            parts.append(self._samples(lines[-1], n))
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def _samples(self, query: str, count: int) -> Counts:
        if self._data.form == "ascii":
            return self._ascii(query, count)
        dtype = np.dtype(_DTYPES[self._data.type]).newbyteorder(self._order)  # pyright: ignore[reportArgumentType]  one of "<>"
        data: NDArray[Any] = np.frombuffer(self._scpi.block_of(query, dtype.itemsize * count), dtype=dtype)
        return _as_counts(data)

    def _ascii(self, query: str, count: int) -> Counts:
        values = self._scpi.ascii_numbers(query)
        if len(values) != count:
            raise BadReply(f"{self._scpi.wire.port}: {query} gave {len(values)} samples for {count}")
        return _as_counts(np.asarray(values))

    def acknowledge(self, record_id: int, crc: int) -> None:
        values: dict[str, Value] = {"record": record_id, "crc": crc}
        self._scpi.command(*(render(template, values) for template in self._profile.acknowledge))

    def gate(self) -> GateReading:
        gate = self._profile.gate
        if gate is None or gate.query is None:
            raise DeviceError(f"{self._scpi.wire.port}: its profile has no [gate] with a query")
        values = self._scpi.numbers(gate.query)
        if len(values) < 2 or len(values) != 2 + values[1]:
            raise BadReply(f"{self._scpi.wire.port}: {gate.query} gives record, number of edges, edges; not {values}")
        return GateReading(values[0], tuple(values[2:]))

    def beam_free(self) -> bool | None:
        gate = self._profile.gate
        return None if gate is None or gate.beam is None else self._scpi.numbers(gate.beam, 1)[0] == 1

    def interlock(self) -> Interlock:
        if self._profile.interlock is None:
            raise DeviceError(f"{self._scpi.wire.port}: its profile has no [interlock]")
        return Interlock(self._scpi.numbers(self._profile.interlock.query, 1)[0])

    def close(self) -> None:
        self._scpi.wire.close()


def _as_counts(data: NDArray[Any]) -> Counts:
    """Samples as int16; of unsigned ones half the range is taken off, so that the middle is 0."""
    if data.dtype.kind == "u":
        return (data.astype(np.int32) - (1 << (8 * data.dtype.itemsize - 1))).astype(np.int16)
    if data.size and (int(data.max()) > 32767 or int(data.min()) < -32768):
        raise BadReply(f"a sample of {int(data.min())} or {int(data.max())} does not fit 16 bits with sign")
    return data.astype(np.int16, copy=False)
