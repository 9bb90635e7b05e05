"""Starts the emulator as a process of its own, for tests that want real wires."""

from __future__ import annotations

import json
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
START_LIMIT = 30.0


def until(condition: Callable[[], Any], limit: float = 10.0, what: str = "") -> Any:
    """The first true value of ``condition``, asked again and again for at most ``limit`` seconds."""
    deadline = time.monotonic() + limit
    while not (value := condition()):
        if time.monotonic() > deadline:
            raise AssertionError(f"did not happen in {limit} s: {what or condition}")
        select.select([], [], [], 0.002)
    return value


def address(url: str) -> tuple[str, int]:
    """Host and port of ``socket://host:port`` or ``tcp://host:port``."""
    host, port = url.split("//")[1].rsplit(":", 1)
    return host, int(port)


class Emulator:
    """A running ``python -m sim_device``; a context manager that ends it.

    ``endpoints`` is the JSON line it prints, ``process`` the process, ``log`` the text of its stderr so far.
    """

    def __init__(self, *arguments: str | os.PathLike[str]) -> None:
        """Start it with the given command line arguments and wait until it is ready."""
        self._stderr = tempfile.TemporaryFile()  # noqa: SIM115  closed in stop()
        self.process = subprocess.Popen(
            [sys.executable, "-m", "sim_device", *map(os.fspath, arguments)],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=self._stderr,
        )
        assert self.process.stdout is not None
        ready, _, _ = select.select([self.process.stdout], [], [], START_LIMIT)
        line = self.process.stdout.readline() if ready else b""
        self._connection: socket.socket | None = None
        if not line:
            self.process.kill()
            self.process.wait()
            text = self.log
            self.stop()
            raise AssertionError(f"the emulator did not start: {text}")
        self.endpoints: dict[str, str] = json.loads(line)
        self._lock = threading.Lock()
        self._connection = socket.create_connection(address(self.endpoints["control"]), timeout=30)
        self._answers = self._connection.makefile("rb")

    @property
    def log(self) -> str:
        """What it has written to stderr so far."""
        size = os.fstat(self._stderr.fileno()).st_size
        return os.pread(self._stderr.fileno(), size, 0).decode()

    def control(self, **request: Any) -> dict[str, Any]:
        """One request to the control endpoint and its answer, whatever it is."""
        assert self._connection is not None
        with self._lock:
            self._connection.sendall(json.dumps(request).encode() + b"\n")
            return json.loads(self._answers.readline())

    def do(self, what: str, **keys: Any) -> dict[str, Any]:
        """A request that must succeed."""
        answer = self.control(do=what, **keys)
        assert answer["ok"], answer
        return answer

    def fresh(self) -> None:
        """Back to an idle device without faults, held record or a dart in the air, with the rig as at the start.

        Cheaper than a new process. Waits for the dart to come to rest.
        """
        self.do("clear")
        until(lambda: not self.do("status")["moving"], what="the dart comes to rest")
        self.do("reset")
        with socket.create_connection(address(self.endpoints["scpi_tcp"]), timeout=10) as client:
            answers = client.makefile("rb")
            client.sendall(b"TRAC:HEAD?\n")
            fields = answers.readline().decode().strip().split(",")
            if fields[0] != "0":
                client.sendall(f"TRAC:ACK {fields[0]},{fields[9]}\n*OPC?\n".encode())
                answers.readline()
            answers.close()
        self.do("reset")
        self.do("specimen", kind="ring", E_GPa=3.3, nu=0.3, thickness_mm=4.6, support_radius_mm=30, C_i=8000, C_d=10,
                C=None, fail_N=None)  # fmt: skip
        self.do("dart", mass_kg=0.503, tip_radius_mm=6.35, tip_mass_kg=0, friction_N=0)
        self.do("sensor", noise_N=3, offset_N=5, gain=1, range_N=3200, bits=14, ringing=0.01, ringing_Hz=10_000,
                ringing_decay_s=0.5e-3, time_constant_s=None)  # fmt: skip
        self.do("gate", flag_width_mm=10, gap_mm=20, width_error_mm=0, edge_sd_mm=0.03, clock_ns=1000)
        self.do("height", v0=1.39)
        self.do("catcher", on=True)
        self.do("door", open=False)

    def kill(self) -> None:
        """As a power cut does it: SIGKILL."""
        self.process.kill()
        self.process.wait(timeout=10)

    def stop(self) -> int:
        """End it by SIGTERM and return its exit code."""
        if self._connection is not None:
            self._answers.close()
            self._connection.close()
            self._connection = None
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
            try:
                self.process.wait(timeout=10)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        if self.process.stdout is not None:
            self.process.stdout.close()
        if not self._stderr.closed:
            self._stderr.close()
        return self.process.returncode

    def __enter__(self) -> Emulator:
        """Itself."""
        return self

    def __exit__(self, *exception: object) -> None:
        """End it."""
        self.stop()
