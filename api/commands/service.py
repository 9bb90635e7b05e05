"""Commands that serve: serve, demo."""

from pathlib import Path
from typing import Annotated

import typer

from api.commands.options import Data
from api.commands.show import tell


def serve(
    data: Data,
    rig: Annotated[
        Path | None, typer.Option("--rig", help="Rig file, to arm from the page.", metavar="RIG.toml")
    ] = None,
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Port to listen on; 0 takes a free one.", min=0, max=65535)] = 8000,
) -> None:
    """Serve the page and the HTTP interface until Ctrl-C."""
    from api.http.service import serve as run_service
    from daq.rig_file import load_rig

    if rig is not None:
        load_rig(rig)
    run_service(data, rig, host, port, on_ready=lambda url: tell(f"droptower is on {url} (Ctrl-C ends it)"))


def demo(
    once: Annotated[bool, typer.Option("--once", help="End after the report, open nothing.")] = False,
    data: Annotated[Path, typer.Option("--data", help="Data folder.", metavar="DIR")] = Path("demo-data"),
) -> None:
    """Play the published CR-39 tests on the emulator, over both wires, then a series that fails; show what is found."""
    from api.demo import run_demo
    from api.demo_series import run_series

    agreed = run_demo(data)
    report = run_series(data)
    tell(f"the report of the series is {report}")
    if not once:
        open_in_browser(report)
        serve(data, None, "127.0.0.1", 8000)
    if not agreed:
        raise typer.Exit(1)


def open_in_browser(path: Path) -> None:
    """Open a file in the browser, where there is a screen for one: a browser of the terminal would stand in the way."""
    import os
    import sys
    import webbrowser

    if sys.platform != "linux" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        webbrowser.open(path.resolve().as_uri())
