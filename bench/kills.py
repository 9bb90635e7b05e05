"""Kill the host, or the emulator, (-9) at each step of a drop, recover, and see that nothing is lost.

    .venv/bin/python bench/kills.py [--of host|emulator] [--kills 1000] [--seed 1] [--at-once N]
        [--progress FILE]

Each drop is a real one. All steps are hit alike, up to 30 ms after the host told them. `recover` then has to leave
exactly one whole run of a record that was captured, the recorder free, and what was reported saved unchanged; a device
that died before its record was complete has captured nothing, and that has to be told. Prints the histogram; exit 1 if
anything was lost. With --progress a study that was broken off goes on where it stopped.
"""

import argparse
import json
import random
import sys
import tempfile
import threading
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))
from emulator import Emulator, until
from rigs import Daq, write_rig, write_test

from daq.recorder import crc32
from daq.store import Store

STEPS = ("connected", "configured", "armed", "triggered", "reading", "progress", "saved", "released")
SAMPLES = 100_000
AT_REST = ("idle", "armed", "held")


class Study:
    """One data folder and one recorder, over many kills."""

    def __init__(self, folder: Path, of: str, seed: int) -> None:
        """``of``: who is killed."""
        self.folder, self.of, self.seed = folder, of, seed
        self.store = Store(folder / "data")
        self.emulator = self._start()

    def _start(self) -> Emulator:
        emulator = Emulator("--seed", str(self.seed), "--state", self.folder / "state")
        emulator.do("catcher", on=True)
        emulator.do("height", v0=1.39)
        return emulator

    def _state(self) -> str:
        return str(self.emulator.do("status")["state"])

    def _rig(self) -> Path:
        return write_rig(self.folder, self.emulator.endpoints["scpi_tcp"], "scpi", samples=SAMPLES, wait_s=3.0)

    def kill(self, step: str, rng: random.Random) -> str | None:
        """A drop with a kill at `step`; what was lost, None if nothing was."""
        before = set(self.store.runs())
        daq = Daq("acquire", self._rig(), self.folder / "data", "--test", str(write_test(self.folder)))
        fell = False
        for event in daq:
            if event["event"] == step:
                time.sleep(rng.uniform(0, 0.03))
                (daq if self.of == "host" else self.emulator).kill()
                break
            if event["event"] == "armed":
                self.emulator.do("release")
                fell = True
        if self.of == "host":
            for _ in daq:  # what it said in its last moments counts as said
                pass
        else:
            daq.end()
        daq.close()
        saved = next((e["run"] for e in daq.events if e["event"] == "saved"), None)
        armed = next((e["record_id"] for e in daq.events if e["event"] == "armed"), None)
        captured = self._captured(fell, armed)
        if self.of == "emulator" and saved is None and daq.events[-1]["event"] != "failed":
            return f"nothing was told: {daq.events[-1]}"
        return self._recover(captured, saved, before)

    def _captured(self, fell: bool, armed: int | None) -> bool:
        """Whether the recorder has completed the record of a drop; the quiet one before arming is none."""
        if self.of == "emulator":
            log = self.emulator.log
            self.emulator.stop()
            self.emulator = self._start()
            return f"record {armed}: held" in log
        until(lambda: self._state() in AT_REST)
        if not fell and self._state() == "armed":
            self.emulator.do("release")  # the recorder needs no host to catch a drop
            fell = True
            until(lambda: self._state() != "armed")
        until(lambda: self._state() in AT_REST)
        return fell

    def _recover(self, captured: bool, saved: str | None, before: set[str]) -> str | None:
        daq = Daq("recover", self._rig(), self.folder / "data")
        end = daq.end()
        daq.close()
        new = set(self.store.runs()) - before
        if end["event"] != "done":
            return f"recover failed: {end['text']}"
        if self._state() != "idle":
            return f"the recorder is left {self._state()}"
        if len(new) != int(captured):
            return f"{len(new)} runs of {int(captured)} records"
        for run in new:
            data = self.store.read(run)
            if data.missing or [crc32(c.samples) for c in data.channels] != data.provenance["header"]["crcs"]:
                return f"run {run} is not what the recorder captured"
        if saved is not None and saved not in new:
            return f"run {saved} was reported saved and is not there"
        until(lambda: not self.emulator.do("status")["moving"])
        return None


class Count:
    """How often each step was hit and what was lost, kept in a file if one is given."""

    def __init__(self, given: argparse.Namespace) -> None:
        """Where the study stands."""
        self.given, self.hit, self.losses = given, Counter[int](), list[str]()
        self._lock = threading.Lock()
        if given.progress is not None and given.progress.exists():
            kept = json.loads(given.progress.read_text())
            if (kept["of"], kept["seed"]) != (given.of, given.seed):
                raise SystemExit(f"{given.progress} is of another study: {kept['of']}, seed {kept['seed']}")
            self.hit.update(kept["done"])
            self.losses = kept["losses"]

    def add(self, n: int, wrong: str | None) -> None:
        """Kill number ``n`` is over."""
        with self._lock:
            self.hit[n] += 1
            if wrong is not None:
                self.losses.append(f"kill {n} at {STEPS[n % len(STEPS)]}: {wrong}")
            if self.given.progress is not None:
                state = {"of": self.given.of, "seed": self.given.seed, "done": sorted(self.hit), "losses": self.losses}
                self.given.progress.write_text(json.dumps(state))
            done = self.hit.total()
            if sys.stderr.isatty() or done % 25 == 0:
                words = f"{done} of {self.given.kills} kills, {len(self.losses)} losses"
                print(words, file=sys.stderr, flush=True)


def run(count: Count, numbers: list[int]) -> int:
    """Kill, recover, count, in a folder of its own; damaged runs."""
    given = count.given
    with tempfile.TemporaryDirectory() as name:
        study = Study(Path(name), given.of, given.seed)
        for n in numbers:
            count.add(n, study.kill(STEPS[n % len(STEPS)], random.Random(given.seed * 1_000_003 + n)))
        damaged = sum(bool(check.faults) for check in study.store.verify())
        study.emulator.stop()
    return damaged


def main() -> int:
    """Kill, recover, count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--of", choices=("host", "emulator"), default="host")
    parser.add_argument("--kills", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--at-once", type=int, default=1, help="so many rigs, each with its own emulator")
    parser.add_argument("--progress", type=Path, metavar="FILE", help="where the study stands")
    given = parser.parse_args()
    count = Count(given)
    left = [n for n in range(given.kills) if n not in count.hit]
    with ThreadPoolExecutor(given.at_once) as pool:
        damaged = sum(pool.map(lambda k: run(count, left[k :: given.at_once]), range(given.at_once)))
    print(f"| {given.of} killed at | times |\n|---|---|")
    for number, step in enumerate(STEPS):
        print(f"| {step} | {sum(n % len(STEPS) == number for n in count.hit)} |")
    print(f"\n{given.kills} kills of the {given.of}, {len(count.losses)} lost, {damaged} damaged runs")
    print("\n".join(count.losses))
    return 1 if count.losses or damaged else 0


if __name__ == "__main__":
    sys.exit(main())
