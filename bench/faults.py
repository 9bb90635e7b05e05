"""Every fault the emulator plays, on every wire: what acquisition makes of it.

    .venv/bin/python bench/faults.py [--draw N] [--seed 1] [--only NAME] [--write docs/faults.md]

Each row is a real drop with the fault in force at one step of it. What was captured is the emulator's own word: id and
CRC-32 of the record when it was complete. A row is good if the record was stored bit for bit, is still held by the
recorder, or is kept as a partial run with the map of its gaps; where nothing was captured, the host has to say so by a
named outcome, and the next drop has to be exact. The time is what it took from the release to the end, `recover`
included, less that of a drop without a fault. Exit 1 if a row is none of these.
"""

import argparse
import random
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))
from emulator import Emulator, until
from rigs import WIRES, Daq, write_rig, write_test

from daq.recorder import crc32
from daq.store import Store
from sim_device.fault_kinds import KINDS

SAMPLES = 20_000
LANGUAGES = {"scpi_pty": "scpi", "scpi_tcp": "scpi", "modbus_rtu": "rtu", "modbus_tcp": "tcp"}
CODES = (1, 2, 3, 4, 5, 6, 8, 10, 11)
AT_READ = ("busy", "exception", "swapped_bytes", "swapped_channels", "bad_crc32", "overwritten")
LAST_WRITE = {"modbus_rtu": 7, "modbus_tcp": 6}
"""Writes between the trigger and the one that lets the record go."""
LINGER = ("vanish", "second_client")
"""Faults that keep the link for a while after they were cleared."""
CHANNELS = 2
"""So that there are channels to swap."""


@dataclass(frozen=True)
class Case:
    """A fault at a step of a drop: before arming, while armed, while the record is read, while it is let go."""

    fault: str
    wire: str
    step: str
    keys: dict[str, Any] = field(default_factory=dict[str, Any])

    @property
    def name(self) -> str:
        """The fault, with its exception code."""
        return f"{self.fault} {self.keys['code']:02d}" if "code" in self.keys else self.fault


def cases() -> list[Case]:
    """All rows."""
    found: list[Case] = []
    for name, kind in KINDS.items():
        for wire in (w for w in WIRES if LANGUAGES[w] in kind.languages):
            if name == "exception":
                found += [Case(name, wire, "read", {"code": code}) for code in CODES]
            elif name == "clamped_settings":
                found.append(Case(name, wire, "settings", {"nth": 2}))  # the first are those of the quiet record
            elif kind.where == "event":
                found.append(Case(name, wire, "whole"))
            elif name == "device_reset":
                found += [Case(name, wire, step) for step in ("armed", "read", "release")]
            elif name in AT_READ:
                found.append(Case(name, wire, "read"))
            elif kind.where == "in":
                found += [Case(name, wire, step) for step in ("arm", "read")]
            else:
                found += [Case(name, wire, step) for step in ("arm", "read", "release")]
                if name in ("flip_byte", "truncated", "disconnect"):
                    found.append(Case(name, wire, "read, for ever", {"count": None}))
    return found


def settings(case: Case, rng: random.Random) -> dict[str, Any]:
    """The keys of the fault: where in the step it strikes is drawn."""
    scpi = LANGUAGES[case.wire] == "scpi"
    kind, keys = KINDS[case.fault], {**case.keys, "seed": rng.randrange(1 << 30)}
    if kind.where == "in":
        return {**keys, "nth": rng.randint(1, 40)}
    if kind.where == "event":
        return keys
    if case.step.startswith("read"):
        keys["command"] = "TRAC:CRC?" if scpi and case.fault == "bad_crc32" else "TRAC:DATA?" if scpi else "FC04"
        if case.fault != "bad_crc32":
            # Over Modbus 10,000 samples, the first chunk, are eighty requests; a status is asked for now and then.
            keys["skip"] = rng.randint(1, 2) if scpi else rng.randint(100, 250)
    elif case.step == "release":
        keys["command"] = "SYST:ERR?" if scpi else "FC16"
        keys["skip"] = 0 if scpi else LAST_WRITE[case.wire] - rng.randint(0, 1)
    return keys


@dataclass
class Row:
    """What became of a case."""

    case: Case
    outcome: str
    told: str
    acted: int
    seconds: float


