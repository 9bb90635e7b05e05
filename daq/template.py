"""Commands with places for values: `{points}`, `{interval_s:.9e}`, `{window_s/12:g}`."""

import re
from collections.abc import Mapping

_PLACE = re.compile(r"\{(\w+)(?:([*/])([0-9.]+))?(?::([^{}]*))?\}")

Value = int | float | str


def places(template: str) -> set[str]:
    """Names that a template asks for.

    Raises
    ------
    ValueError : a brace that opens or closes no place.
    """
    if rest := re.search(r"[{}]", _PLACE.sub("", template)):
        raise ValueError(f"{template!r} has a {rest.group()!r} that belongs to no place like {{points}}")
    return {match.group(1) for match in _PLACE.finditer(template)}


def render(template: str, values: Mapping[str, Value]) -> str:
    """The template with its values; `{name/12:g}` is the value over 12, formatted by Python's rules."""

    def put(match: re.Match[str]) -> str:
        name, operator, number, form = match.groups()
        value = values[name]
        if operator and not isinstance(value, str):
            value = value * float(number) if operator == "*" else value / float(number)
        return format(value, form or "")

    return _PLACE.sub(put, template)
