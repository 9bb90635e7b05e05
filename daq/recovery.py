"""Finish what a killed host left: save the record that a recorder still holds, or release one that is saved."""

from typing import Any

from daq.acquisition import Emit, finish, release, settle
from daq.errors import AcquisitionError, StoreError
from daq.journal import Journal
from daq.readout import again
from daq.recorder import Header
from daq.rig import Rig
from daq.run import new_run_id, now
from daq.run_file import read_provenance
from daq.store import Store
from daq.test_file import TestFile
from daq.toml_file import validate


def recover(rig: Rig, rig_text: str, test: tuple[TestFile, str] | None, store: Store, emit: Emit) -> str | None:
    """The run that was saved or found saved, None if the recorder holds nothing. `test`: for a record of no known test.

    Raises
    ------
    AcquisitionError : the held record was armed by nobody this data folder knows, and no test file was given.
    """
    device = rig.recorder
    status = settle(device, emit)
    journal = Journal(store.folder, rig.file.recorder.port)
    if not status.held:
        journal.remove()
        emit("nothing-held", recorder=rig.identity)
        return None
    header = again(device, device.header)
    if (run := _already_saved(store, rig.identity, header)) is not None:
        emit("found-saved", run=run, record_id=header.record_id)
        release(device, header, emit)
        journal.remove()
        return run
    note = journal.read()
    if note is not None and not _belongs(note, rig.identity, header):
        note = None
    if test is not None:
        chosen, text = test
    elif note is not None:
        chosen, text = validate(note["test"], TestFile, str(journal.path)), note["test_text"]
    else:
        raise AcquisitionError(
            "held",
            f"the recorder holds record {header.record_id}, and {journal.path.parent} has no note of its test; "
            f"give the test file with --test",
        )
    known: dict[str, Any] = note or {}
    run = known.get("run") or new_run_id()
    emit("held", run=run, record_id=header.record_id)
    return finish(rig, header, chosen, (rig_text, text), run, known.get("series"), now(), store, journal, emit)


def _belongs(note: dict[str, Any], identity: str, header: Header) -> bool:
    return (note["identity"], note["boot"], note["record_id"]) == (identity, header.boot, header.record_id)


def _already_saved(store: Store, identity: str, header: Header) -> str | None:
    wanted = header.as_json()
    for run in reversed(store.runs()):
        try:
            facts = read_provenance(store.raw(run))
        except StoreError:
            continue  # a damaged run is no proof that the record is safe
        if facts.get("recorder") == identity and facts.get("header") == wanted:
            return run
    return None
