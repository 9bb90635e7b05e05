"""A series as a table, a row a drop: CSV, Parquet."""

import csv
import io
from pathlib import Path
from typing import Any

from api.drop import Drop
from api.series import OF_A_RUN, OF_FINDINGS
from daq.errors import StoreError

FORMATS = (".csv", ".parquet")
EXTRA = "pip install 'droptower[tables]'"


def rows_of(drops: list[Drop]) -> list[dict[str, Any]]:
    """A row a drop in SI: conditions, findings and parameters, each uncertainty beside its value as `u_…`."""
    rows: list[dict[str, Any]] = []
    for drop in drops:
        test, found = drop.run.test, drop.answer["findings"]
        row: dict[str, Any] = {
            "run": drop.run.run, "series": drop.run.series, "started": drop.run.started, "specimen": test.specimen.id,
            "material": test.specimen.material, "batch": test.operator.batch, "shape": test.specimen.shape,
            "thickness": drop.total_mm * 1e-3, "nu": test.specimen.nu, "mass": test.dart.mass_kg,
            "tip_radius": test.dart.tip_radius_mm * 1e-3, "support": test.support.kind,
            "support_radius": None if test.support.radius_mm is None else test.support.radius_mm * 1e-3,
            "temperature_C": test.environment.temperature_C, "failed_counted": drop.failed,
        }  # fmt: skip
        for symbol in OF_FINDINGS:
            row[symbol] = found[symbol]["value"]
            if not symbol.startswith("fail"):
                row[f"u_{symbol}"] = found[symbol]["u"]
        known = {} if drop.answer["fit"] is None else drop.answer["fit"]["parameters"]
        for name in OF_A_RUN:
            for key in ("value", "u_total", "lo", "hi", "verdict"):
                row[name if key == "value" else f"{name}_{key}"] = known[name][key] if name in known else None
        row["warnings"] = " ".join(w["code"] for w in drop.answer["warnings"])
        rows.append(row)
    return rows


def as_csv(rows: list[dict[str, Any]]) -> str:
    """The rows as CSV with a head; what is not known is empty."""
    out = io.StringIO()
    writer = csv.DictWriter(out, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()


def write_table(drops: list[Drop], path: Path) -> None:
    """Write the table of a series; the suffix says what as.

    Raises
    ------
    StoreError : the file cannot be written, or Parquet was asked for and pyarrow is not installed.
    """
    rows = rows_of(drops)
    try:
        if path.suffix == ".csv":
            path.write_text(as_csv(rows), encoding="utf-8")
            return
        try:
            import pyarrow
            from pyarrow import parquet
        except ImportError:
            raise StoreError(f"{path}: Parquet needs pyarrow; get it by {EXTRA}, or write FILE.csv") from None
        parquet.write_table(pyarrow.Table.from_pylist(rows), path)
    except OSError as e:
        raise StoreError(f"{path} cannot be written: {e.strerror or e}") from None
