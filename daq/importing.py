"""Files of other recorders into the same run files, each with its own conditions."""

import csv
import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from daq.corrections import value_of
from daq.csv_file import read_csv
from daq.errors import ImportFileError, SettingsError
from daq.lvm_file import MAGIC, read_lvm
from daq.rig_file import Channel
from daq.run import ChannelData, RunData, new_run_id, now, resolve_g, software
from daq.table_file import QUANTITIES, SI, Table, quantity, read_text
from daq.test_file import ImportChannel, TestFile, override

_SHORT = {"v0": "drop.v0", "u_v0": "drop.u_v0", "height_mm": "drop.height_mm", "specimen_id": "specimen.id"}


@dataclass(frozen=True)
class DropsTable:
    """A row a file: values of the test file that differ from drop to drop."""

    path: Path
    rows: dict[str, dict[str, Any]]

    def values(self, file: Path) -> dict[str, Any]:
        """Values of a file's row, by dotted key.

        Raises
        ------
        SettingsError : the table has no row of that name.
        """
        if file.name not in self.rows:
            raise SettingsError(f"{self.path}: no row for {file.name}; it has {', '.join(self.rows)}")
        return self.rows[file.name]


def read_drops(path: Path) -> DropsTable:
    """The table at `path`: columns `file`, `v0`, `u_v0`, `height_mm`, `specimen_id` and any key as `dart.mass_kg`.

    Raises
    ------
    SettingsError : missing, no `file` column, a column that is no key, a file named twice.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as e:
        raise SettingsError(f"{path}: cannot be read: {e}") from None
    reader = csv.DictReader(text.splitlines(), delimiter=";" if ";" in text.partition("\n")[0] else ",")
    titles = list(reader.fieldnames or [])
    if "file" not in titles:
        raise SettingsError(f"{path}, line 1: the table needs a column 'file'; it has {', '.join(titles) or 'none'}")
    for title in titles:
        if title != "file" and title not in _SHORT and "." not in title:
            raise SettingsError(
                f"{path}, line 1: column {title!r} is no key; known are {', '.join(_SHORT)} and table.key"
            )
    rows: dict[str, dict[str, Any]] = {}
    for row in reader:
        name = Path((row.pop("file") or "").strip()).name
        if name in rows:
            raise SettingsError(f"{path}, line {reader.line_num}: {name} stands twice")
        rows[name] = {_SHORT.get(k, k): _value(v, k) for k, v in row.items() if k and v and v.strip()}
    return DropsTable(path, rows)


def _value(text: str, key: str) -> Any:
    text = text.strip()
    if key == "specimen_id" or key.endswith((".id", ".name", ".batch", ".note", ".material")):
        return text
    if text in ("true", "false") or text.startswith("["):
        return value_of(text)
    try:
        return float(text)
    except ValueError:
        return text


def import_file(
    path: Path, test: TestFile, test_text: str, series: str | None, values: dict[str, Any], values_from: str
) -> RunData:
    """The run in one CSV or LVM file; `values` change the test, by dotted key, and come from `values_from`.

    Raises
    ------
    ImportFileError : the file does not hold one clean record.
    SettingsError : `values` make no valid test.
    """
    test = override(test, values, values_from) if values else test
    text = read_text(path)
    lvm = text.startswith(MAGIC)
    table = read_lvm(text, path) if lvm else read_csv(text, path)
    assert table.dt is not None, "both readers find the sample interval"
    g, g_source = resolve_g(test, None)
    return RunData(
        run=new_run_id(),
        series=series,
        started=table.started or now(),
        source="imported",
        dt=table.dt,
        channels=_channels(table, list(test.import_.channel), path),
        test=test,
        test_text=test_text,
        g=g,
        g_source=g_source,
        provenance={
            "software": software(),
            "imported_at": now(),
            "file": path.name,
            "file_sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
            "file_format": "LVM" if lvm else "CSV",
            "notes": table.notes,
            "changed_from_test_file": values,
        },
    )


def _channels(table: Table, stated: list[ImportChannel], path: Path) -> list[ChannelData]:
    """Columns with a meaning, force first: as the test file states, else by name and unit."""
    found = [_stated_channel(table, c, path) for c in stated]
    taken = {c.column for c in stated}
    for i, (name, unit) in enumerate(zip(table.names, table.units, strict=True)):
        kind = quantity(name)
        scale = QUANTITIES.get(kind or "", {}).get(unit.lower())
        if name in taken or kind is None or scale is None or any(c.calibration.quantity == kind for c in found):
            continue
        facts = {"name": name, "quantity": kind, "unit": SI[kind], "counts_to_unit": scale}
        found.append(ChannelData(Channel.model_validate(facts), _column(table, i)))
    found.sort(key=lambda c: c.calibration.quantity != "force")
    if not found or found[0].calibration.quantity != "force":
        shown = ", ".join(f"{n} [{u or 'no unit'}]" for n, u in zip(table.names, table.units, strict=True))
        raise ImportFileError(
            f"{path}: no force column with a unit (force_N) among {shown}; name the column in the test file by "
            f'[[import.channel]] column = "{table.names[-1] if table.names else "…"}", quantity = "force", unit = "N", '
            f"scale = N per unit of the file"
        )
    return found


def _stated_channel(table: Table, c: ImportChannel, path: Path) -> ChannelData:
    if c.column not in table.names:
        raise ImportFileError(
            f"{path}: the test file names a column {c.column!r}; the file has {', '.join(table.names)}"
        )
    if c.unit.lower() not in QUANTITIES[c.quantity]:
        known = ", ".join(QUANTITIES[c.quantity])
        raise ImportFileError(
            f"[[import.channel]] {c.column}: {c.quantity} in {c.unit!r} is not known; known are {known}"
        )
    si = QUANTITIES[c.quantity][c.unit.lower()]
    calibration = Channel(
        name=c.column, quantity=c.quantity, unit=SI[c.quantity], counts_to_unit=c.scale * si, offset=c.offset * si,
        time_constant_s=c.time_constant_s, u={"counts_to_unit": c.u["scale"] * si} if "scale" in c.u else {},
    )  # fmt: skip
    return ChannelData(calibration, _column(table, table.names.index(c.column)))


def _column(table: Table, i: int) -> Any:
    return np.ascontiguousarray(table.values[:, i])
