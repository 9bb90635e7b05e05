"""``python -m sim_device``: start the emulator and say where it listens."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import importlib
import json
import os
import selectors
import shutil
import signal
import sys
import tempfile
import threading
from pathlib import Path

from sim_device import tcp
from sim_device.control import LONGEST_REQUEST, Control, set_fault
from sim_device.device import Device, log
from sim_device.fault_kinds import catalogue
from sim_device.memory import Memory, StateError
from sim_device.modbus import RtuSession, TcpSession
from sim_device.scpi import Session
from sim_device.scpi_commands import SCPI
from sim_device.settings import Rig, SettingError, load_scenario
from sim_device.wires import SerialLine

PORTS = "droptower-sim-"


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="sim_device", description="Emulates an instrumented drop tower on SCPI and Modbus."
    )
    parser.add_argument("--state", type=Path, metavar="FILE", help="record memory and counters, kept over power loss")
    parser.add_argument("--scenario", type=Path, metavar="FILE", help="the rig as it is at the start (TOML)")
    parser.add_argument("--baud", type=int, metavar="N", help="pace of the two serial lines, 8N1 (default: unpaced)")
    parser.add_argument("--list-faults", action="store_true", help="print the faults it can play, and end")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="seed of noise, jitter and phase (default 0)")
    arguments = parser.parse_args()
    if arguments.baud is not None and not 300 <= arguments.baud <= 10_000_000:
        parser.error("argument --baud: must be 300 to 10000000")
    if arguments.seed < 0:
        parser.error("argument --seed: must not be negative")
    return arguments


async def _serve(device: Device, baud: int | None) -> None:
    faults = device.faults
    ports = _folder()
    scpi_line = SerialLine(lambda: Session(device, SCPI), faults, baud, ports / "scpi")
    modbus_line = SerialLine(lambda: RtuSession(device), faults, baud, ports / "modbus")
    scpi, modbus = tcp.Port(lambda: Session(device, SCPI), faults), tcp.Port(lambda: TcpSession(device), faults)
    await scpi.open()
    await modbus.open()
    control = Control(device)
    hand = await asyncio.start_server(control.serve_client, tcp.HOST, 0, limit=LONGEST_REQUEST)

    def close_links() -> None:
        scpi_line.reset()
        modbus_line.reset()
        scpi.cut()
        modbus.cut()

    device.links.append(close_links)
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, stop.set)
    _announce(
        {
            "scpi_pty": str(scpi_line.path),
            "scpi_tcp": f"socket://{tcp.HOST}:{scpi.number}",
            "modbus_rtu": str(modbus_line.path),
            "modbus_tcp": f"tcp://{tcp.HOST}:{modbus.number}",
            "control": f"socket://{tcp.HOST}:{hand.sockets[0].getsockname()[1]}",
        }
    )
    # The solver takes half a second to load: meanwhile the wires are served already.
    threading.Thread(target=_load_solver, daemon=True).start()
    await stop.wait()
    device.recorder.forget()
    for end in (scpi, modbus, hand, scpi_line, modbus_line):
        end.close()
    shutil.rmtree(ports, ignore_errors=True)
    log("stopped")


def _folder() -> Path:
    """A folder for the serial ports' paths; those of emulators that were killed are swept."""
    parent = Path(tempfile.gettempdir())
    for old in parent.glob(f"{PORTS}*"):
        if not Path(f"/proc/{old.name.removeprefix(PORTS)}").exists():
            shutil.rmtree(old, ignore_errors=True)
    folder = parent / f"{PORTS}{os.getpid()}"
    folder.mkdir(exist_ok=True)
    return folder


def _load_solver() -> None:
    for module in ("scipy.integrate", "scipy.optimize"):
        importlib.import_module(module)


def _announce(endpoints: dict[str, str]) -> None:
    with contextlib.suppress(OSError):
        print(json.dumps(endpoints), flush=True)
    # Whoever read that line may close its end: nothing more is written there.
    with contextlib.suppress(OSError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, sys.stdout.fileno())
        os.close(null)


def main() -> int:
    """Run until SIGTERM or SIGINT; 1 if the state or the scenario cannot be used."""
    arguments = _arguments()
    if arguments.list_faults:
        print(catalogue())
        return 0
    try:
        rig, faults = load_scenario(arguments.scenario) if arguments.scenario is not None else (Rig(), [])
        device = Device(Memory(arguments.state), rig, arguments.seed)
        for keys in faults:
            set_fault(device.faults, keys)
    except (SettingError, StateError, OSError) as error:
        print(f"sim_device: {error}", file=sys.stderr)
        return 1
    # epoll rounds timers up to whole milliseconds, select does not: a millisecond is eleven bytes at 115200 baud.
    with asyncio.Runner(loop_factory=lambda: asyncio.SelectorEventLoop(selectors.SelectSelector())) as runner:
        runner.run(_serve(device, arguments.baud))
    return 0


if __name__ == "__main__":
    sys.exit(main())
