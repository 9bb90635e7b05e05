"""The bench: one acquisition at a time, started by command, followed, disarmed on request, outliving the service."""

import shutil
import tempfile
import threading
from pathlib import Path
from typing import Any

from api.early import start
from api.http.links import ACQUISITION, of_run
from api.process import Acquisition
from daq.errors import RigBusy
from daq.lock import RigLock
from daq.rig_file import load_rig
from daq.specimen import refuse_used
from daq.store import Store
from daq.test_file import TestFile
from daq.toml_file import parse

STATES = {
    "connected": "connected",
    "configured": "configured",
    "waiting-for-interlock": "waiting",
    "armed": "armed",
    "triggered": "triggered",
    "held": "reading",
    "reading": "reading",
    "window": "reading",
    "preliminary": "reading",
    "progress": "reading",
    "saved": "saved",
    "released": "saved",
    "not-released": "saved",
    "found-saved": "saved",
    "done": "saved",
    "failed": "failed",
}
"""The state that an event of the acquisition leaves it in; other events leave it as it is."""
NOTHING: dict[str, Any] = {
    "state": "idle", "done": True, "run": None, "text": None, "outcome": None, "progress": None, "preliminary": None,
    "warnings": [], "events": [],
}  # fmt: skip
STARTING = "starting"
UNNAMED = "unnamed.toml"
"""A test file's stem is the specimen's id, if the file gives none."""


class Bench:
    """One rig, and the drop that was last asked of it."""

    def __init__(self, rig: Path, data: Path) -> None:
        self.rig = rig
        self._file = load_rig(rig)[0]
        self._data = data
        self._lock = threading.Lock()
        self._current: Acquisition | None = None

    @property
    def current(self) -> Acquisition | None:
        """The acquisition that runs, or the last that ran."""
        return self._current

    def start(self, test_text: str, series: str | None, again: bool = False) -> None:
        """Configure and arm, for a test of this text. `again`: its specimen may have been hit before.

        Raises
        ------
        SettingsError : the text is no test file.
        AcquisitionError : the specimen was hit before.
        RigBusy : an acquisition is running, of this service or another.
        """
        parse(test_text, TestFile, "the test file")
        if not again:
            refuse_used(Store(self._data), test_text)
        with self._lock:
            self._refuse_second()
            folder = Path(tempfile.mkdtemp(prefix="droptower-test-"))
            test = folder / UNNAMED
            test.write_text(test_text, encoding="utf-8")
            self._current = start(self.rig, test, self._data, series, again=again)
        threading.Thread(target=_sweep, args=(self._current, folder), daemon=True).start()

    def recover(self) -> None:
        """Save what the recorder still holds of a drop that was cut short.

        Raises
        ------
        RigBusy : an acquisition is running, of this service or another.
        """
        with self._lock:
            self._refuse_second()
            self._current = Acquisition("recover", self.rig, self._data)

    def _refuse_second(self) -> None:
        if self._current is not None and self._current.said_its_last:
            self._current.result()  # its process is about to end
        if self._current is not None and not self._current.done:
            raise RigBusy(f"a drop is {told(self._current.events)['state']} on this rig; disarm it or wait for its end")
        if (holder := self._held_elsewhere()) is not None:
            raise RigBusy(holder)

    def disarm(self) -> None:
        """Ask the acquisition to disarm; a record whose trigger has come is read and saved all the same."""
        if self._current is not None:
            self._current.abort()

    def state(self) -> dict[str, Any]:
        """Where the acquisition is, in a word and in the words of its last event, with the events so far."""
        current = self._current
        if current is not None and not current.done:
            return {**told(list(current.events)), "done": False}
        if (holder := self._held_elsewhere()) is not None:
            return {**NOTHING, "state": "busy", "text": holder}
        return NOTHING if current is None else {**told(list(current.events)), "done": True}

    def _held_elsewhere(self) -> str | None:
        """Who else holds the rig: a command, or the drop of a service that has died."""
        try:
            with RigLock(self._file, "the service looks who holds it"):
                return None
        except RigBusy as busy:
            return str(busy)


def after(state: str, event: dict[str, Any]) -> str:
    """The state that an event leads to."""
    if event["event"] == "failed" and event.get("outcome") == "aborted":
        return "disarmed"
    if event["event"] == "done" and event["run"] is None:
        return "idle"
    return STATES.get(event["event"], state)


def told(events: list[dict[str, Any]]) -> dict[str, Any]:
    """What a row of events amounts to."""
    state, run, text, outcome, progress, early = STARTING, None, None, None, None, None
    for event in events:
        state = after(state, event)
        run = event.get("run") or run
        text, outcome = event.get("text"), event.get("outcome")
        if event["event"] == "progress":
            progress = {key: event.get(key) for key in ("done", "total", "bytes", "rate_B_s", "left_s")}
        if event["event"] == "preliminary":
            early = {key: event[key] for key in ("findings", "warnings")}
    warnings = [{"code": e["code"], "text": e["text"]} for e in events if e["event"] == "warning"]
    links = {**ACQUISITION, "run": of_run(run)["self"] if run is not None and state == "saved" else None}
    facts: dict[str, Any] = {"state": state, "run": run, "text": text, "outcome": outcome, "progress": progress}
    facts |= {"preliminary": early, "warnings": warnings}
    return {**facts, "events": events, "links": links}


def _sweep(acquisition: Acquisition, folder: Path) -> None:
    acquisition.result()
    shutil.rmtree(folder, ignore_errors=True)
