"""What a query may say: names that exist, slices as in Python, times, cursors."""

import difflib
import re
from collections.abc import Callable
from datetime import UTC, datetime
from functools import cache
from typing import Any, get_args, get_type_hints

from fastapi import Request
from fastapi.params import Query

from api.http.errors import Refusal
from daq.run import RUN_ID

_SLICE = re.compile(r"(-?\d{1,15})?:(-?\d{1,15})?(?::(-?\d{1,15})?)?")


def only_known(request: Request) -> None:
    """Refuse a query parameter that the route does not have, naming the nearest that it has."""
    known = _names(request.scope["endpoint"])
    for name in request.query_params:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1, cutoff=0.4)
            words = ", ".join(known) or "none"
            hint = f"did you mean {near[0]!r}? Known are {words}" if near else f"known are {words}"
            raise Refusal(422, "unknown-parameter", f"query: no parameter {name!r} here; {hint}")


@cache
def _names(endpoint: Callable[..., Any]) -> list[str]:
    hints = get_type_hints(endpoint, include_extras=True)
    return [name for name, hint in hints.items() if any(isinstance(m, Query) for m in get_args(hint)[1:])]


def part_of(text: str | None, points: int) -> range:
    """Indices that `start:stop[:step]` takes from a record of `points` samples, as Python's slices do.

    Raises
    ------
    Refusal : 422, it is no slice or runs backwards.
    """
    if text is None:
        return range(points)
    found = _SLICE.fullmatch(text.strip())
    if found is None:
        raise Refusal(
            422,
            "wrong-slice",
            f"query slice: {text[:60]!r} is no slice; write start:stop or start:stop:step in samples, as 0:5000, "
            f"-1000: or ::10",
        )
    start, stop, step = (None if part is None else int(part) for part in found.groups())
    if step is not None and step < 1:
        raise Refusal(422, "wrong-slice", f"query slice: the step has to be 1 or more, not {step}: time runs forward")
    return range(*slice(start, stop, step).indices(points))


def moment(text: str | None) -> str | None:
    """A time for `since`, in the form that the catalog compares.

    Raises
    ------
    Refusal : 422, it is no time.
    """
    if text is None:
        return None
    try:
        given = datetime.fromisoformat(text)
    except ValueError:
        raise Refusal(
            422, "wrong-time", f"query since: {text[:60]!r} is no time; write 2026-11-20 or 2026-11-20T10:00:00Z"
        ) from None
    aware = given if given.tzinfo is not None else given.replace(tzinfo=UTC)
    return aware.astimezone(UTC).isoformat(timespec="milliseconds")


def cursor(text: str | None) -> str | None:
    """The run after which a list goes on.

    Raises
    ------
    Refusal : 422, it is no run id.
    """
    if text is not None and not re.fullmatch(RUN_ID, text):
        raise Refusal(422, "wrong-cursor", f"query after: {text[:60]!r} is no run id; take the one of links.next")
    return text
