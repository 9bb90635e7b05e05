"""The demo: P1's CR-39 drops on the emulator, over SCPI and over Modbus, found values beside set and published ones."""

from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from api.answer import answer_of
from api.commands.live import follow
from api.commands.show import value_with_u
from api.demo_rig import RIG_FILE, TEST_FILE, Control, drop
from api.early import start
from api.process import Emulator, ProcessError
from daq.store import Store

DROPS = {
    # v0 m/s: (E GPa, C_i, C_d), measured and modelled (F_M N, α_M mm, ε published form); P1 Table 1
    1.39: ((3.30, 8000, 10), (709, 1.28, 0.88), (700, 1.28, 0.90)),
    1.95: ((3.40, 4500, 10), (1067, 1.77, 0.80), (1045, 1.77, 0.80)),
    2.80: ((3.42, 5000, 15), (1448, 2.59, 0.81), (1412, 2.61, 0.81)),
}
COLUMNS = {
    "F_M": ("F_M / N", 1.0),
    "alpha_M": ("α_M / mm", 1e3),
    "t_c": ("t_c / ms", 1e3),
    "eps_exact": ("ε exact", 1.0),
}
FITTED = {"E": 1e-9, "C_i": 1.0, "C_d": 1.0}
WIDER = 2.2
"""Times a 95 % interval: what holds the truth in all 18 of a demo but once in some 3,000."""
LIMIT_U = 4.0
"""Deviation, in standard uncertainties, that noise explains: of 24 findings one lies beyond it once in 600 demos."""


def run_demo(data: Path) -> bool:
    """Six drops into `data`, and the table; whether what was found agrees with what the emulator was set to.

    Raises
    ------
    ProcessError, DaqError : a drop did not become a run.
    """
    console = Console(stderr=True)
    store = Store(data)
    found: list[tuple[float, str, dict[str, Any], dict[str, Any]]] = []
    data.mkdir(parents=True, exist_ok=True)
    with Emulator("--seed", "39") as rig, Control(rig.endpoints["control"]) as hand:
        for driver, wire in (("scpi", "scpi_pty"), ("modbus", "modbus_tcp")):
            rig_file = data / f"demo-rig-{driver}.toml"
            rig_file.write_text(RIG_FILE.format(driver=driver, port=rig.endpoints[wire]))
            for v0, (specimen, _, _) in DROPS.items():
                console.print(f"CR-39 at {v0:.2f} m/s by {driver.upper()} on {rig.endpoints[wire]}", highlight=False)
                test_file = data / f"demo-test-{v0:.2f}.toml"
                test_file.write_text(TEST_FILE.format(number=len(store.runs()) + 1))
                hand.ask(do="specimen", **dict(zip(("E_GPa", "C_i", "C_d"), specimen, strict=True)))
                hand.ask(do="height", v0=v0)
                acquisition = start(rig_file, test_file, data, "demo CR-39")
                truth = drop(acquisition, hand)
                end = follow(acquisition, as_json=False)
                if end["event"] != "done":
                    raise ProcessError(end["text"])
                found.append((v0, driver, truth, answer_of(store, end["run"])))
    agreed = _print_table(found)
    return _print_fits(found) and agreed


