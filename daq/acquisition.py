"""One drop: configure, read back, arm, confirm, wait, read, check, write, re-read, and only then release the record."""

import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from daq.before import look
from daq.errors import AcquisitionError, DeviceError, LinkError, NoReply
from daq.finish import Drop, Emit, finish
from daq.journal import Journal
from daq.quiet import let_go
from daq.readout import Span, again
from daq.recorder import Condition, Device, GateReading, Header, Interlock, Settings, Status
from daq.rig import Rig, wanted_settings
from daq.run import new_run_id, now
from daq.specimen import refuse_used
from daq.store import Store
from daq.test_file import TestFile

POLL_S = 0.02
SETTLE_S = 10.0
"""Longer than any record takes."""


def acquire(
    rig: Rig,
    test: TestFile,
    texts: tuple[str, str],
    store: Store,
    series: str | None,
    emit: Emit,
    stop: Callable[[], bool],
    first: Span | None = None,
    spare: Store | None = None,
    hit_again: bool = False,
) -> str:
    """Take one drop into the store; its run id. `texts` are those of the rig and the test file.

    first : samples of the record that are read before the rest; spare : where a run goes that the store does not take
    hit_again : a specimen that was hit before is hit again

    Raises
    ------
    AcquisitionError : no trigger, interlock, catcher, aborted, a specimen that was hit before, a record that is held
        or stale, a run that could not be written.
    LinkError, DeviceError, StoreError : as they say; what the recorder holds it still holds.
    """
    device, file = rig.recorder, rig.file
    wanted = wanted_settings(file, rig.profile)
    emit("connected", recorder=rig.identity, port=file.recorder.port)
    _refuse_held(let_go(device, wanted, settle(device, emit), emit))
    if not hit_again:
        refuse_used(store, texts[1])
    store.check_writable(2 * wanted.points * len(file.recorder.channel) + 1_000_000)
    notes = look(rig, test, wanted, store, emit)
    _configure(device, wanted)
    emit("configured", sample_rate_Hz=1e9 / wanted.interval_ns, samples=wanted.points, pretrigger=wanted.pretrigger)
    _await_interlock(rig, stop, emit)
    run = new_run_id()
    journal = Journal(store.folder, rig.identity)
    counter = Counter.of(rig)
    note = {"run": run, "series": series, "rig_text": texts[0], "test_text": texts[1], "passages": counter.before}
    note |= {"notes": notes, "test": test.model_dump(mode="json", by_alias=True, exclude_none=True), "noted_at": now()}
    armed = _arm(device, wanted, journal, note, emit)
    if not _wait(device, armed, wanted, file.recorder.wait_s, stop, counter, emit):
        journal.remove()
        raise AcquisitionError("aborted", "disarmed as asked; no drop was recorded")
    drop = Drop(run, series, now(), test, texts, first, spare, counter.before, counter.reading, notes)
    header = again(device, device.header)
    _check_header(header, armed, wanted, emit)
    return finish(rig, header, drop, store, journal, emit)


@dataclass
class Counter:
    """A gate that only counts passages: read again and again, as what it shows is gone with the next passage."""

    gate: Device | None
    before: int | None = None
    reading: GateReading | None = None

    @classmethod
    def of(cls, rig: Rig) -> "Counter":
        """The rig's gate, if it is one, with what it has counted so far."""
        if rig.gate is None:
            return cls(None)
        try:
            reading = again(rig.gate, rig.gate.gate)
        except (LinkError, DeviceError):
            return cls(None)  # told when its reading is asked for
        return cls(None) if reading.on_clock else cls(rig.gate, reading.passages)

    def look(self) -> None:
        """Keep the first passage after arming."""
        if self.gate is None or self.before is None or self.reading is not None:
            return
        with contextlib.suppress(LinkError, DeviceError):
            reading = self.gate.gate()
            if reading.passages == self.before + 1:
                self.reading = reading


def settle(device: Device, emit: Emit) -> Status:
    """State of a recorder at rest: one that a dead host left armed is disarmed, one that measures may finish.

    Raises
    ------
    DeviceError : it does not come to rest.
    """
    status = again(device, device.status)
    if status.condition & (Condition.WAITING_FOR_ARM | Condition.WAITING_FOR_TRIGGER):
        emit("disarming", record_id=status.last, text="the recorder was left armed")
        device.abort()
    end = time.monotonic() + SETTLE_S
    while (status := again(device, device.status)).condition & ~Condition.HELD:
        if time.monotonic() > end:
            raise DeviceError(f"the recorder does not come to rest ({status.condition!r}); look at it before any reset")
        time.sleep(POLL_S)
    return status


def _refuse_held(status: Status) -> None:
    if status.held:
        raise AcquisitionError(
            "held",
            f"the recorder still holds record {status.held}, never acknowledged; `droptower recover` saves it",
        )


