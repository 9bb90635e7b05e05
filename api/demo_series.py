"""The end of the demo: a series whose specimens fail from some speed on, what it says, and its report."""

from pathlib import Path
from typing import Any

from rich.console import Console

from api.commands.live import follow
from api.demo_rig import RIG_FILE, TEST_FILE, Control, drop
from api.early import start
from api.process import Emulator, ProcessError
from api.report import write_report
from api.series import drops_of, series_of
from daq.store import Store

SERIES = "demo CR-39 to failure"
SPEEDS = (2.6, 3.0, 3.2, 3.4, 3.6, 3.8, 4.0, 4.4)
"""m/s, around P1's failure at 3.6."""
PLATE = {"E_GPa": 3.42, "C_i": 5000, "C_d": 15, "fail_N": 1800, "scatter_load": 0.04, "scatter_E": 0.01}
"""P1 Table 2 has 1,800 N; specimens scatter."""
SAMPLES = 10_000


def run_series(data: Path) -> Path:
    """Eight drops into `data`, each of a new specimen, and their report; the report's path.

    Raises
    ------
    ProcessError, DaqError : a drop did not become a run.
    """
    console = Console(stderr=True)
    store = Store(data)
    truths: list[dict[str, Any]] = []
    with Emulator("--seed", "1800") as rig, Control(rig.endpoints["control"]) as hand:
        rig_file = data / "demo-rig-series.toml"
        text = RIG_FILE.format(driver="modbus", port=rig.endpoints["modbus_tcp"])
        rig_file.write_text(text.replace("samples = 250_000 ", f"samples = {SAMPLES} "))
        hand.ask(do="specimen", **PLATE)
        hand.ask(do="catcher", on=True)
        for v0 in SPEEDS:
            console.print(f"CR-39 to failure, at {v0:.2f} m/s", highlight=False)
            test_file = data / "demo-test-series.toml"
            test = TEST_FILE.format(number=len(store.runs()) + 1)
            test_file.write_text(f"{test}\n[drop]\ncatcher = true\n")
            hand.ask(do="height", v0=v0)
            acquisition = start(rig_file, test_file, data, SERIES)
            truths.append(drop(acquisition, hand))
            end = follow(acquisition, as_json=False)
            if end["event"] != "done":
                raise ProcessError(end["text"])
    drops = drops_of(store, SERIES)[-len(SPEEDS) :]
    found = series_of(SERIES, drops)
    _say(found, drops, truths)
    report = data / "demo-report.html"
    console.print("writing the report", highlight=False)
    write_report(store, SERIES, report)
    return report


def _say(found: dict[str, Any], drops: list[Any], truths: list[dict[str, Any]]) -> None:
    right = sum(d.failed is t["failed"] for d, t in zip(drops, truths, strict=True))
    limit, load, stress = found["v0_fail"], found["F_rupture"], found["sigma_r"]
    console = Console()
    console.width = max(console.width, 118)
    console.print(
        f"\n[bold]{SERIES}[/bold]: {len(drops)} drops; whether each specimen failed is told rightly of {right}",
        highlight=False,
    )
    if limit is not None and load is not None:
        console.print(
            f"v0_fail {limit['value']:.2f} m/s (95 %: {limit['lo']:.2f} to {limit['hi']:.2f}; published 3.6), "
            f"rupture load {load['value']:.0f} N (set: 1800 N ± 4 % from specimen to specimen), "
            f"σ_r {stress['value'] / 1e6:.0f} MPa",
            highlight=False,
        )
