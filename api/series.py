"""A series of runs: each fitted, and all together."""

from collections.abc import Callable
from typing import Any

from analysis.fit import Fit, NotFitted
from analysis.joint import fit_jointly
from analysis.study import exponents, outliers
from api import groups
from api.answer import answer_of
from api.drop import Drop
from api.rupture import rupture_of
from daq.catalog import Catalog
from daq.errors import SeriesNotFound
from daq.store import Store

MOST = 10_000
OF_FINDINGS = (
    "v0", "F_M", "t_M", "t_c", "alpha_M", "alpha_r", "eps_exact", "E_diss", "failed", "failure_kind", "failure_type",
    "failure_type_operator", "t_failure", "F_failure", "alpha_failure", "E_failure", "confidence",
)  # fmt: skip
OF_A_RUN = ("E", "C_i", "C_d", "C")
MARKED = ("F_M", "t_c", "eps_exact", "E")
"""Looked at for values that lie off the others of their group."""


def drops_of(store: Store, name: str, progress: Callable[[int, int], None] | None = None) -> list[Drop]:
    """The drops of a series, oldest first, each with its answer; `progress` is told how many of how many are read.

    Raises
    ------
    SeriesNotFound : no run is in a series of that name.
    """
    rows = [row for row in Catalog(store).runs({"series": name}, limit=MOST) if row.fault is None]
    if not rows:
        known = sorted({row.series for row in Catalog(store).runs(limit=MOST) if row.series})
        hint = f"; it has {', '.join(map(repr, known))}" if known else ""
        raise SeriesNotFound(f"{store.folder} holds no run of a series {name!r}{hint}")
    drops: list[Drop] = []
    for done, row in enumerate(rows, 1):
        drops.append(Drop(store.read(row.run), answer_of(store, row.run)))
        if progress is not None:
            progress(done, len(rows))
    return sorted(drops, key=lambda drop: (drop.run.started, drop.run.run))


def series_of(name: str, drops: list[Drop]) -> dict[str, Any]:
    """What the drops of a series say: each alone, by groups, over what varies, where they fail, and fitted together."""
    joint, warnings = _joint(drops)
    rupture, more = rupture_of(drops)
    rows, members = groups.groups_of(drops)
    marks = _outliers(members)
    if marks:
        text = "; ".join(f"{drop.run.run}: {', '.join(symbols)}" for drop, symbols in marks)
        text = f"{text} lie off the other drops of their group; they are marked and counted all the same"
        more.append({"code": "outliers", "text": text})
    marked = {drop.run.run: symbols for drop, symbols in marks}
    return {
        "series": name, "runs": [_row(drop, marked.get(drop.run.run, [])) for drop in drops], **rupture,
        "groups": rows, "comparisons": groups.compared(rows, members), "dependence": _dependence(drops),
        "thickness": groups.by_thickness(rows, members), "stacks": groups.stacks(rows, members),
        "ranking": groups.ranking(drops), "joint": joint, "warnings": warnings + more,
    }  # fmt: skip


def _row(drop: Drop, marked: list[str]) -> dict[str, Any]:
    answer, test = drop.answer, drop.run.test
    known = {} if answer["fit"] is None else answer["fit"]["parameters"]
    return {
        "run": drop.run.run, "specimen": test.specimen.id, "material": test.specimen.material,
        **{symbol: answer["findings"][symbol] for symbol in OF_FINDINGS if symbol in answer["findings"]},
        "failed": {**answer["findings"]["failed"], "operator": test.measured.failed, "counted": drop.failed},
        "fit": {name: known[name] for name in OF_A_RUN if name in known},
        "outlier": marked, "warnings": [w["code"] for w in answer["warnings"]],
    }  # fmt: skip