def _configure(device: Device, wanted: Settings) -> None:
    device.configure(wanted)
    if differ := wanted.differences(again(device, device.settings)):
        raise DeviceError(f"the recorder does not take its settings: {'; '.join(differ)}; change them in the rig file")


def _await_interlock(rig: Rig, stop: Callable[[], bool], emit: Emit) -> None:
    if rig.interlock is None or rig.file.interlock is None:
        return
    end = time.monotonic() + rig.file.interlock.wait_s
    told = False
    while Interlock.READY not in (bits := again(rig.interlock, rig.interlock.interlock)):
        why = "the door is open" if Interlock.DOOR_CLOSED not in bits else "the clamp does not hold the dart"
        if time.monotonic() >= end:
            raise AcquisitionError(
                "interlock", f"the interlock does not allow a drop: {why}; mend that, then arm again"
            )
        if stop():
            raise AcquisitionError("aborted", f"stopped as asked, before arming: {why}")
        if not told:
            told = True
            emit("waiting-for-interlock", text=why)
        time.sleep(POLL_S)


def _arm(device: Device, wanted: Settings, journal: Journal, note: dict[str, Any], emit: Emit) -> Status:
    """Arm, and confirm by status that it is armed and its pre-trigger memory full."""
    before = again(device, device.status)
    journal.write({**note, "boot": before.boot, "record_id": before.last + 1, "config_hash": wanted.config_hash()})
    try:
        device.arm()
    except NoReply:
        device.resynchronise()  # sent once; the status tells whether it arrived
    end = time.monotonic() + wanted.pretrigger * wanted.interval_ns * 1e-9 + 2.0
    while True:
        status = again(device, device.status)
        if (status.boot, status.last) != (before.boot, before.last + 1):
            journal.remove()
            raise DeviceError(f"the recorder did not arm: it counts record {status.last} at boot {status.boot}")
        if status.config_hash != wanted.config_hash():
            device.abort()
            journal.remove()
            raise DeviceError("the recorder armed with other settings than were read back; it was disarmed")
        if not status.condition & Condition.WAITING_FOR_ARM:
            break
        if time.monotonic() > end:
            device.abort()
            journal.remove()
            raise DeviceError("the recorder's pre-trigger memory does not fill; it was disarmed")
        time.sleep(POLL_S / 4)
    emit("armed", run=note["run"], record_id=status.last, boot=status.boot, text="drop now")
    return status


def _wait(
    device: Device,
    armed: Status,
    wanted: Settings,
    wait_s: float,
    stop: Callable[[], bool],
    counter: Counter,
    emit: Emit,
) -> bool:
    """Whether a record came: True once it is held, False if it was stopped before the trigger."""
    end = time.monotonic() + wait_s
    measuring = False
    while True:
        status = again(device, device.status)
        counter.look()
        if status.boot != armed.boot:
            raise AcquisitionError("stale", "the recorder was reset while armed: whatever fell was not recorded")
        if status.held == armed.last:
            return True
        if status.condition & Condition.MEASURING and not measuring:
            measuring = True
            emit("triggered", record_id=armed.last)
            end = time.monotonic() + wanted.points * wanted.interval_ns * 1e-9 + 5.0
        stopped = not measuring and stop()
        if stopped or time.monotonic() > end:
            if measuring:
                raise DeviceError(
                    "the recorder was triggered and does not finish its record; look at it before any reset"
                )
            device.abort()  # does nothing to a record whose trigger has come
            if not again(device, device.status).condition:
                if stopped:
                    return False
                raise AcquisitionError("no-trigger", f"no trigger in {wait_s:g} s; disarmed, nothing was recorded")
            end = time.monotonic() + wait_s
        time.sleep(POLL_S)


def _check_header(header: Header, armed: Status, wanted: Settings, emit: Emit) -> None:
    """The held record is the one that was armed, and told where it is not as it was asked for.

    Raises
    ------
    AcquisitionError : `stale`, it is another one; still held.
    """
    expected = (armed.last, armed.boot, wanted.config_hash())
    found = (header.record_id, header.boot, header.config_hash)
    if found != expected:
        raise AcquisitionError(
            "stale", f"the held record is not the one that was armed: {found} for {expected}; still held"
        )
    asked = {
        "points": wanted.points,
        "interval_ns": wanted.interval_ns,
        "first_sample_ns": wanted.delay_ns - wanted.pretrigger * wanted.interval_ns,
    }
    differ = [f"{k}: asked {v}, got {getattr(header, k)}" for k, v in asked.items() if getattr(header, k) != v]
    if differ:
        emit("not-as-configured", record_id=header.record_id, text=f"{'; '.join(differ)}; saved as it is")
