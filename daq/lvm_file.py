"""LVM, LabVIEW's measurement file: two headers, then rows, with a comment column at the end."""

from pathlib import Path

from daq.errors import ImportFileError
from daq.table_file import Table, parse_rows, time_step

MAGIC = "LabVIEW Measurement"
_END = "***End_of_Header***"
_SEPARATORS = {"Tab": "\t", "Comma": ",", "Semicolon": ";"}


def read_lvm(text: str, path: Path) -> Table:
    """The one segment of an LVM text.

    Raises
    ------
    ImportFileError : a header is cut off, several segments, an X column for each channel, gaps, no numbers.
    """
    lines = text.splitlines()
    ends = [i for i, line in enumerate(lines) if line.startswith(_END)]
    if len(ends) < 2:
        raise ImportFileError(f"{path}: an LVM file has two headers, each closed by {_END}; {len(ends)} found")
    if len(ends) > 2:
        raise ImportFileError(f"{path}, line {ends[2] + 1}: a second segment starts here; save one drop a file")
    file_head = _pairs(lines[: ends[0]])
    delimiter = _SEPARATORS.get(file_head.get("Separator", "Tab"), "\t")
    segment = {
        k: cells for line in lines[ends[0] + 1 : ends[1]] if (k := (cells := line.split(delimiter)).pop(0).strip())
    }
    x_columns = file_head.get("X_Columns", "One")
    if x_columns not in ("One", "No"):
        raise ImportFileError(f"{path}: X_Columns is {x_columns!r}; only One and No are read")
    channels = int(_first(segment, "Channels", path))
    first = ends[1] + 2
    names = [n.strip() for n in lines[ends[1] + 1].split(delimiter)]
    offset = 1 if x_columns == "One" else 0
    names = names[offset : offset + channels]
    columns = list(range(offset + channels))
    values = parse_rows(lines[first:], first + 1, delimiter, file_head.get("Decimal_Separator", "."), columns, path)
    # Where there is no X column the header's step is all there is; where there is one it has to agree.
    dt = float(_first(segment, "Delta_X", path).replace(",", "."))
    if offset:
        found = time_step(values[:, 0], first + 1, path)
        if abs(found - dt) > 1e-3 * dt:
            raise ImportFileError(f"{path}: the header's Delta_X is {dt:g} s, the X column steps by {found:g} s")
    stated = int(_first(segment, "Samples", path))
    if stated != len(values):
        raise ImportFileError(
            f"{path}: the header states {stated} samples, the file holds {len(values)}: it is cut off"
        )
    units = [u.strip() for u in segment.get("Y_Unit_Label", [])][:channels]
    date, clock = file_head.get("Date", ""), file_head.get("Time", "")
    return Table(
        names,
        units + [""] * (len(names) - len(units)),
        values[:, offset:],
        dt,
        started=f"{date.replace('/', '-')}T{clock[:12]}" if date else None,
        notes={k: v for k, v in file_head.items() if k in ("Operator", "Project", "Description")},
    )


def _pairs(lines: list[str]) -> dict[str, str]:
    cells = [line.replace(",", "\t", 1).split("\t") if "\t" not in line else line.split("\t") for line in lines]
    return {c[0].strip(): c[1].strip() for c in cells if len(c) > 1}


def _first(segment: dict[str, list[str]], key: str, path: Path) -> str:
    cells = segment.get(key, [])
    if not cells or not cells[0].strip():
        raise ImportFileError(f"{path}: the header has no {key}")
    return cells[0].strip()
