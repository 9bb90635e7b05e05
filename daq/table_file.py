"""What CSV and LVM files have in common: columns with units in their names, rows of numbers, a time axis to check."""

import gzip
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from daq.errors import ImportFileError

TIME = {"s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9}
QUANTITIES = {
    "force": {"n": 1.0, "kn": 1e3, "mn": 1e-3, "lbf": 4.4482216152605},
    "acceleration": {"m/s2": 1.0, "m/s^2": 1.0, "m/s²": 1.0, "g": 9.80665},
    "displacement": {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6},
}
SI = {"force": "N", "acceleration": "m/s2", "displacement": "m"}
_NAMES = {
    "time": ("time", "t", "zeit", "x_value"),
    "force": ("force", "f", "load", "kraft"),
    "acceleration": ("acceleration", "acc", "a", "accel", "beschleunigung"),
    "displacement": ("displacement", "deflection", "weg"),
}
_WITH_UNIT = re.compile(
    r"^(?P<name>.*?)(?:\s*[\[(]\s*(?P<a>[^\])]+)\s*[\])]|[_/]\s*(?P<b>[^\s_/\[(]+(?:/s(?:2|²|\^2))?))?\s*$"
)
LARGEST = 512 * 1024 * 1024
FEWEST = 16


@dataclass(frozen=True)
class Table:
    """Columns of one file: `names` and `units` ("" where none is given) as they stand, `values` (rows, columns)."""

    names: list[str]
    units: list[str]
    values: NDArray[np.float64]
    dt: float | None = None
    started: str | None = None
    notes: dict[str, str] = field(default_factory=dict[str, str])


def read_text(path: Path) -> str:
    """Text of a file, unpacked if it is gzip.

    Raises
    ------
    ImportFileError : missing, unreadable, or over 512 MiB of text.
    """
    try:
        with path.open("rb") as f:
            packed = f.read(2) == b"\x1f\x8b"
        with gzip.open(path) if packed else path.open("rb") as f:
            data = f.read(LARGEST + 1)
    except FileNotFoundError:
        raise ImportFileError(f"{path}: no such file") from None
    except (OSError, EOFError, gzip.BadGzipFile) as e:
        raise ImportFileError(f"{path}: cannot be read: {e}") from None
    if len(data) > LARGEST:
        raise ImportFileError(f"{path}: over {LARGEST >> 20} MiB of text; a record of 1,000,000 samples takes some 30")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def name_and_unit(title: str) -> tuple[str, str]:
    """`force_N`, `Force [kN]`, `time (ms)` parted; the unit is "" where the end of the name is no unit."""
    title = title.strip().strip('"')
    found = _WITH_UNIT.match(title)
    if found is None:
        return title, ""
    unit = (found["a"] or found["b"] or "").strip()
    if found["b"] and not _is_unit(unit):
        return title, ""
    return found["name"].strip(" _"), unit


def _is_unit(text: str) -> bool:
    low = text.lower()
    return low in TIME or any(low in units for units in QUANTITIES.values()) or low in ("v", "volt", "volts")


def quantity(name: str) -> str | None:
    """`time`, `force`, … by the name of a column."""
    low = name.lower()
    return next((q for q, known in _NAMES.items() if low in known), None)


def parse_rows(
    lines: list[str], first: int, delimiter: str, decimal: str, columns: list[int], path: Path
) -> NDArray[np.float64]:
    """Numbers of the `columns` of `lines`, whose first is line `first` of the file.

    Raises
    ------
    ImportFileError : a cell is missing, no number, NaN or infinite; names the line.
    """
    while lines and not lines[-1].strip():
        lines.pop()
    if len(lines) < FEWEST:
        raise ImportFileError(f"{path}: {len(lines)} samples; a record needs at least {FEWEST}")
    text = lines if decimal == "." else [line.replace(decimal, ".") for line in lines]
    try:
        values = np.loadtxt(text, delimiter=delimiter, usecols=columns, dtype=np.float64, ndmin=2, comments=None)
    except (ValueError, IndexError):
        raise ImportFileError(f"{path}, {_bad_row(text, first, delimiter, columns)}") from None
    if len(values) != len(text):
        raise ImportFileError(f"{path}, {_bad_row(text, first, delimiter, columns)}")
    bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
    if len(bad):
        raise ImportFileError(
            f"{path}, line {first + bad[0]}: not a finite number ({len(bad)} such lines); "
            f"a record with gaps is not one record"
        )
    return values


def _bad_row(lines: list[str], first: int, delimiter: str, columns: list[int]) -> str:
    for number, line in enumerate(lines, first):
        cells = line.split(delimiter)
        for c in columns:
            if c >= len(cells) or not cells[c].strip():
                return f"line {number}: column {c + 1} is empty; a record with gaps is not one record"
            try:
                float(cells[c])
            except ValueError:
                return f"line {number}: {cells[c].strip()[:40]!r} in column {c + 1} is not a number"
    return "the rows are not a table of numbers"


def time_step(time: NDArray[np.float64], first: int, path: Path) -> float:
    """Sample interval in s of a time column in s.

    Raises
    ------
    ImportFileError : time stands still, runs back, or has a gap; names the line.
    """
    steps = np.diff(time)
    back = np.flatnonzero(steps <= 0)
    if len(back):
        line = first + int(back[0]) + 1
        word = "stands still" if steps[back[0]] == 0 else "runs back"
        raise ImportFileError(
            f"{path}, line {line}: time {word} ({len(back)} such lines); rows shuffled, or times rounded too coarsely"
        )
    dt = float(np.median(steps))
    # The times are as fine as they are printed: half a step of room, and the rest is a gap.
    uneven = np.flatnonzero(np.abs(steps - dt) > 0.5 * dt)
    if len(uneven):
        line, missing = first + int(uneven[0]) + 1, round(float(steps[uneven[0]]) / dt) - 1
        raise ImportFileError(
            f"{path}, line {line}: the time axis has a gap of {max(missing, 0)} samples ({len(uneven)} uneven steps); "
            f"export the record again with a constant interval"
        )
    return float((time[-1] - time[0]) / (len(time) - 1))
