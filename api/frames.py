"""Runs and series for Python: pandas and xarray, from the optional extra `droptower[tables]`.

from api.frames import contact, series

series("lab", "CR-39").groupby("material").E.mean()
contact("lab", "20261121T113000Z-1f12a1").force.plot()
"""

from pathlib import Path
from typing import TYPE_CHECKING

from api.answer import answer_of, kinematics_of
from api.series import drops_of
from api.tables import rows_of
from daq.store import Store

if TYPE_CHECKING:
    import pandas
    import xarray


def series(data: str | Path, name: str) -> "pandas.DataFrame":
    """A series as a frame, a row a drop, indexed by run; columns in SI as in `droptower series --table`.

    Raises
    ------
    SeriesNotFound : no run is in a series of that name.
    """
    import pandas

    return pandas.DataFrame(rows_of(drops_of(Store(Path(data)), name))).set_index("run")


def contact(data: str | Path, run: str) -> "xarray.Dataset":
    """The contact of a run over t (s from first contact): force (N), v (m/s), alpha (m), energy (J).

    Attributes hold the findings that are known, each with its uncertainty as `u_…`, in SI.

    Raises
    ------
    RunNotFound : no such run.
    StoreError : its file is damaged.
    """
    import xarray

    store = Store(Path(data))
    motion, answer = kinematics_of(store.read(run)), answer_of(store, run)
    units = {"force": "N", "v": "m/s", "alpha": "m", "energy": "J"}
    known = {s: f for s, f in answer["findings"].items() if f["value"] is not None}
    told = {s: f["value"] for s, f in known.items()} | {f"u_{s}": f["u"] for s, f in known.items() if f["u"]}
    # NetCDF knows no truth values.
    attributes = {s: int(v) if isinstance(v, bool) else v for s, v in told.items()}
    return xarray.Dataset(
        {name: ("t", getattr(motion, name), {"units": unit}) for name, unit in units.items()},
        coords={"t": ("t", motion.t, {"units": "s"})},
        attrs={"run": run, "series": answer["series"] or "", **attributes},
    )
