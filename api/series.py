"""A series of runs: each fitted, and all together."""

from typing import Any

from analysis.fit import Fit, NotFitted
from analysis.joint import fit_jointly
from api.answer import answer_of
from api.fitting import fit_of
from api.rupture import Drop, rupture_of
from daq.catalog import Catalog
from daq.errors import StoreError
from daq.store import Store

MOST = 10_000
OF_FINDINGS = ("v0", "F_M", "t_c", "eps_exact", "failed", "F_failure", "E_failure")
OF_A_RUN = ("E", "C_i", "C_d", "C")


def series_of(store: Store, name: str) -> dict[str, Any]:
    """Runs of a series with what was fitted to each, the joint fit with one E and that with E over v0, and warnings.

    Raises
    ------
    StoreError : no run is in a series of that name.
    """
    rows = [row for row in Catalog(store).runs({"series": name}, limit=MOST) if row.fault is None]
    if not rows:
        raise StoreError(f"{store.folder} holds no run of a series {name!r}")
    runs: list[dict[str, Any]] = []
    fits: list[Fit] = []
    drops: list[Drop] = []
    warnings: list[dict[str, str]] = []
    for row in reversed(rows):
        answer = answer_of(store, row.run)
        known = {} if answer["fit"] is None else answer["fit"]["parameters"]
        runs.append(
            {
                "run": row.run, "specimen": row.specimen,
                **{symbol: answer["findings"][symbol] for symbol in OF_FINDINGS},
                "fit": {name: known[name] for name in OF_A_RUN if name in known},
                "warnings": [w["code"] for w in answer["warnings"]],
            }
        )  # fmt: skip
        drops.append((store.read(row.run), answer["findings"]))
        if answer["findings"]["failed"]["value"] is True:
            continue  # what is left of its record is no equal of the others
        try:
            fits.append(fit_of(drops[-1][0]))
        except NotFitted as e:
            warnings.append({"code": "not-fitted", "text": f"{row.run}: {e}"})
    joint: dict[str, Any] = {}
    for key, law in (("one_E", False), ("E_over_v0", True)):
        try:
            joint[key] = _as_json(fit_jointly(fits, law))
        except NotFitted as e:
            joint[key] = None
            warnings.append({"code": f"no-joint-fit-{key}".lower().replace("_", "-"), "text": str(e)})
            continue
        if not joint[key]["agree"]:
            text = (
                f"the drops disagree on {', '.join(joint[key]['parameters'])} more than their records explain "
                f"(χ² rises by {joint[key]['chi2']:.0f} over {joint[key]['freedom']}); the intervals are "
                f"{joint[key]['widened']:.1f} times as wide for it"
            )
            warnings.append({"code": f"drops-disagree-{key}".lower().replace("_", "-"), "text": text})
    rupture, more = rupture_of(drops)
    return {"series": name, "runs": runs, **rupture, "joint": joint, "warnings": warnings + more}


def _as_json(joint: Any) -> dict[str, Any]:
    return {
        "parameters": {
            name: {"value": p.value, "unit": p.unit, "u": p.u, "lo": p.lo, "hi": p.hi, "verdict": p.verdict}
            for name, p in joint.parameters.items()
        },
        "v_ref": joint.v_ref, "chi2": joint.chi2, "freedom": joint.freedom, "widened": joint.widened,
        "drops": joint.drops, "agree": joint.agree,
    }  # fmt: skip
