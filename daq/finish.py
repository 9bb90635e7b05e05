"""From a held record to a stored run and a released recorder: read, check, write, re-read, and only then let go."""

import time
from collections.abc import Callable

from daq.errors import AcquisitionError, DeviceError, LinkError, NoReply, StoreError
from daq.journal import Journal
from daq.readout import Readout, again, read_record
from daq.recorder import Device, GateReading, Header, crc32
from daq.rig import Rig
from daq.rig_file import RigFile
from daq.run import ChannelData, RunData, resolve_g, software
from daq.store import Store
from daq.test_file import TestFile

Emit = Callable[..., None]
"""emit(event, **facts): one event for whoever follows."""
POLL_S = 0.02


def finish(
    rig: Rig,
    header: Header,
    test: TestFile,
    texts: tuple[str, str],
    run: str,
    series: str | None,
    started: str,
    store: Store,
    journal: Journal,
    emit: Emit,
    fewest: int | None = None,
) -> str:
    """The run id. `fewest`: what an earlier try has missed; one that misses as much adds nothing and is not stored.

    A record of which something cannot be had becomes a partial run with the map of its gaps; while the recorder still
    holds it, it is not released, and `recover` tries again.
    """
    device = rig.recorder
    chunks = journal.chunks(header)
    noted = sum(len(samples) for _, samples in chunks.noted())
    emit("reading", run=run, samples=header.points * len(header.crcs), noted=noted)
    try:
        readout = read_record(device, header, chunks, lambda d, n: emit("progress", run=run, done=d, total=n))
    finally:
        chunks.close()
    gate = _read_gate(rig, header, emit) if readout.held else GateReading(header.record_id, ())
    if readout.held and again(device, device.header) != header:
        raise AcquisitionError("stale", "the recorder's record changed while it was read; what was read is noted")
    data = as_run(rig.file, rig.identity, header, readout, gate, test, texts, run, series, started)
    if fewest is None or data.missing < fewest:
        save(data, store, emit)
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


def save(data: RunData, store: Store, emit: Emit) -> None:
    """Publish a run.

    Raises
    ------
    AcquisitionError : `unsaved`; the recorder is not released.
    """
    try:
        digest = store.publish(data)
    except StoreError as e:
        raise AcquisitionError(
            "unsaved",
            f"{e}. The recorder still holds the record: make room, then `droptower recover`; "
            f"for another data folder give it --data and --test",
        ) from None
    emit("saved", run=data.run, sha256=digest, samples=data.points, gate_edges=len(data.gate_edges_ns))


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
            device.acknowledge(header.record_id, header.crcs[0])
        except NoReply:
            device.resynchronise()  # sent once; the state tells whether it arrived
        if again(device, device.status).held == header.record_id:
            raise DeviceError("it still holds the record")
        emit("released", record_id=header.record_id)
    except (LinkError, DeviceError) as e:
        emit("not-released", record_id=header.record_id, text=f"the run is saved, the recorder was not released: {e}")


def _read_gate(rig: Rig, header: Header, emit: Emit) -> GateReading:
    """Edges of this drop; for those of the rebound it waits as long as the rig file says."""
    none = GateReading(header.record_id, ())
    if rig.gate is None or rig.file.gate is None:
        return none
    end = time.monotonic() + rig.file.gate.wait_s
    while True:
        try:
            reading = again(rig.gate, rig.gate.gate)
        except LinkError as e:
            emit("gate-silent", text=f"the gate gives no reading: {e}")
            return none
        ours = reading.record_id == header.record_id
        if (ours and len(reading.edges_ns) >= 4) or time.monotonic() > end:
            break
        time.sleep(POLL_S)
    if not ours or not reading.edges_ns:
        emit("gate-silent", text="the gate saw nothing of this drop")
        return none
    return reading


def as_run(
    file: RigFile,
    identity: str,
    header: Header,
    readout: Readout,
    gate: GateReading,
    test: TestFile,
    texts: tuple[str, str],
    run: str,
    series: str | None,
    started: str,
) -> RunData:
    if len(readout.channels) != len(file.recorder.channel):
        raise DeviceError(
            f"the record has {len(readout.channels)} channels, the rig file names {len(file.recorder.channel)}; "
            f"still held: mend the rig file, then `droptower recover`"
        )
    gaps = [
        tuple((g.start, g.count) for g in readout.gaps if g.channel == n) for n in range(1, len(readout.channels) + 1)
    ]
    parts = zip(file.recorder.channel, readout.channels, gaps, strict=True)
    g, g_source = resolve_g(test, file)
    return RunData(
        run=run,
        series=series,
        started=started,
        source="acquired",
        dt=header.interval_ns * 1e-9,
        channels=[ChannelData(c, s, header.bits, g) for c, s, g in parts],
        test=test,
        test_text=texts[1],
        g=g,
        g_source=g_source,
        first_sample_ns=header.first_sample_ns,
        gate_edges_ns=gate.edges_ns,
        rig=file,
        rig_text=texts[0],
        provenance={
            "software": software(),
            "recorder": identity,
            "port": file.recorder.port,
            "header": header.as_json(),
            "missing": sum(g.count for g in readout.gaps),
            "crc32": [crc32(c) for c in readout.channels],
        },
    )
