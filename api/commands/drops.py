"""Commands on stored drops: import, analyze, export, verify."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from api.commands.options import Correction, Data, Json, Kind, Series, TestFileOption, checked_figure
from api.commands.show import print_answer, print_json, tell
from daq.errors import DaqError, StoreError

if TYPE_CHECKING:
    from analysis.fit_problem import Corrected
    from daq.run import RunData


def import_files(
    files: Annotated[list[Path], typer.Argument(help="CSV or LVM files, a drop each.", metavar="FILE...")],
    test: TestFileOption,
    data: Data,
    v0: Annotated[float | None, typer.Option("--v0", help="Speed at contact, m/s, over the test file's.")] = None,
    u_v0: Annotated[float | None, typer.Option("--u-v0", help="Its standard uncertainty, m/s.")] = None,
    table: Annotated[Path | None, typer.Option("--table", help="A row a file.", metavar="DROPS.csv")] = None,
    series: Series = None,
    as_json: Json = False,
) -> None:
    """Import records of other recorders: CSV or LVM into run files, each on its own."""
    from daq.importing import import_file, read_drops
    from daq.store import Store
    from daq.test_file import load_test

    conditions, text = load_test(test)
    rows = read_drops(table) if table is not None else None
    given: dict[str, Any] = {"drop.v0": v0, "drop.u_v0": u_v0}
    given = {k: v for k, v in given.items() if v is not None}
    store = Store(data)
    failed = False
    for file in files:
        try:
            values = {**(rows.values(file) if rows is not None else {}), **given}
            source = "--v0, --u-v0" if given else str(table)
            run = import_file(file, conditions, text, series, values, source)
            store.publish(run)
        except DaqError as e:
            failed = True
            tell(f"droptower: {e}")
            if as_json:
                print_json({"file": str(file), "error": str(e)})
            continue
        if as_json:
            print_json({"file": str(file), "run": run.run})
        else:
            print(f"{file}: {run.run}")
    if failed:
        raise typer.Exit(1)


def analyze(
    data: Data,
    runs: Annotated[list[str] | None, typer.Argument(help="Runs to analyse.", metavar="RUN...")] = None,
    everything: Annotated[bool, typer.Option("--all", help="All runs of the folder.")] = False,
    model: Annotated[
        Kind | None, typer.Option("--model", help="Fit this one, not that of the support; the answer is not kept.")
    ] = None,
    correct: Annotated[
        list[Correction] | None,
        typer.Option("--correct", help="Correct the model for this; the answer is not kept. Give it again for more."),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option("--plot", help="FILE.png or FILE.svg of one run and its fit.", metavar="FILE")
    ] = None,
    as_json: Json = False,
) -> None:
    """Work out what the records say, and keep the answers beside them."""
    from api.answer import analysed, answer_of
    from daq.store import Store

    if bool(runs) == everything:
        raise typer.BadParameter("give runs, or --all")
    if plot is not None:
        checked_figure(plot)
        if runs is None or len(runs) != 1:
            raise typer.BadParameter("--plot draws one run", param_hint="--plot")
    store = Store(data)
    if not data.is_dir():
        raise StoreError(f"no data folder {data}")
    how: tuple[Corrected, ...] = tuple(c.value for c in correct or ())
    failed = False
    for run in store.runs() if everything else runs or []:
        try:
            kept = model is None and not how
            answer = (
                answer_of(store, run)
                if kept
                else analysed(store.read(run), None if model is None else model.value, how)
            )
            if plot is not None:
                _draw(store.read(run), model, how, plot)
        except DaqError as e:
            failed = True
            tell(f"droptower: {e}")
            continue
        if as_json:
            print_json(answer)
        else:
            print_answer(answer)
    if failed:
        raise typer.Exit(1)


def _draw(run: "RunData", model: Kind | None, how: "tuple[Corrected, ...]", path: Path) -> None:
    from analysis.fit import NotFitted
    from api.figures import save_fit
    from api.fitting import fit_of

    try:
        fit = fit_of(run, None if model is None else model.value, how)
    except NotFitted as e:
        tell(f"droptower: nothing is drawn: {e}")
        return
    save_fit(fit, path)
    tell(f"drawn in {path}")


def export(
    run: Annotated[str, typer.Argument(help="Run to export.", metavar="RUN")],
    data: Data,
    output: Annotated[Path, typer.Option("-o", "--output", help="FILE.csv or FILE.h5.", metavar="FILE")],
) -> None:
    """Write a run as one file: every sample as CSV, or a self-contained NeXus file with its analysis."""
    from api.answer import answer_of
    from daq.export import export_csv, export_nexus
    from daq.store import Store

    store = Store(data)
    if output.suffix == ".csv":
        export_csv(store.read(run), output)
    elif output.suffix == ".h5":
        export_nexus(store.read(run), answer_of(store, run), output)
    else:
        raise typer.BadParameter(f"{output} ends in neither .csv nor .h5", param_hint="-o")
    tell(f"{run} written to {output}")


def correct(
    run: Annotated[str, typer.Argument(help="The run.", metavar="RUN")],
    data: Data,
    to: Annotated[
        list[str],
        typer.Option("--set", help="A key of the test file and its value: measured.failed=true.", metavar="KEY=VALUE"),
    ],
    author: Annotated[str, typer.Option(help="Who corrects.")],
    reason: Annotated[str, typer.Option(help="Why.")],
) -> None:
    """Correct the test file of a run, with author and reason: conditions, or what is seen on the specimen."""
    from daq.catalog import Catalog
    from daq.corrections import value_of
    from daq.store import Store

    values: dict[str, Any] = {}
    for pair in to:
        key, sign, value = pair.partition("=")
        if not sign or "." not in key:
            raise typer.BadParameter(f"{pair!r} is not TABLE.KEY=VALUE, as measured.failed=true", param_hint="--set")
        values[key.strip()] = value_of(value.strip())
    store = Store(data)
    path = store.correct(run, values, author, reason)
    Catalog(store).forget(run)
    tell(f"{run}: {path.name} written; the record is as it was")


def verify(data: Data, as_json: Json = False) -> None:
    """Check every run: raw files against their checksums, answers against the raw files."""
    from daq.store import Store

    if not data.is_dir():
        raise StoreError(f"no data folder {data}")
    count = faults = 0
    for check in Store(data).verify():
        count += 1
        faults += bool(check.faults)
        if as_json:
            print_json({"run": check.run, "ok": not check.faults, "sha256": check.sha256, "faults": check.faults})
        for fault in check.faults:
            tell(f"{check.run}: {fault}")
    tell(f"{count} runs checked, {faults} damaged")
    if faults:
        raise typer.Exit(1)
