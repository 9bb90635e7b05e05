"""A run as one HDF5 file: raw counts with calibration, settings and provenance, NeXus with a default plot.

The file is built in memory and written by plain `write`: h5py on a full disk swallows the error or crashes.
"""

import json
import zlib
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from daq.errors import StoreError
from daq.rig_file import Channel, RigFile
from daq.run import ChannelData, RunData
from daq.test_file import TestFile
from daq.toml_file import validate

FORMAT = 1
CHUNK = 62_500
_ENTRY = "entry"


def image(run: RunData) -> bytes:
    """The file's bytes."""
    with h5py.File.in_memory() as f:
        fill(f, run)
        f.flush()
        return bytes(f.id.get_file_image())


def fill(f: h5py.File, run: RunData) -> h5py.Group:
    """Write a run into an empty file; its NXentry."""
    f.attrs["NX_class"] = "NXroot"
    f.attrs["default"] = _ENTRY
    f.attrs["creator"] = "droptower"
    entry = group(f, _ENTRY, "NXentry")
    entry.attrs["default"] = "force"
    entry.attrs["droptower_format"] = FORMAT
    _text(entry, "entry_identifier", run.run)
    _text(entry, "title", f"{run.test.specimen.id} · {run.series or 'no series'}")
    _text(entry, "start_time", run.started)
    if run.series:
        _text(entry, "experiment_identifier", run.series)
    instrument = group(entry, "instrument", "NXinstrument")
    _text(instrument, "name", "instrumented drop tower")
    for i, channel in enumerate(run.channels):
        _write_channel(group(instrument, f"channel_{i + 1}", "NXdetector"), channel, run)
    gate = group(instrument, "gate", "NXdetector")
    edges = gate.create_dataset("edges", data=np.asarray(run.gate_edges_ns, dtype=np.int64))
    edges.attrs["units"] = "ns"
    edges.attrs["on_recorder_clock"] = run.gate_on_clock
    against = "against the trigger" if run.gate_on_clock else "on the gate's own clock"
    _text(gate, "description", f"flag edges {against}, falling first")
    _write_sample(group(entry, "sample", "NXsample"), run)
    _note(entry, "test_file", run.test_text, "application/toml")
    _note(entry, "test", run.test.model_dump_json(by_alias=True, exclude_none=True), "application/json")
    if run.rig is not None:
        _note(entry, "rig_file", run.rig_text or "", "application/toml")
        _note(entry, "rig", run.rig.model_dump_json(exclude_none=True), "application/json")
    facts = {"source": run.source, "g": run.g, "g_source": run.g_source, **run.provenance}
    _note(entry, "provenance", json.dumps(facts), "application/json")
    _write_preview(group(entry, "force", "NXdata"), run)
    return entry


def read(path: Path) -> RunData:
    """The run in a file that this module wrote. All samples are read and pass the file's own checksums.

    Raises
    ------
    StoreError : it cannot be read, its samples are damaged or it is of a format that is not known.
    """
    try:
        with h5py.File(path, "r") as f:
            return _read(f, path)
    except (OSError, KeyError, ValueError, RuntimeError) as e:
        raise StoreError(f"{path} cannot be read as a run: {e}; `droptower verify` tells what is damaged") from None


def read_provenance(path: Path) -> dict[str, Any]:
    """Where a run comes from, without its samples.

    Raises
    ------
    StoreError : as `read`.
    """
    try:
        with h5py.File(path, "r") as f:
            return json.loads(_string(_entry(f, path)["provenance/data"]))
    except (OSError, KeyError, ValueError, RuntimeError) as e:
        raise StoreError(f"{path} cannot be read as a run: {e}; `droptower verify` tells what is damaged") from None


def _entry(f: h5py.File, path: Path) -> Any:
    entry: Any = f[_ENTRY]
    if (found := entry.attrs.get("droptower_format")) != FORMAT:
        raise StoreError(f"{path} is of format {found}, this version reads format {FORMAT}")
    return entry


def _read(f: h5py.File, path: Path) -> RunData:
    entry = _entry(f, path)
    instrument = entry["instrument"]
    names = sorted(n for n in instrument if n.startswith("channel_"))
    first = instrument[names[0]]
    facts = json.loads(_string(entry["provenance/data"]))
    rig = entry.get("rig/data")
    return RunData(
        run=_string(entry["entry_identifier"]),
        series=_string(entry["experiment_identifier"]) if "experiment_identifier" in entry else None,
        started=_string(entry["start_time"]),
        source=facts.pop("source"),
        dt=float(first["sample_interval"][()]),
        channels=[_read_channel(instrument[n]) for n in names],
        test=validate(json.loads(_string(entry["test/data"])), TestFile, f"{path}: test"),
        test_text=_string(entry["test_file/data"]),
        g=facts.pop("g"),
        g_source=facts.pop("g_source"),
        first_sample_ns=int(first["first_sample"][()]) if "first_sample" in first else None,
        gate_edges_ns=tuple(int(v) for v in instrument["gate/edges"][()]),
        gate_on_clock=bool(instrument["gate/edges"].attrs.get("on_recorder_clock", True)),
        rig=None if rig is None else validate(json.loads(_string(rig)), RigFile, f"{path}: rig"),
        rig_text=None if rig is None else _string(entry["rig_file/data"]),
        provenance=facts,
    )


