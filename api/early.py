"""The contact first: which samples of a record to read before the rest, and what they show while the rest follows."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from analysis.forecast import SOFTEST, longest_contact
from api.ahead import ahead
from api.answer import analysed
from api.join import impact_of
from api.process import Acquisition
from daq.chunks import Chunks
from daq.recorder import Header
from daq.rig_file import RigFile, load_rig
from daq.run import ChannelData, RunData, now, resolve_g
from daq.test_file import TestFile, load_test

MARGIN = 1.5
"""Of the contact time: for dampers, and for samples after the contact that show its end."""
BASELINE = 1_000
"""Samples before the trigger: what the baseline is taken from."""
WORTH_IT = 0.5
"""Share of the record: a window larger than that is not read apart."""

Event = dict[str, Any]


def window_of(rig: RigFile, test: TestFile) -> tuple[int, int] | None:
    """First sample of the contact window, and the one after its last; None if it is most of the record."""
    r = rig.recorder
    E = test.specimen.E_static_GPa
    known = [c if c.counts_to_unit is not None else c.in_volts(1.0, 0.0) for c in r.channel]
    silent = [ChannelData(c, np.zeros(1, dtype=np.int16)) for c in known]
    impact = impact_of(_as_run(rig, test, silent, 1 / r.sample_rate_Hz))
    seconds = longest_contact(impact, SOFTEST if E is None else 0.5e9 * E)
    start = max(0, r.pretrigger - BASELINE)
    stop = min(r.samples, r.pretrigger + int((1 + MARGIN) * seconds * r.sample_rate_Hz))
    return (start, stop) if stop - start < WORTH_IT * r.samples else None


def preliminary(event: Event, rig_path: Path, test_path: Path) -> Event:
    """What a window that was read shows: an answer, as an event. Nothing of it is stored.

    event : `window` of an acquisition, with its first and last sample and where they are noted
    """
    rig, _ = load_rig(rig_path)
    test, _ = load_test(test_path)
    record, noted = Chunks.look(Path(event["chunks"]))
    header = Header.from_json(record)
    start, stop = event["start"], min(event["stop"], header.points)
    channels: list[ChannelData] = []
    for number, calibration in enumerate(rig.recorder.channel, 1):
        samples = np.zeros(stop - start, dtype=np.int16)
        for (channel, at), part in noted.items():
            if channel == number and start <= at and at + len(part) <= stop:
                samples[at - start : at - start + len(part)] = part
        scaled = calibration.in_volts(*header.scales[number - 1]) if header.scales else calibration
        channels.append(ChannelData(scaled, samples, header.bits))
    run = _as_run(rig, test, channels, header.interval_ns * 1e-9)
    first = header.first_sample_ns + start * header.interval_ns
    edges = tuple(event["gate_edges_ns"])
    answer = analysed(replace(run, run=event["run"], first_sample_ns=first, gate_edges_ns=edges), fit=False)
    return {"event": "preliminary", "at": now(), **{key: answer[key] for key in ("run", "findings", "warnings")}}


def _as_run(rig: RigFile, test: TestFile, channels: list[ChannelData], dt: float) -> RunData:
    g, g_source = resolve_g(test, rig)
    return RunData(
        run="", series=None, started="", source="acquired", dt=dt, channels=channels, test=test, test_text="",
        g=g, g_source=g_source, rig=rig,
    )  # fmt: skip


def start(
    rig: Path, test: Path, data: Path, series: str | None, spare: Path | None = None, again: bool = False
) -> Acquisition:
    """An acquisition of one drop, its contact first.

    Raises
    ------
    SettingsError : the rig or the test file is wrong.
    """
    rig_file, test_file = load_rig(rig)[0], load_test(test)[0]
    first = window_of(rig_file, test_file)
    return Acquisition(
        "acquire", rig, data, test, series, first=first, spare=spare, again=again, ahead=ahead(rig_file, test_file),
        at_window=lambda event: preliminary(event, rig, test),
    )  # fmt: skip
