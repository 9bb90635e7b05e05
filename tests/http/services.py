"""A real service on an ephemeral port over real run files."""

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import uvicorn
from emulator import until
from fastapi import FastAPI
from records import CR39, half_sine

from daq.rig_file import Channel
from daq.run import ChannelData, RunData, new_run_id, now
from daq.store import Store
from daq.test_file import TestFile, override
from daq.toml_file import parse

LONG = 300_000
SPIKE = 123_457


@contextmanager
def running(app: FastAPI) -> Iterator[str]:
    """The application served on a port of its own; its address."""
    listener = socket.create_server(("127.0.0.1", 0))
    server = uvicorn.Server(uvicorn.Config(app, lifespan="off", log_config=None, access_log=False))
    thread = threading.Thread(target=server.run, args=([listener],))
    thread.start()
    try:
        until(lambda: server.started, what="the service starts")
        yield f"http://127.0.0.1:{listener.getsockname()[1]}"
    finally:
        app.state.service.closing = True
        server.should_exit = True
        thread.join(timeout=10)
        listener.close()


def run_of(counts: np.ndarray, rate: float = 1e6, series: str | None = "speed", **test: object) -> RunData:
    """A run of these counts at 0.5 N each; `test` by dotted key with `__` for the dot."""
    settings = {key.replace("__", "."): value for key, value in test.items()}
    return RunData(
        run=new_run_id(), series=series, started=now(), source="imported", dt=1 / rate,
        channels=[ChannelData(Channel(counts_to_unit=0.5, range=4000), counts.astype(np.int16), 14)],
        test=override(parse(CR39, TestFile, "test"), settings, "test"), test_text=CR39, g=9.80665, g_source="test",
    )  # fmt: skip


def drop(seed: int = 0, **test: object) -> RunData:
    """A half-sine contact of 1050 N with some noise."""
    _, force = half_sine()
    noise = np.random.default_rng(seed).normal(0, 2, len(force))
    return run_of(np.round((force + noise) / 0.5), **test)


def publish(folder: Path, runs: list[RunData]) -> list[str]:
    """Put runs into a data folder, a second apart; their ids, newest first."""
    named = [replace(run, run=f"20261120T1000{i:02d}Z-{i:06x}") for i, run in enumerate(runs)]
    for run in named:
        Store(folder).publish(run)
    return [run.run for run in reversed(named)]
