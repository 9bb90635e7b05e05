"""`droptower`: the command line. Exit 0: done; 1: something could not be done, said on stderr; 2: wrong usage."""

import sys

import typer

from api.commands import drops, live, model, series, service
from daq.errors import DaqError

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Runs an instrumented drop tower: records that cannot be lost, findings with uncertainties, an emulated rig.",
)
app.command("demo")(service.demo)
app.command("sim")(live.sim)
app.command("acquire")(live.acquire)
app.command("recover")(live.recover)
app.command("check")(live.check)
app.command("import")(drops.import_files)
app.command("analyze")(drops.analyze)
app.command("model")(model.model)
app.command("series")(series.series)
app.command("report")(series.report)
app.command("export")(drops.export)
app.command("correct")(drops.correct)
app.command("verify")(drops.verify)
app.command("serve")(service.serve)


def main() -> None:
    """Run the command; an error of ours becomes one message and exit 1."""
    try:
        app()
    except DaqError as e:
        print(f"droptower: {e}", file=sys.stderr)
        sys.exit(1)
    except KeyboardInterrupt:
        print("droptower: stopped", file=sys.stderr)
        sys.exit(1)
    except BrokenPipeError:
        sys.stderr.close()  # the reader of our output has gone, and with it whom to tell
        sys.exit(1)