def _write_channel(g: h5py.Group, channel: ChannelData, run: RunData) -> None:
    samples = np.ascontiguousarray(channel.samples)
    data = g.create_dataset(
        "data", data=samples, chunks=(min(CHUNK, len(samples)),), compression="gzip", compression_opts=1,
        shuffle=True, fletcher32=True,
    )  # fmt: skip
    counts = samples.dtype == np.int16
    data.attrs["units"] = "counts" if counts else "as imported"
    data.attrs["long_name"] = "ADC counts" if counts else "values of the imported file"
    data.attrs["crc32"] = zlib.crc32(samples.data)
    for key, value in channel.calibration.model_dump(exclude={"u"}, exclude_none=True).items():
        g.attrs[f"calibration_{key}"] = value
    for key, value in channel.calibration.u.items():
        g.attrs[f"calibration_u_{key}"] = value
    if channel.bits is not None:
        g.attrs["adc_bits"] = channel.bits
    if channel.gaps:
        gaps = g.create_dataset("gaps", data=np.asarray(channel.gaps, dtype=np.int64))
        gaps.attrs["units"] = "samples"
        gaps.attrs["long_name"] = "first and number of the samples that could not be had; they stand as 0"
    _scalar(g, "sample_interval", run.dt, "s")
    if run.first_sample_ns is not None:
        _scalar(g, "first_sample", run.first_sample_ns, "ns")


def _read_channel(g: Any) -> ChannelData:
    prefix = "calibration_"
    keys = {k[len(prefix) :]: v for k, v in g.attrs.items() if k.startswith(prefix)}
    calibration = validate({k: _plain(v) for k, v in keys.items()}, Channel, f"{g.name}: calibration")
    samples: NDArray[Any] = g["data"][()]
    if zlib.crc32(samples.data) != g["data"].attrs["crc32"]:
        raise StoreError(f"{g.file.filename}: samples of {calibration.name} do not match their CRC-32")
    bits = g.attrs.get("adc_bits")
    gaps = tuple((int(start), int(count)) for start, count in g["gaps"][()]) if "gaps" in g else ()
    return ChannelData(calibration, samples, None if bits is None else int(bits), gaps)


def _write_sample(g: h5py.Group, run: RunData) -> None:
    specimen = run.test.specimen
    _text(g, "name", specimen.id or "")
    if specimen.material:
        _text(g, "description", specimen.material)
    _scalar(g, "thickness", specimen.thickness_mm, "mm")
    if run.test.environment.temperature_C is not None:
        _scalar(g, "temperature", run.test.environment.temperature_C, "degC")


def _write_preview(g: h5py.Group, run: RunData) -> None:
    """The default plot: least and greatest force of each stretch, so that no peak is missed."""
    force = run.channel("force") or run.channels[0]
    index = envelope(force.samples, 4000)
    g.attrs["signal"] = "force"
    g.attrs["axes"] = "time"
    g.attrs["time_indices"] = 0
    data = g.create_dataset("force", data=force.calibrated(index).astype(np.float32))
    data.attrs["units"] = force.calibration.unit
    data.attrs["long_name"] = f"Sensor force ({force.calibration.unit}), least and greatest of each stretch"
    axis = g.create_dataset("time", data=(index * run.dt * 1e3).astype(np.float32))
    axis.attrs["units"] = "ms"
    axis.attrs["long_name"] = "Time from the first sample (ms)"


def envelope(values: NDArray[Any], points: int) -> NDArray[np.int64]:
    """Indices of the least and the greatest value of each of `points`/2 stretches, in order; all if there are fewer."""
    n = len(values)
    if n <= points:
        return np.arange(n, dtype=np.int64)
    stretches = points // 2
    width = -(-n // stretches)
    finite = np.nan_to_num(values, nan=0.0) if values.dtype.kind == "f" else values
    padded = np.pad(finite, (0, -n % width), mode="edge").reshape(-1, width)
    start = np.arange(len(padded), dtype=np.int64) * width
    ends = np.stack([start + padded.argmin(axis=1), start + padded.argmax(axis=1)])
    return np.unique(np.minimum(np.sort(ends, axis=0).T.ravel(), n - 1))


def group(parent: h5py.Group, name: str, nx_class: str) -> h5py.Group:
    g = parent.create_group(name)
    g.attrs["NX_class"] = nx_class
    return g


def _note(parent: h5py.Group, name: str, text: str, kind: str) -> None:
    note = group(parent, name, "NXnote")
    _text(note, "type", kind)
    _text(note, "data", text)


def _text(g: h5py.Group, name: str, value: str) -> None:
    g.create_dataset(name, data=value, dtype=h5py.string_dtype())


def _scalar(g: h5py.Group, name: str, value: float, units: str) -> None:
    g.create_dataset(name, data=value).attrs["units"] = units


def _string(data: Any) -> str:
    return data.asstr()[()]


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value
