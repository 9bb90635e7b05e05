"""From a held record to a stored run and a released recorder: read, check, write, re-read, and only then let go."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from daq.errors import AcquisitionError, DeviceError, LinkError, NoReply, StoreError
from daq.journal import Journal
from daq.readout import Readout, Span, again, read_record
from daq.recorder import Device, GateReading, Header, crc32
from daq.rig import Rig
from daq.run import ChannelData, RunData, resolve_g, software
from daq.store import Store
from daq.test_file import TestFile

Emit = Callable[..., None]
"""emit(event, **facts): one event for whoever follows."""
POLL_S = 0.02


@dataclass(frozen=True)
class Drop:
    """What belongs to one drop: its test, the texts of rig and test file, and what was known before the record came.

    first : stretch of the record that is read before the rest
    spare : a second store, for a run that the first one does not take
    passages : what a gate that only counts had counted before; counted : its reading, if it was taken in time
    notes : what was told before arming, and the like, for the run's provenance
    """

    run: str
    series: str | None
    started: str
    test: TestFile
    texts: tuple[str, str]
    first: Span | None = None
    spare: Store | None = None
    passages: int | None = None
    counted: GateReading | None = None
    notes: dict[str, Any] = field(default_factory=dict[str, Any])


def finish(
    rig: Rig, header: Header, drop: Drop, store: Store, journal: Journal, emit: Emit, fewest: int | None = None
) -> str:
    """The run id. `fewest`: what an earlier try has missed; one that misses as much adds nothing and is not stored.

    A record of which something cannot be had becomes a partial run with the map of its gaps; while the recorder still
    holds it, it is not released, and `recover` tries again.
    """
    device, run = rig.recorder, drop.run
    chunks = journal.chunks(header)
    noted = sum(len(samples) for _, samples in chunks.noted())
    emit("reading", run=run, samples=header.points * len(header.crcs), noted=noted)

    def window_read() -> None:
        assert drop.first is not None, "a window was read"
        start, stop = drop.first
        edges = _edges_so_far(rig, header, drop)
        emit("window", run=run, start=start, stop=stop, chunks=str(chunks.path), gate_edges_ns=edges)

    try:
        readout = read_record(device, header, chunks, Pace(run, noted, emit), drop.first, window_read)
    finally:
        chunks.close()
    gate = _read_gate(rig, header, drop, emit) if readout.held else GateReading(header.record_id, ())
    if readout.held and again(device, device.header) != header:
        raise AcquisitionError("stale", "the recorder's record changed while it was read; what was read is noted")
    data = as_run(rig, header, readout, gate, drop)
    if fewest is None or data.missing < fewest:
        save(data, store, emit, drop.spare)
    if readout.gaps:
        emit(
            "partial",
            run=run,
            missing=data.missing,
            gaps=readout.gap_map,
            text=_partial_words(data.missing, readout.held),
        )
    if readout.held and not readout.gaps:
        release(device, header, emit)
    if not (readout.held and readout.gaps):
        journal.remove()
    return run


class Pace:
    """Progress as events: samples, bytes, bytes a second and seconds left, from what was noted on."""

    def __init__(self, run: str, noted: int, emit: Emit) -> None:
        self._run, self._noted, self._emit = run, noted, emit
        self._started = time.monotonic()

    def __call__(self, done: int, total: int) -> None:
        if done <= self._noted and self._noted:
            return  # read by an earlier try
        took = max(time.monotonic() - self._started, 1e-6)
        rate = 2 * (done - self._noted) / took
        left = 2 * (total - done) / rate if rate else None
        self._emit("progress", run=self._run, done=done, total=total, bytes=2 * done, rate_B_s=rate, left_s=left)


def save(data: RunData, store: Store, emit: Emit, spare: Store | None = None) -> None:
    """Publish a run, into the spare store if the first one does not take it.

    Raises
    ------
    AcquisitionError : `unsaved`; the recorder is not released.
    """
    try:
        digest, where = store.publish(data), store
    except StoreError as e:
        if spare is None:
            raise _unsaved(f"{e}", "name a second folder with --spare, or") from None
        emit("spare", run=data.run, text=f"{e}; it goes to the second folder, {spare.folder}")
        try:
            digest, where = spare.publish(data), spare
        except StoreError as second:
            raise _unsaved(f"{e}; {second}", "or") from None
    emit(
        "saved", run=data.run, sha256=digest, samples=data.points, gate_edges=len(data.gate_edges_ns),
        folder=str(where.folder),
    )  # fmt: skip


def _unsaved(why: str, more: str) -> AcquisitionError:
    return AcquisitionError(
        "unsaved",
        f"{why}. The recorder still holds the record: make room, then `droptower recover`; "
        f"{more} give recover another folder with --data and --test",
    )


def _partial_words(missing: int, held: bool) -> str:
    if held:
        return (
            f"{missing} samples could not be read; the recorder still holds the record: `droptower recover` tries again"
        )
    return f"{missing} samples are lost: the recorder no longer holds the record"


def release(device: Device, header: Header, emit: Emit) -> None:
    """Acknowledge a record that is stored. A failure is told, and costs nothing: the record is safe twice."""
    try:
        try:
            device.acknowledge(header.record_id, header.crcs[0] or 0)
        except NoReply:
            device.resynchronise()  # sent once; the state tells whether it arrived
        if again(device, device.status).held == header.record_id:
            raise DeviceError("it still holds the record")
        emit("released", record_id=header.record_id)
    except (LinkError, DeviceError, StoreError) as e:
        emit("not-released", record_id=header.record_id, text=f"the run is saved, the recorder was not released: {e}")


def _read_gate(rig: Rig, header: Header, drop: Drop, emit: Emit) -> GateReading:
    """Edges of this drop; for those of the rebound it waits as long as the rig file says."""
    none = GateReading(header.record_id, ())
    if rig.gate is None or rig.file.gate is None:
        return none
    if drop.counted is not None:
        return drop.counted
    end = time.monotonic() + rig.file.gate.wait_s
    while True:
        try:
            reading = again(rig.gate, rig.gate.gate)
        except (LinkError, DeviceError) as e:
            emit("gate-silent", text=f"the gate gives no reading: {e}")
            return none
        if not reading.on_clock:
            return _counted(reading, drop, emit) or none
        ours = reading.record_id == header.record_id
        if (ours and len(reading.edges_ns) >= 4) or time.monotonic() > end:
            break
        time.sleep(POLL_S)
    if not ours or not reading.edges_ns:
        emit("gate-silent", text="the gate saw nothing of this drop")
        return none
    return reading


def _edges_so_far(rig: Rig, header: Header, drop: Drop) -> list[int]:
    """What the gate has of this drop by now, in step with the record's clock; none if it does not say."""
    if rig.gate is None or drop.passages is not None:
        return []
    try:
        reading = rig.gate.gate()
    except (LinkError, DeviceError):
        return []  # told when it is read for the run
    return list(reading.edges_ns) if reading.record_id == header.record_id else []


