"""CSV: header names with units, comma, semicolon or tab, decimal point or comma."""

from pathlib import Path

from daq.errors import ImportFileError
from daq.table_file import TIME, Table, name_and_unit, parse_rows, quantity, time_step


def read_csv(text: str, path: Path) -> Table:
    """The table in a CSV text. Lines before the header may start with `#`.

    Raises
    ------
    ImportFileError : no header, no time column, gaps, no numbers, a time axis that is not one.
    """
    lines = text.splitlines()
    head = next((i for i, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")), None)
    if head is None:
        raise ImportFileError(f"{path}: the file is empty")
    title = lines[head]
    delimiter = next((d for d in (";", "\t", ",") if d in title), None)
    if delimiter is None:
        raise ImportFileError(f"{path}, line {head + 1}: no columns parted by comma, semicolon or tab: {title[:60]!r}")
    rows = lines[head + 1 :]
    decimal = "," if delimiter != "," and any("," in row for row in rows) else "."
    titles = [name_and_unit(t) for t in title.split(delimiter)]
    names, units = [n for n, _ in titles], [u for _, u in titles]
    if all(_is_number(n) for n in names):
        raise ImportFileError(
            f"{path}, line {head + 1}: a header is missing; the first line has to name the columns, as time_s,force_N"
        )
    clock = next((i for i, n in enumerate(names) if quantity(n) == "time"), None)
    if clock is None:
        raise ImportFileError(f"{path}, line {head + 1}: no time column (time_s) among {', '.join(names)[:80]!r}")
    if units[clock].lower() not in TIME:
        raise ImportFileError(
            f"{path}, line {head + 1}: time needs a unit in its name (time_s, time_ms, time_us), not {units[clock]!r}"
        )
    values = parse_rows(rows, head + 2, delimiter, decimal, list(range(len(names))), path)
    dt = time_step(values[:, clock] * TIME[units[clock].lower()], head + 2, path)
    keep = [i for i in range(len(names)) if i != clock]
    return Table([names[i] for i in keep], [units[i] for i in keep], values[:, keep], dt)


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True