def _print_table(found: list[tuple[float, str, dict[str, Any], dict[str, Any]]]) -> bool:
    table = Table(
        title="CR-39, 0.503 kg on a ring of 30 mm: published, set in the emulator, found", title_justify="left"
    )
    for title in ("v0", "", *(t for t, _ in COLUMNS.values()), "ε published"):
        table.add_column(title, justify="left" if title in ("v0", "") else "right")
    agreed = True
    for v0, (_, measured, modelled) in DROPS.items():
        truth = next(t for v, _, t, _ in found if v == v0)
        table.add_row(f"{v0:.2f} m/s", "P1, measured", f"{measured[0]}", f"{measured[1]}", "", "", f"{measured[2]:.2f}")
        note = "*" if v0 == 1.95 else ""
        table.add_row("", f"P1, model{note}", f"{modelled[0]}", f"{modelled[1]}", "", "", f"{modelled[2]:.2f}")
        published_form = truth["eps_exact"] + 9.80665 * truth["t_c"] / truth["v0"]
        table.add_row(
            "", "set", *(f"{truth[s] * f:.4g}" for s, (_, f) in COLUMNS.items()), f"{published_form:.3f}", style="bold"
        )
        for _, driver, truth, answer in (row for row in found if row[0] == v0):
            cells: list[str] = []
            for symbol, (_, factor) in COLUMNS.items():
                finding = answer["findings"][symbol]
                cell, good = _compare(finding, truth[symbol], factor)
                agreed &= good
                cells.append(cell)
            published = answer["findings"]["eps_published"]
            table.add_row("", f"found, {driver.upper()}", *cells, value_with_u(published["value"], published["u"]))
        table.add_section()
    console = Console()
    console.width = max(console.width, 118)  # so that no cell is broken where the output is no terminal
    console.print(table)
    console.print(
        "In brackets: (found − set) in standard uncertainties, which hold what the sensor chain's noise (3 N), ringing "
        "(1 % at 10 kHz), converter (0.39 N) and gate (0.5 % of v0) explain. * P1's 1045 N at 1.95 m/s does not follow "
        "from its own E, C_i and C_d: a correct solver gives 975 N.",
        highlight=False,
    )
    console.print(
        f"All {2 * len(DROPS) * len(COLUMNS)} findings agree with the set values within {LIMIT_U:g} u."
        if agreed
        else f"[bold]Some findings differ from the set values by more than {LIMIT_U:g} u.[/bold]",
        highlight=False,
    )
    return agreed


def _print_fits(found: list[tuple[float, str, dict[str, Any], dict[str, Any]]]) -> bool:
    """E and dampers of each drop with their 95 % intervals; whether every interval, made half as wide again, holds."""
    table = Table(title="The flexed plate fitted to each record: 95 % intervals", title_justify="left")
    for title in ("v0", "", "E / GPa", "C_i / kg/s", "C_d / kg/s"):
        table.add_column(title, justify="left" if title in ("v0", "") else "right")
    missed = 0
    for v0, (specimen, _, _) in DROPS.items():
        table.add_row(f"{v0:.2f} m/s", "set", *(f"{value:g}" for value in specimen), style="bold")
        for _, driver, _, answer in (row for row in found if row[0] == v0):
            cells: list[str] = []
            known = {} if answer["fit"] is None else answer["fit"]["parameters"]
            for (name, factor), truth in zip(FITTED.items(), specimen, strict=True):
                cell, good = _interval(known.get(name), truth, factor)
                missed += not good
                cells.append(cell)
            table.add_row("", f"found, {driver.upper()}", *cells)
        table.add_section()
    console = Console()
    console.width = max(console.width, 118)
    console.print(table)
    held = "hold" if not missed else f"[bold]{missed} do not hold[/bold]"
    console.print(
        f"18 intervals, each widened by {WIDER - 1:.0%}: {'all ' if not missed else ''}{held} the set value.",
        highlight=False,
    )
    return missed == 0


def _interval(p: dict[str, Any] | None, truth: float, factor: float) -> tuple[str, bool]:
    """A parameter's interval, and whether it holds the truth once it is `WIDER`."""
    if p is None:
        return "not fitted", False
    ends = [None if p[end] is None else p[end] * factor for end in ("lo", "hi")]
    middle = truth if p["value"] is None else p["value"] * factor
    low, high = (None if e is None else middle + WIDER * (e - middle) for e in ends)
    good = (low is None or low <= truth) and (high is None or truth <= high)
    shown = " to ".join("…" if e is None else f"{e:.4g}" for e in ends)
    return f"{shown}{'' if good else ' !'}", good


def _compare(finding: dict[str, Any], truth: float, factor: float) -> tuple[str, bool]:
    value, u = finding["value"], finding["u"]
    if value is None or not u:
        return "not found", False
    off = (value - truth) / u
    good = abs(off) <= LIMIT_U
    return f"{value_with_u(value, u, factor)} ({off:+.1f}){'' if good else ' !'}", good