def _joint(drops: list[Drop]) -> tuple[dict[str, Any], list[dict[str, str]]]:
    """One E, and E over v0, for all drops that did not fail, of one material."""
    warnings: list[dict[str, str]] = []
    joint: dict[str, Any] = {"one_E": None, "E_over_v0": None}
    materials = {drop.run.test.specimen.material for drop in drops}
    if len(materials) > 1:
        text = (
            f"{len(materials)} materials have no E and no v0_fail in common: there is no joint fit, and what is said "
            "of failure is over all of them; `groups` has both of each"
        )
        return joint, [{"code": "several-materials", "text": text}]
    fits: list[Fit] = []
    for drop in drops:
        if drop.failed is True:
            continue  # what is left of its record is no equal of the others
        if "restitution-impossible" in [w["code"] for w in drop.answer["warnings"]]:
            text = f"{drop.run.run} gives back more than it got: it is left out of the joint fit"
            warnings.append({"code": "left-out", "text": text})
            continue
        if isinstance(drop.fit, NotFitted):
            warnings.append({"code": "not-fitted", "text": f"{drop.run.run}: {drop.fit}"})
        else:
            fits.append(drop.fit)
    for key, law in (("one_E", False), ("E_over_v0", True)):
        try:
            joint[key] = _as_json(fit_jointly(fits, law))
        except NotFitted as e:
            warnings.append({"code": f"no-joint-fit-{key}".lower().replace("_", "-"), "text": str(e)})
            continue
        if not joint[key]["agree"]:
            text = (
                f"the drops disagree on {', '.join(joint[key]['parameters'])} more than their records explain "
                f"(χ² rises by {joint[key]['chi2']:.0f} over {joint[key]['freedom']}); the intervals are "
                f"{joint[key]['widened']:.1f} times as wide for it"
            )
            warnings.append({"code": f"drops-disagree-{key}".lower().replace("_", "-"), "text": text})
    return joint, warnings


def _dependence(drops: list[Drop]) -> dict[str, Any]:
    """Exponents of E over what varies: v0, thickness, mass, tip radius. P2: it must not depend on the last two."""
    told = [d for d in drops if d.failed is not True and d.value("E") and d.value("v0")]
    if not told:
        return {}
    materials = sorted({d.run.test.specimen.material or "" for d in told})
    over = {
        "v0": [d.value("v0") or 0.0 for d in told], "thickness": [d.total_mm for d in told],
        "mass": [d.run.test.dart.mass_kg for d in told],
        "tip_radius": [d.run.test.dart.tip_radius_mm for d in told],
    }  # fmt: skip
    group = [materials.index(d.run.test.specimen.material or "") for d in told]
    found = exponents([d.value("E") or 0.0 for d in told], over, group)
    return {
        name: {
            "exponent": e.value, "lo": e.lo, "hi": e.hi,
            "text": "E depends on it" if e.lo > 0 or e.hi < 0 else "no dependence seen",
        }
        for name, e in found.items()
    }  # fmt: skip


def _outliers(members: list[list[Drop]]) -> list[tuple[Drop, list[str]]]:
    """Drops that lie off the others of their group, and in what."""
    marks: dict[str, tuple[Drop, list[str]]] = {}
    for some in members:
        whole = [d for d in some if d.failed is not True and d.value("v0")]
        for symbol in MARKED:
            told = [d for d in whole if d.value(symbol) is not None]
            places = outliers([d.value("v0") or 0.0 for d in told], [d.value(symbol) or 0.0 for d in told])
            for k in places:
                marks.setdefault(told[k].run.run, (told[k], []))[1].append(symbol)
    return list(marks.values())


def _as_json(joint: Any) -> dict[str, Any]:
    return {
        "parameters": {
            name: {"value": p.value, "unit": p.unit, "u": p.u, "lo": p.lo, "hi": p.hi, "verdict": p.verdict}
            for name, p in joint.parameters.items()
        },
        "v_ref": joint.v_ref, "chi2": joint.chi2, "freedom": joint.freedom, "widened": joint.widened,
        "drops": joint.drops, "agree": joint.agree,
    }  # fmt: skip
