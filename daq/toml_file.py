"""Read a TOML file into a typed class; every complaint names file, line, key and the nearest right name."""

import difflib
import re
import tomllib
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from daq.errors import SettingsError

M = TypeVar("M", bound=BaseModel)
_TABLE = re.compile(r"^\s*\[\[?\s*([A-Za-z0-9_.\- ]+?)\s*\]\]?\s*(?:#.*)?$")
_KEY = re.compile(r"^\s*([A-Za-z0-9_\-.]+)\s*=")


def read_text(path: Path) -> str:
    """Text of a settings file.

    Raises
    ------
    SettingsError : the file is missing, unreadable or not UTF-8.
    """
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise SettingsError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError) as e:
        raise SettingsError(f"{path}: cannot be read: {e}") from None


def parse(text: str, model: type[M], name: str) -> M:
    """Check the TOML `text` against `model`; `name` stands for the file in messages.

    Raises
    ------
    SettingsError : one message with a line for each thing that is wrong.
    """
    try:
        tree = tomllib.loads(text)
    except tomllib.TOMLDecodeError as e:
        raise SettingsError(f"{name}: not valid TOML: {e}") from None
    return validate(tree, model, name, text)


def validate(tree: dict[str, Any], model: type[M], name: str, text: str = "") -> M:
    """Check a tree of settings that was read from `text`, or changed since."""
    try:
        return model.model_validate(tree)
    except ValidationError as e:
        lines = [_complaint(d, model, name, text) for d in e.errors(include_url=False)]
        raise SettingsError("\n".join(lines)) from None


def _complaint(detail: ErrorDetails, model: type[BaseModel], name: str, text: str) -> str:
    path = [p for p in detail["loc"] if not (isinstance(p, str) and p.startswith("function-"))]
    where = f"{name}{_line(text, path)}"
    key = str(path[-1]) if path else ""
    table = ".".join(str(p) for p in path[:-1] if isinstance(p, str))
    place = f"[{table}] " if table else ""
    if detail["type"] == "extra_forbidden":
        known = _known(model, path[:-1])
        near = difflib.get_close_matches(key, known, n=1, cutoff=0.5)
        hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(known)}"
        return f"{where}: {place}has no key {key!r}; {hint}" if place else f"{where}: no table [{key}] is known; {hint}"
    if detail["type"] == "missing":
        return f"{where}: {place}needs the key {key!r}"
    message = detail["msg"].removeprefix("Value error, ")
    given = detail["input"]
    shown = f" (given: {given!r})" if isinstance(given, str | int | float | bool) else ""
    return f"{where}: {place}{key}: {message}{shown}"


def _line(text: str, path: list[int | str]) -> str:
    """Where the key stands in the file, or its table if the key is not there."""
    names = [p for p in path if isinstance(p, str)]
    nth = next((p for p in path if isinstance(p, int)), 0)
    wanted, above = ".".join(names), ".".join(names[:-1])
    table, table_line = "", 0
    seen: dict[str, int] = {}
    for number, line in enumerate(text.splitlines(), 1):
        if head := _TABLE.match(line):
            table = head.group(1).replace(" ", "")
            seen[table] = seen.get(table, -1) + 1
            if table in (wanted, above) and seen[table] == nth:
                table_line = number
        elif (
            (key := _KEY.match(line)) and f"{table}.{key.group(1)}".lstrip(".") == wanted and seen.get(table, 0) == nth
        ):
            return f", line {number}"
    return f", line {table_line}" if table_line else ""


def _known(model: type[BaseModel], path: list[int | str]) -> list[str]:
    """Names that a table may hold."""
    here: type[BaseModel] = model
    for step in path:
        if isinstance(step, int):
            continue
        field = next((f for n, f in here.model_fields.items() if (f.alias or n) == step), None)
        inner = _inner_model(field.annotation) if field is not None else None
        if inner is None:
            return []
        here = inner
    return [f.alias or n for n, f in here.model_fields.items() if n != "u"]


def _inner_model(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for part in getattr(annotation, "__args__", ()):
        if (found := _inner_model(part)) is not None:
            return found
    return None
