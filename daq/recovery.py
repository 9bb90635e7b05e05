"""Finish what a killed host left: save the record that a recorder still holds, or release one that is saved."""

from typing import Any

from daq.acquisition import settle
from daq.chunks import Chunks
from daq.errors import AcquisitionError, LinkError, StoreError
from daq.finish import Drop, Emit, as_run, finish, release, save
from daq.journal import Journal
from daq.ledger import FINGERPRINT
from daq.quiet import let_go
from daq.readout import again, read_noted
from daq.recorder import Device, GateReading, Header
from daq.rig import Rig, wanted_settings
from daq.run import new_run_id, now
from daq.run_file import read_provenance
from daq.store import Store
from daq.test_file import TestFile
from daq.toml_file import validate

Test = tuple[TestFile, str]


def recover(rig: Rig, rig_text: str, given: Test | None, store: Store, emit: Emit, give_up: bool = False) -> str | None:
    """The run that was saved or found saved, None if there is nothing to recover.

    given : test file of a record that nobody here armed
    give_up : release a record of which a partial run is all that can be had

    Raises
    ------
    AcquisitionError : the held record was armed by nobody this data folder knows, and no test file was given.
    """
    device = rig.recorder
    journal = Journal(store.folder, rig.identity)
    note = journal.read() or {}
    status = let_go(device, wanted_settings(rig.file, rig.profile), settle(device, emit), emit)
    header = again(device, device.header) if status.held else None
    lost = _salvage(rig, rig_text, note, header, journal, store, emit)
    if header is None:
        if lost is None:
            emit("nothing-held", recorder=rig.identity)
        journal.remove()
        return lost
    found = _already_saved(store, rig.identity, header, device)
    if found is None and give_up and None in header.crcs:
        emit("let-go", record_id=header.record_id, text="the record that the recorder shows is not kept, as asked")
        release(device, header, emit)
        journal.remove()
        return lost
    if found is not None and (found[1] == 0 or give_up):
        emit("found-saved", run=found[0], record_id=header.record_id, missing=found[1])
        release(device, header, emit)
        journal.remove()
        return found[0]
    ours = _belongs(note, header)
    test = given or (_noted_test(note, journal) if ours else None)
    if test is None:
        raise AcquisitionError(
            "held",
            f"the recorder holds record {header.record_id}, and {journal.path.parent} has no note of its test; "
            f"give the test file with --test",
        )
    run = note["run"] if ours and note["run"] not in store.runs() else new_run_id()
    series = note.get("series") if ours else None
    emit("held", run=run, record_id=header.record_id)
    fewest = found[1] if found is not None else None
    passages = note.get("passages") if ours else None
    notes = note.get("notes", {}) if ours else {}
    drop = Drop(run, series, now(), test[0], (rig_text, test[1]), passages=passages, notes=notes)
    done = finish(rig, header, drop, store, journal, emit, fewest)
    return done if done in store.runs() or found is None else found[0]


def _salvage(
    rig: Rig, rig_text: str, note: dict[str, Any], held: Header | None, journal: Journal, store: Store, emit: Emit
) -> str | None:
    """A partial run of what was read of a record that the recorder has lost since; None if there is no such record."""
    record = Chunks.record_in(journal.chunks_path)
    if record is None:
        return None
    header = Header.from_json(record)
    if header == held or not _belongs(note, header):
        return None
    found = _already_saved(store, rig.identity, header, None)
    if found is not None:
        return found[0]
    chunks = journal.chunks(header)
    try:
        readout = read_noted(header, chunks)
    except LinkError:
        return None
    finally:
        chunks.close()
    test, text = _noted_test(note, journal)
    gate = GateReading(header.record_id, ())
    drop = Drop(note["run"], note.get("series"), now(), test, (rig_text, text), notes=note.get("notes", {}))
    data = as_run(rig, header, readout, gate, drop)
    save(data, store, emit)
    emit(
        "partial",
        run=data.run,
        missing=data.missing,
        gaps=readout.gap_map,
        text=f"the recorder has lost the record; {data.missing} samples are missing of what was read before",
    )
    return data.run


def _noted_test(note: dict[str, Any], journal: Journal) -> Test:
    return validate(note["test"], TestFile, str(journal.path)), note["test_text"]


def _belongs(note: dict[str, Any], header: Header) -> bool:
    return (note.get("boot"), note.get("record_id")) == (header.boot, header.record_id)


def _already_saved(store: Store, identity: str, header: Header, device: Device | None) -> tuple[str, int] | None:
    """The run of this record that misses least, and how many samples it misses.

    Where the recorder has no CRC its header is no proof: the first samples have to be those of the run as well.
    """
    wanted = header.as_json()
    best: tuple[str, int] | None = None
    for run in reversed(store.runs()):
        try:
            facts = read_provenance(store.raw(run))
        except StoreError:
            continue  # a damaged run is no proof that the record is safe
        if facts.get("recorder") == identity and facts.get("header") == wanted and _begins(store, run, header, device):
            missing = int(facts.get("missing", 0))
            if best is None or missing < best[1]:
                best = run, missing
            if missing == 0:
                break
    return best


def _begins(store: Store, run: str, header: Header, device: Device | None) -> bool:
    if device is None or None not in header.crcs:
        return True
    first = again(device, lambda: device.chunk(1, 0, min(FINGERPRINT, header.points)).samples)
    return bool((store.read(run).channels[0].samples[: len(first)] == first).all())