def _counted(reading: GateReading, drop: Drop, emit: Emit) -> GateReading | None:
    """The reading of a gate that counts, if the count says that it is of this drop's fall."""
    passed = None if drop.passages is None else reading.passages - drop.passages
    if passed == 1:
        return reading
    why = {None: "what it had counted before is not known", 0: "it has counted nothing"}.get(
        passed, f"it has counted {passed} passages: what it shows is of a later one"
    )
    emit("gate-silent", text=f"the gate's reading does not belong to this drop: {why}")
    return None


def as_run(rig: Rig, header: Header, readout: Readout, gate: GateReading, drop: Drop) -> RunData:
    """A readout as a run.

    Raises
    ------
    DeviceError : the record has other channels than the rig file names.
    """
    file = rig.file
    if len(readout.channels) != len(file.recorder.channel):
        raise DeviceError(
            f"the record has {len(readout.channels)} channels, the rig file names {len(file.recorder.channel)}; "
            f"still held: mend the rig file, then `droptower recover`"
        )
    gaps = [
        tuple((g.start, g.count) for g in readout.gaps if g.channel == n) for n in range(1, len(readout.channels) + 1)
    ]
    scaled = file.recorder.channel
    if header.scales:
        scaled = [c.in_volts(*scale) for c, scale in zip(scaled, header.scales, strict=True)]
    parts = zip(scaled, readout.channels, gaps, strict=True)
    g, g_source = resolve_g(drop.test, file)
    return RunData(
        run=drop.run,
        series=drop.series,
        started=drop.started,
        source="acquired",
        dt=header.interval_ns * 1e-9,
        channels=[ChannelData(c, s, header.bits, g) for c, s, g in parts],
        test=drop.test,
        test_text=drop.texts[1],
        g=g,
        g_source=g_source,
        first_sample_ns=header.first_sample_ns,
        gate_edges_ns=gate.edges_ns,
        gate_on_clock=gate.on_clock,
        rig=file,
        rig_text=drop.texts[0],
        provenance={
            "software": software(),
            "recorder": rig.identity,
            "port": file.recorder.port,
            "profile": file.recorder.profile_name,
            "profile_text": rig.profile_text,
            "proven_by": "CRC-32 of the recorder" if rig.profile.has_crc else "every chunk read twice",
            "header": header.as_json(),
            "missing": sum(g.count for g in readout.gaps),
            "crc32": [crc32(c) for c in readout.channels],
            **drop.notes,
        },
    )
