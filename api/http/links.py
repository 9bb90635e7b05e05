"""Where things are: every path that an answer or a page names."""

from typing import Any
from urllib.parse import urlencode

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


CURRENT = f"{API}/acquisitions/current"
ACQUISITION = {"self": CURRENT, "events": f"{CURRENT}/events"}
