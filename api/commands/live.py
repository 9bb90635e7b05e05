"""Commands on a rig: acquire, recover, sim."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from api.commands.options import Data, Json, RigFileOption, Series, TestFileOption
from api.commands.show import findings_in_line, print_answer, print_json, tell

if TYPE_CHECKING:
    from api.process import Acquisition

EARLY = ("v0", "F_M", "t_c", "alpha_M", "eps_exact")
"""Findings that are shown while the rest of the record is still read."""


def acquire(
    rig: RigFileOption,
    test: TestFileOption,
    data: Data,
    series: Series = None,
    spare: Annotated[
        Path | None, typer.Option("--spare", help="Where the run goes if --data does not take it.", metavar="DIR")
    ] = None,
    again: Annotated[bool, typer.Option("--again", help="Hit a specimen that was hit before.")] = False,
    as_json: Json = False,
) -> None:
    """Arm the rig, take one drop, make it safe, and say what it shows."""
    from api.early import start
    from api.fitting import warm

    warm()
    if not again and sys.stdin.isatty():
        again = _asked(test, data)
    _take(start(rig, test, data, series, spare, again), data, as_json)


def _asked(test: Path, data: Path) -> bool:
    """Whether a specimen that was hit before is to be hit again; asked only if it was."""
    from daq.errors import AcquisitionError
    from daq.specimen import refuse_used
    from daq.store import Store
    from daq.test_file import load_test

    try:
        refuse_used(Store(data), load_test(test)[1])
    except AcquisitionError as e:
        if not typer.confirm(f"{e}.\nHit it again?"):
            raise typer.Exit(1) from None
        return True
    return False


def recover(
    rig: RigFileOption,
    data: Data,
    test: Annotated[
        Path | None, typer.Option("--test", help="For a record that nobody here armed.", metavar="TEST.toml")
    ] = None,
    give_up: Annotated[
        bool, typer.Option("--give-up", help="Release a record of which a partial run is all that can be had.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Save the record that a recorder still holds, or release it if it is saved."""
    from api.process import Acquisition

    _take(Acquisition("recover", rig, data, test, give_up=give_up), data, as_json)


def check(
    rig: Annotated[Path, typer.Argument(help="Rig file.", metavar="RIG.toml")],
    tap: Annotated[bool, typer.Option("--tap", help="Wait for a tap on the tup: trigger and polarity.")] = False,
    tare: Annotated[bool, typer.Option("--tare", help="Keep the zero level, against which drift is told.")] = False,
    data: Annotated[Path | None, typer.Option("--data", help="Needed for --tare.", metavar="DIR")] = None,
    as_json: Json = False,
) -> None:
    """Look at the rig before the first specimen: identity, settings, interlock, gate, noise, link speed."""
    from rich.console import Console
    from rich.table import Table

    from api.process import Acquisition

    if tare and data is None:
        raise typer.BadParameter("--tare needs --data: the zero level is kept there")
    if tap and tare:
        raise typer.BadParameter("give one of --tap and --tare")
    acquisition = Acquisition("check", rig, data, more=["--tap"] * tap + ["--tare"] * tare)
    for event in acquisition:
        if event["event"] == "tap-now":
            tell(event["text"])
    end = acquisition.result()
    rows = [{k: e[k] for k in ("name", "ok", "text")} for e in acquisition.events if e["event"] == "check"]
    good = end["event"] == "done"
    if as_json:
        print_json({"rig": str(rig), "ok": good, "checks": rows})
    elif rows:
        table = Table(title=str(rig), title_justify="left")
        for title in ("", "check", "found"):
            table.add_column(title)
        for row in rows:
            mark = "[bold green]good[/]" if row["ok"] else "[bold red]BAD[/]"
            table.add_row(mark, row["name"], row["text"])
        Console().print(table)
    if not good:
        tell(f"droptower: {end['text']}")
        raise typer.Exit(1)


def sim(
    state: Annotated[Path | None, typer.Option(help="File that keeps record memory and boot counter.")] = None,
    scenario: Annotated[Path | None, typer.Option(help="TOML file with the rig to play.")] = None,
    baud: Annotated[int | None, typer.Option(help="Pace the serial lines at this rate.", min=300)] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of its noise.", min=0)] = None,
    list_faults: Annotated[bool, typer.Option("--list-faults", help="Print the faults it can play, and end.")] = False,
) -> None:
    """Play a rig: SCPI and Modbus on real wires. Prints its endpoints as one JSON line and runs until stopped."""
    from api.process import become_emulator

    given = {"--state": state, "--scenario": scenario, "--baud": baud, "--seed": seed}
    listing = ["--list-faults"] if list_faults else []
    become_emulator([*listing, *(part for k, v in given.items() if v is not None for part in (k, str(v)))])


def _take(acquisition: "Acquisition", data: Path, as_json: bool) -> None:
    from api.answer import answer_of
    from daq.store import Store

    try:
        end = follow(acquisition, as_json)
    except KeyboardInterrupt:
        acquisition.abort()
        tell("disarming; a record that has come is saved first")
        end = follow(acquisition, as_json, only_new=True)
    if end["event"] == "failed":
        tell(f"droptower: {end['text']}")
        raise typer.Exit(1)
    if end["run"] is None:
        tell("the recorder holds no record: nothing was lost, there is nothing to recover")
        return
    answer = answer_of(Store(data), end["run"])
    if as_json:
        print_json(answer)
    else:
        print_answer(answer)


def follow(acquisition: "Acquisition", as_json: bool, only_new: bool = False) -> dict[str, Any]:
    """Show what an acquisition says, with a bar while the record is read; its last event."""
    import json

    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    skip = len(acquisition.events) if only_new else 0
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %  {task.fields[rate]}"),
    )
    end: dict[str, Any] = {}
    with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True), disable=as_json) as bar:
        task = None
        for number, event in enumerate(acquisition):
            end = event
            if number < skip:
                continue
            if as_json:
                print(json.dumps(event), file=sys.stderr, flush=True)
            elif event["event"] == "progress":
                rate = f"{event['bytes'] / 1e3:.0f} kB, {event['rate_B_s'] / 1e3:.1f} kB/s"
                task = bar.add_task("reading the record", total=event["total"], rate="") if task is None else task
                bar.update(task, completed=event["done"], rate=rate)
            elif event["event"] == "preliminary":
                early = findings_in_line(event["findings"], EARLY)
                bar.console.print(f"preliminary  {early}", highlight=False, markup=False)
            elif event["event"] not in ("done", "failed", "window"):
                bar.console.print(_words(event), highlight=False, markup=False)
    return end


def _words(event: dict[str, Any]) -> str:
    facts = {k: v for k, v in event.items() if k not in ("event", "at", "text")}
    told = " ".join(f"{k}={v}" for k, v in facts.items())
    mark = "ARMED – drop now" if event["event"] == "armed" else event["event"]
    return f"{mark}  {event.get('text', '') if event['event'] != 'armed' else ''} {told}".replace("  ", " ")
