"""A run as one file to hand on: every sample as CSV, or a self-contained NeXus file with the analysis in it."""

import io
import os
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from daq.errors import StoreError
from daq.run import RunData
from daq.run_file import fill, group


def export_csv(run: RunData, path: Path) -> None:
    """Columns `time_s` (first sample = 0) and `<quantity>_<unit>` of each channel, a row a sample.

    Raises
    ------
    StoreError : the file cannot be written; nothing half-written is left.
    """
    titles = [f"{c.calibration.quantity}_{c.calibration.unit.replace('/', '_per_')}" for c in run.channels]
    if run.channels[0].calibration.unit == "N":
        titles[0] = "force_N"
    time = np.arange(run.points) * run.dt
    table = np.column_stack([time, *(c.calibrated() for c in run.channels)])
    text = io.StringIO()
    np.savetxt(text, table, delimiter=",", header=",".join(["time_s", *titles]), comments="", fmt="%.10g")
    _publish(path, text.getvalue().encode())


def export_nexus(run: RunData, answer: dict[str, Any] | None, path: Path) -> None:
    """The run's own file, with time and force of every sample and, if it was analysed, its findings as NXprocess.

    Raises
    ------
    StoreError : the file cannot be written; nothing half-written is left.
    """
    with h5py.File.in_memory() as f:
        entry = fill(f, run)
        force = run.channel("force") or run.channels[0]
        trace = group(entry, "trace", "NXdata")
        trace.attrs["signal"] = "force"
        trace.attrs["axes"] = "time"
        trace.attrs["time_indices"] = 0
        _column(trace, "force", force.calibrated(), force.calibration.unit, "Sensor force (N)")
        _column(trace, "time", np.arange(run.points) * run.dt, "s", "Time from the first sample (s)")
        if answer is not None:
            _write_findings(group(entry, "analysis", "NXprocess"), answer)
        f.flush()
        content = bytes(f.id.get_file_image())
    _publish(path, content)


def _write_findings(process: h5py.Group, answer: dict[str, Any]) -> None:
    process["program"] = "droptower"
    process["version"] = str(answer.get("software", {}).get("droptower", ""))
    results = group(process, "results", "NXparameters")
    for symbol, finding in answer["findings"].items():
        if finding["value"] is None:
            continue
        results[symbol] = finding["value"]
        results[symbol].attrs["units"] = "" if finding["unit"] == "1" else finding["unit"]
        if finding["u"] is not None:
            results[f"{symbol}_errors"] = finding["u"]
            results[f"{symbol}_errors"].attrs["units"] = results[symbol].attrs["units"]
    note = group(process, "warnings", "NXnote")
    note["type"] = "text/plain"
    note["data"] = "\n".join(f"{w['code']}: {w['text']}" for w in answer["warnings"])


def _column(data: h5py.Group, name: str, values: Any, units: str, long_name: str) -> None:
    column = data.create_dataset(name, data=values, compression="gzip", compression_opts=1, shuffle=True)
    column.attrs["units"] = units
    column.attrs["long_name"] = long_name


def _publish(path: Path, content: bytes) -> None:
    part = path.with_name(f".{path.name}.part-{os.getpid()}")
    try:
        part.write_bytes(content)
        part.replace(path)
    except OSError as e:
        raise StoreError(f"{path} cannot be written: {e.strerror or e}") from None
    finally:
        part.unlink(missing_ok=True)
