"""A rig file and test file for the emulator, and acquisition run against them as the process that it is."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

WIRES = ("scpi_pty", "scpi_tcp", "modbus_rtu", "modbus_tcp")

RIG = """[recorder]
driver = "{driver}"
port = "{port}"
sample_rate_Hz = 500e3
samples = {samples}
pretrigger = 500
trigger_level = 60
wait_s = {wait_s}

[[recorder.channel]]
name = "tup"
counts_to_unit = 0.390625
range = 3200

[gate]
driver = "{driver}"
port = "{port}"
flag_width_mm = 10
gap_mm = 20

[interlock]
driver = "{driver}"
port = "{port}"
"""

TEST = """[dart]
mass_kg = 0.503
tip_radius_mm = 6.35
[specimen]
id = "s-1"
thickness_mm = 4.6
nu = 0.30
[support]
kind = "ring"
radius_mm = 30
"""


def write_rig(folder: Path, port: str, driver: str, samples: int = 5000, wait_s: float = 20.0) -> Path:
    path = folder / "rig.toml"
    path.write_text(RIG.format(driver=driver, port=port, samples=samples, wait_s=wait_s))
    return path


def write_test(folder: Path) -> Path:
    path = folder / "test.toml"
    path.write_text(TEST)
    return path


class Daq:
    """`python -m daq`, followed event by event. `again`: the specimen may have been hit before."""

    def __init__(self, do: str, rig: Path, data: Path, *arguments: str, again: bool = True) -> None:
        arguments += ("--again",) if do == "acquire" and again else ()
        command = [sys.executable, "-m", "daq", do, "--rig", str(rig), "--data", str(data), *arguments]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.events: list[dict[str, Any]] = []

    def __iter__(self) -> Iterator[dict[str, Any]]:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.events.append(json.loads(line))
            yield self.events[-1]

    def until(self, name: str) -> dict[str, Any]:
        """Follow to an event of that name."""
        for event in self:
            if event["event"] == name:
                return event
        raise AssertionError(f"no event {name!r}: {self.events[-3:]} {self.error()}")

    def end(self) -> dict[str, Any]:
        """Follow to the last event; nothing may have gone to stderr."""
        for _ in self:
            pass
        assert self.error() == ""
        return self.events[-1]

    def error(self) -> str:
        assert self.process.stderr is not None
        return self.process.stderr.read()

    def kill(self) -> None:
        os.kill(self.process.pid, signal.SIGKILL)
        self.process.wait()

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        for pipe in (self.process.stdout, self.process.stderr):
            assert pipe is not None
            pipe.close()