class Bench:
    """One emulator, one data folder, a drop at a time."""

    def __init__(self, emulator: Emulator, folder: Path) -> None:
        """With two channels and the catcher on."""
        self.emulator, self.folder, self.clean = emulator, folder, dict[str, float]()
        emulator.do("recorder", channels=CHANNELS)
        emulator.do("catcher", on=True)
        emulator.do("height", v0=1.39)
        for wire in WIRES:
            self.clean[wire] = min(self._drop(wire, "", {})[1] for _ in range(2))

    def _rig(self, wire: str) -> Path:
        rig = write_rig(self.folder, self.emulator.endpoints[wire], wire.partition("_")[0], SAMPLES, wait_s=3.0)
        second = '[[recorder.channel]]\nname = "second tup"\ncounts_to_unit = 0.390625\nrange = 3200\n\n[gate]'
        rig.write_text(rig.read_text().replace("[gate]", second))
        return rig

    def _drop(self, wire: str, step: str, fault: dict[str, Any]) -> tuple[Daq, float]:
        """One drop by `acquire`, the fault set at its step; seconds from the release to the end."""
        daq = Daq("acquire", self._rig(wire), self.folder / "data", "--test", str(write_test(self.folder)))
        at = {"arm": "configured", "armed": "armed", "whole": "configured", "settings": "connected"}.get(
            step, "triggered"
        )
        begun = time.monotonic()
        for event in daq:
            if fault and event["event"] == at:
                self.emulator.do("fault", **fault)
            if event["event"] == "armed":
                begun = time.monotonic()
                if not (fault and fault["name"] == "spurious_trigger"):
                    self.emulator.do("release")
        seconds = time.monotonic() - begun
        daq.close()
        return daq, seconds

    def _recover(self, wire: str) -> Daq:
        daq = Daq("recover", self._rig(wire), self.folder / "data")
        daq.end()
        daq.close()
        return daq

    def play(self, case: Case, fault: dict[str, Any]) -> Row:
        """A drop with the fault, what it takes to mend it, and what there is then."""
        store, emulator = Store(self.folder / "data"), self.emulator
        self._let_go(case.wire)  # what the row before has left
        runs, before = set(store.runs()), emulator.do("status")["captured"]
        daq, seconds = self._drop(case.wire, case.step, {"name": case.fault, **fault})
        status = emulator.do("status")
        acted = sum(f["acted"] for f in status["faults"])
        emulator.do("clear")
        armed = next((e["record_id"] for e in daq.events if e["event"] == "armed"), None)
        captured = status["captured"]
        if captured == before or (captured and captured["id"] != (armed or status["held"])):
            captured = None  # that of the drop before, or the quiet record of this one
        end = daq.events[-1]
        told = end.get("outcome", "")
        begun = time.monotonic()
        until(lambda: emulator.do("status")["state"] in ("idle", "held", "armed"), 15)
        if told or emulator.do("status")["held"]:
            mended = self._recover(case.wire).events[-1]
            told = f"{told or 'not released'}, recover: {mended.get('outcome') or 'done'}"
        seconds += time.monotonic() - begun - self.clean[case.wire]
        if case.fault in LINGER:
            time.sleep(1.0)  # of the link, not of the drop: the next row shall find it free
        outcome = self._outcome(store, set(store.runs()) - runs, captured, case.wire, bool(told))
        return Row(case, outcome, told, acted, max(0.0, seconds))

    def _outcome(self, store: Store, new: set[str], captured: dict[str, Any] | None, wire: str, told: bool) -> str:
        held = self.emulator.do("status")["held"]
        kept = [store.read(run) for run in new]
        if captured and any([crc32(c.samples) for c in data.channels] == captured["crcs"] for data in kept):
            return "exact"
        for data in kept:
            if data.missing and data.missing == sum(count for c in data.channels for _, count in c.gaps):
                return f"partial, {data.missing} missing"
        if captured and held == captured["id"]:
            self._let_go(wire)
            return "held"
        if captured or not told:
            return "LOST"
        self._let_go(wire)
        until(lambda: not self.emulator.do("status")["moving"], 15)
        daq, _ = self._drop(wire, "", {})
        last = self.emulator.do("status")["captured"]
        data = store.read(daq.events[-1]["run"]) if daq.events[-1]["event"] == "done" else None
        exact = data is not None and [crc32(c.samples) for c in data.channels] == last["crcs"]
        return "nothing captured; the next drop exact" if exact else "LOST"

    def _let_go(self, wire: str) -> None:
        """By hand, what is left on the recorder, as `recover --give-up` and `--test` would."""
        if self.emulator.do("status")["held"]:
            test = str(write_test(self.folder))
            daq = Daq("recover", self._rig(wire), self.folder / "data", "--test", test)
            daq.end()
            daq.close()


def table(rows: list[Row], clean: dict[str, float]) -> str:
    """The matrix as a page."""
    lines = ["| fault | wire | step | outcome | what was told | extra time, s |", "|---|---|---|---|---|---|"]
    for row in rows:
        c = row.case
        lines.append(f"| {c.name} | {c.wire} | {c.step} | {row.outcome} | {row.told} | {row.seconds:.1f} |")
    good = [row for row in rows if row.outcome != "LOST"]
    times = ", ".join(f"{wire} {seconds:.2f} s" for wire, seconds in clean.items())
    return "\n".join(
        [
            *lines,
            "",
            f"{len(rows)} rows, {len(rows) - len(good)} lost. A drop without a fault, from release to end: {times}.",
        ]
    )


def main() -> int:
    """Play all, or a draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draw", type=int, help="so many rows, drawn by the seed")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", help="one fault")
    parser.add_argument("--write", type=Path, help="put the table into this page, after its last heading")
    given = parser.parse_args()
    rng = random.Random(given.seed)
    chosen = [case for case in cases() if given.only in (None, case.fault)]
    if given.draw:
        chosen = rng.sample(chosen, min(given.draw, len(chosen)))
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as name, Emulator("--seed", str(given.seed)) as emulator:
        bench = Bench(emulator, Path(name))
        for case in chosen:
            until(lambda: not emulator.do("status")["moving"], 15)
            rows.append(bench.play(case, settings(case, rng)))
            idle = "" if rows[-1].acted else "  (did not act)"
            print(
                f"{len(rows)}/{len(chosen)} {case.name} {case.wire} {case.step}: {rows[-1].outcome}{idle}",
                file=sys.stderr,
            )
        damaged = [check for check in Store(Path(name) / "data").verify() if check.faults]
        text = table(rows, bench.clean)
    print(text)
    if given.write:
        page = given.write.read_text(encoding="utf-8")
        head = page[: page.rindex("\n## ")]
        given.write.write_text(f"{head}\n## The matrix\n\n{text}\n", encoding="utf-8")
    lost = [row for row in rows if row.outcome == "LOST"]
    idle = [row for row in rows if not row.acted]
    if idle:
        print(
            f"{len(idle)} faults did not act: {', '.join(f'{r.case.name} {r.case.wire} {r.case.step}' for r in idle)}"
        )
    return 1 if lost or damaged else 0


if __name__ == "__main__":
    sys.exit(main())
