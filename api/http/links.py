"""Where things are: every path that an answer or a page names."""

from typing import Any
from urllib.parse import quote, urlencode

API = "/api/v1"


def runs(**query: Any) -> str:
    """The list of runs, with those of the query that are given."""
    given = {k: v for k, v in query.items() if v is not None}
    return f"{API}/runs" + (f"?{urlencode(given)}" if given else "")


def of_run(run: str) -> dict[str, str]:
    """All that there is of one run."""
    own = f"{API}/runs/{run}"
    return {
        "self": own,
        "force": f"{own}/force",
        "envelope": f"{own}/envelope",
        "contact": f"{own}/contact",
        "fit": f"{own}/fit",
        "raw": f"{own}/raw",
        "csv": f"{own}/export?format=csv",
        "h5": f"{own}/export?format=h5",
        "page": f"/runs/{run}",
    }


def of_series(name: str) -> dict[str, str]:
    """All that there is of one series."""
    own = f"{API}/series/{quote(name, safe='')}"
    return {
        "self": own, "table": f"{own}/table", "figures": f"{own}/figures", "report": f"{own}/report",
        "page": f"/series/{quote(name, safe='')}",
    }  # fmt: skip


CURRENT = f"{API}/acquisitions/current"
ACQUISITION = {"self": CURRENT, "events": f"{CURRENT}/events"}
