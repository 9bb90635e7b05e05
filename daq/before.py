"""What is looked at before arming, and told while the specimen is still whole."""

from datetime import date
from typing import Any

from daq.errors import AcquisitionError, DeviceError, LinkError
from daq.finish import Emit
from daq.history import History
from daq.quiet import before_a_drop, quiet_of, take
from daq.readout import again
from daq.recorder import Interlock, Settings
from daq.rig import Rig
from daq.rig_file import Channel
from daq.store import Store
from daq.test_file import TestFile

SOON_DAYS = 30
"""A calibration that is due within so many days is told."""


class Told:
    """Warnings before arming: each goes out as an event and into the run."""

    def __init__(self, emit: Emit) -> None:
        self._emit = emit
        self.warnings: list[dict[str, str]] = []

    def __call__(self, code: str, text: str) -> None:
        self.warnings.append({"code": code, "text": text})
        self._emit("warning", code=code, text=text)


def look(rig: Rig, test: TestFile, wanted: Settings, store: Store, emit: Emit) -> dict[str, Any]:
    """Look at catcher, calibration, gate, zero level and noise; what was told and seen, for the run's provenance.

    Raises
    ------
    AcquisitionError : `catcher`: it is on, and the test asks for the rebound.
    """
    told = Told(emit)
    notes: dict[str, Any] = {"told": told.warnings}
    if rig.interlock is not None:
        notes["catcher"] = _catcher(rig, test, told)
    for channel in rig.file.recorder.channel:
        _calibration(channel, told)
    _gate(rig, told)
    if rig.profile.keeps_records:
        notes["quiet"] = _quiet(rig, wanted, store, told)
    return notes


def _catcher(rig: Rig, test: TestFile, told: Told) -> bool:
    assert rig.interlock is not None, "who asks has one"
    on = Interlock.CATCHER_ON in again(rig.interlock, rig.interlock.interlock)
    asked = "catcher" in test.drop.model_fields_set
    if on and asked and not test.drop.catcher:
        raise AcquisitionError(
            "catcher",
            "the catcher is on, and the test file asks for the rebound's flight (catcher = false): no ε by flight time "
            "could be had; take the catcher off, or say catcher = true",
        )
    if on and not test.drop.catcher and not rig.file.tower.catcher:
        told("catcher-on", "the catcher is on: there will be no second contact, and no ε by flight time")
    if not on and test.drop.catcher:
        told("catcher-off", "the test file says that the catcher is on, it is off: the specimen may be hit twice")
    return on


def _calibration(channel: Channel, told: Told) -> None:
    if channel.calibration_due is None:
        return
    days = (date.fromisoformat(channel.calibration_due) - date.today()).days
    if days < 0:
        told("calibration-expired", f"channel {channel.name}: its calibration was due on {channel.calibration_due}")
    elif days <= SOON_DAYS:
        told("calibration-due", f"channel {channel.name}: its calibration is due in {days} days")


def _gate(rig: Rig, told: Told) -> None:
    if rig.gate is None:
        return
    try:
        if again(rig.gate, rig.gate.beam_free) is False:
            told("gate-blocked", "the gate's beam is broken: no speed will be read; clear it, or align the gate")
    except (LinkError, DeviceError) as e:
        told("gate-silent", f"the gate does not answer: {e}")


def _quiet(rig: Rig, wanted: Settings, store: Store, told: Told) -> list[list[float]] | None:
    """Zero level and noise of each channel, in counts, looked at and remembered."""
    try:
        header, samples, _ = take(rig.recorder, before_a_drop(wanted))
    except DeviceError as e:
        told("no-quiet-record", f"zero level and noise were not looked at: {e}")
        return None
    history = History.of(store.folder, rig.identity)
    if history.lost is not None:
        told("history-lost", history.lost)
    seen = [quiet_of(counts) for counts in samples]
    for channel, now in zip(rig.file.recorder.channel, seen, strict=False):
        for code, text in history.unusual(channel.name, now, 2.0 ** (header.bits - 1)):
            told(code, text)
        history.add(channel.name, now)
    if (why := history.save()) is not None:
        told("history-not-kept", why)
    return [[now.zero, now.noise] for now in seen]
