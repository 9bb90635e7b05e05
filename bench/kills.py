"""Kill the host (-9) at each step of an acquisition, recover, and see that nothing is lost.

    .venv/bin/python bench/kills.py [--kills 1000] [--seed 1]

Each drop is a real one on the emulator. All steps are hit alike, up to 30 ms after they were told; `recover` then has
to leave exactly one whole run of the record, the recorder released, and what was reported saved unchanged. Prints the
histogram; exit 1 if anything was lost.
"""

import argparse
import random
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))
from emulator import Emulator, until
from rigs import Daq, write_rig, write_test

from daq.recorder import crc32
from daq.store import Store

STEPS = ("connected", "configured", "armed", "triggered", "reading", "progress", "saved", "released")
SAMPLES = 100_000


def state(emulator: Emulator) -> str:
    """The recorder's state in words."""
    return str(emulator.do("status")["state"])


def kill_at(step: str, emulator: Emulator, folder: Path, rng: random.Random) -> tuple[bool, str | None]:
    """Acquire and kill the host at `step`; whether a dart fell on an armed recorder, and what was reported saved."""
    rig = write_rig(folder, emulator.endpoints["scpi_tcp"], "scpi", samples=SAMPLES)
    daq = Daq("acquire", rig, folder / "data", "--test", str(write_test(folder)))
    fell, saved = False, None
    for event in daq:
        if event["event"] == "saved":
            saved = event["run"]
        if event["event"] == step:
            time.sleep(rng.uniform(0, 0.03))
            daq.kill()
            break
        if event["event"] == "armed":
            emulator.do("release")
            fell = True
    # What it said in its last moments counts as said.
    saved = next((e["run"] for e in daq if e["event"] == "saved"), saved)
    daq.close()
    if not fell and "armed" in state(emulator):
        emulator.do("release")  # the recorder needs no host to catch a drop
        fell = True
    until(lambda: not any(word in state(emulator) for word in ("filling", "measuring")), 10)
    return fell, saved


def lost(fell: bool, saved: str | None, emulator: Emulator, folder: Path, before: set[str]) -> str | None:
    """Recover, and say what is wrong; None if nothing is."""
    rig = folder / "rig.toml"
    daq = Daq("recover", rig, folder / "data")
    end = daq.end()
    daq.close()
    store = Store(folder / "data")
    new = set(store.runs()) - before
    if end["event"] != "done":
        return f"recover failed: {end['text']}"
    if "idle" not in state(emulator):
        return f"the recorder is left {state(emulator)}"
    if len(new) != int(fell):
        return f"{len(new)} runs of {int(fell)} drops"
    for run in new:
        data = store.read(run)
        if data.missing or [crc32(c.samples) for c in data.channels] != data.provenance["header"]["crcs"]:
            return f"run {run} is not what the recorder captured"
    if saved is not None and saved not in new:
        return f"run {saved} was reported saved and is not there"
    return None


def main() -> int:
    """Kill, recover, count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    rng = random.Random(given.seed)
    hit: Counter[str] = Counter()
    losses: list[str] = []
    with tempfile.TemporaryDirectory() as name, Emulator("--seed", str(given.seed)) as emulator:
        folder = Path(name)
        emulator.do("catcher", on=True)
        emulator.do("height", v0=1.39)
        for n in range(given.kills):
            step = STEPS[n % len(STEPS)]
            until(lambda: not emulator.do("status")["moving"], 10)
            before = set(Store(folder / "data").runs())
            fell, saved = kill_at(step, emulator, folder, rng)
            hit[step] += 1
            if (wrong := lost(fell, saved, emulator, folder, before)) is not None:
                losses.append(f"kill {n} at {step}: {wrong}")
            if sys.stderr.isatty() or n % 25 == 24:
                print(f"{n + 1} of {given.kills} kills, {len(losses)} losses", file=sys.stderr, flush=True)
        faults = [c for c in Store(folder / "data").verify() if c.faults]
    print("| killed at | times |\n|---|---|")
    for step in STEPS:
        print(f"| {step} | {hit[step]} |")
    print(f"\n{given.kills} kills, {len(losses)} lost, {len(faults)} damaged runs")
    print("\n".join(losses))
    return 1 if losses or faults else 0


if __name__ == "__main__":
    sys.exit(main())
