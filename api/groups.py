"""The drops of a series by what they were made with: means, ratios, thickness and stacks, a ranking."""

from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Any

from analysis.study import Interval, Logs, mean, ratio, ratio_at
from analysis.thickness import MARGIN, POWERS, curves_same, thickness_threshold
from api.drop import Drop
from api.rupture import rupture_of

UNITS = {
    "F_M": "N", "t_M": "s", "t_c": "s", "alpha_M": "m", "alpha_r": "m", "eps_exact": "1", "E_diss": "J",
    "E": "Pa", "C_i": "kg/s", "C_d": "kg/s", "C": "kg/s", "F_failure": "N", "E_failure": "J",
}  # fmt: skip
OF_RUPTURE = ("v0_fail", "E_a")
_NEAR = 0.03
"""Sizes within it are one nominal size."""


def _clusters(values: Sequence[float]) -> Callable[[float], float]:
    """From a size to its nominal size: the middle of those that are next to each other."""
    nominal: list[list[float]] = []
    for value in sorted(set(values)):
        if nominal and value <= nominal[-1][-1] * (1 + _NEAR):
            nominal[-1].append(value)
        else:
            nominal.append([value])
    middles = {value: round(sum(c) / len(c), 6) for c in nominal for value in c}
    return lambda value: middles[value]


def keys_of(drops: list[Drop]) -> list[dict[str, Any]]:
    """For each drop what tells its group from the others: those of material, shape, sizes and masses that vary."""
    tests = [drop.run.test for drop in drops]
    thickness = _clusters([drop.total_mm for drop in drops])
    mass, tip = _clusters([t.dart.mass_kg for t in tests]), _clusters([t.dart.tip_radius_mm for t in tests])
    every = [
        {
            "material": t.specimen.material, "shape": t.specimen.shape, "thickness_mm": thickness(drop.total_mm),
            "stack": None if not t.specimen.stack_mm else len(t.specimen.stack_mm),
            "mass_kg": mass(t.dart.mass_kg), "tip_radius_mm": tip(t.dart.tip_radius_mm), "support": t.support.kind,
        }
        for drop, t in zip(drops, tests, strict=True)
    ]  # fmt: skip
    varying = [key for key in every[0] if len({row[key] for row in every}) > 1]
    return [{key: row[key] for key in varying} for row in every]


def name_of(key: dict[str, Any]) -> str:
    """A group in words: what it has of its own."""
    units = {"thickness_mm": " mm", "mass_kg": " kg", "tip_radius_mm": " mm tip"}
    words = [
        f"stack of {value}" if name == "stack" else f"{value:g}{units[name]}" if name in units else str(value)
        for name, value in key.items() if value is not None
    ]  # fmt: skip
    return ", ".join(words) or "all drops"


def groups_of(drops: list[Drop]) -> tuple[list[dict[str, Any]], list[list[Drop]]]:
    """The groups as JSON, and the drops of each."""
    keys = keys_of(drops)
    members: dict[str, list[Drop]] = {}
    by: dict[str, dict[str, Any]] = {}
    for drop, key in zip(drops, keys, strict=True):
        members.setdefault(name_of(key), []).append(drop)
        by[name_of(key)] = key
    rows: list[dict[str, Any]] = []
    for name, some in members.items():
        speeds = [v for drop in some if (v := drop.value("v0")) is not None]
        rupture, _ = rupture_of(some)
        rows.append(
            {
                "name": name, "by": by[name], "drops": len(some), "failed": sum(drop.failed is True for drop in some),
                "v0": None if not speeds else {"min": min(speeds), "max": max(speeds), "unit": "m/s"},
                "means": {s: m for s, unit in UNITS.items() if (m := _mean(values_of(some, s), unit)) is not None},
                **{key: rupture[key] for key in ("v0_fail", "F_rupture", "sigma_r", "E_a", "E_a_prime")},
                "runs": [drop.run.run for drop in some],
            }
        )  # fmt: skip
    return rows, list(members.values())


def _over_v0(drops: list[Drop], symbol: str) -> tuple[list[float], list[float]]:
    """``values_of`` with the speeds they belong to."""
    told = [(y, v) for d in drops if (v := d.value("v0")) is not None for y in values_of([d], symbol)]
    return [y for y, _ in told], [v for _, v in told]


def values_of(drops: list[Drop], symbol: str) -> list[float]:
    """What is known of ``symbol``; of the peak and of E only from specimens that did not fail."""
    wanted = symbol.endswith("_failure")
    return [v for d in drops if (d.failed is True) == wanted and (v := d.value(symbol)) is not None]


def _mean(values: list[float], unit: str) -> dict[str, Any] | None:
    if not values:
        return None
    found = mean(values)
    ends = {"lo": None, "hi": None} if found is None else {"lo": found.lo, "hi": found.hi}
    return {"value": sum(values) / len(values), "unit": unit, **ends, "n": len(values)}


def compared(rows: list[dict[str, Any]], members: list[list[Drop]]) -> list[dict[str, Any]]:
    """Every pair of groups: ratios at the same v0 with their 95 % intervals, in words as well."""
    pairs: list[dict[str, Any]] = []
    for i, j in combinations(range(len(rows)), 2):
        ratios: dict[str, Any] = {}
        for symbol in UNITS:
            (a, at_a), (b, at_b) = (_over_v0(members[k], symbol) for k in (j, i))
            found = ratio_at(a, at_a, b, at_b) if a and b else None
            if found is not None:
                ratios[symbol] = _ratio(found)
        for symbol in OF_RUPTURE:
            ends = [rows[k][symbol] for k in (j, i)]
            if all(e is not None and e["lo"] and e["hi"] for e in ends):
                one, other = (Logs.between(e["value"], e["lo"], e["hi"]) for e in ends)
                ratios[symbol] = _ratio(ratio(one, other))
        if ratios:
            pairs.append({"group": rows[j]["name"], "against": rows[i]["name"], "ratios": ratios})
    return pairs


def _ratio(found: Interval) -> dict[str, Any]:
    percent = 100 * (found.value - 1)
    sure = found.lo > 1 or found.hi < 1
    text = f"{abs(percent):.0f} % {'larger' if percent > 0 else 'smaller'}" if sure else "no difference seen"
    return {"value": found.value, "lo": found.lo, "hi": found.hi, "unit": "1", "text": text}


def by_thickness(rows: list[dict[str, Any]], members: list[list[Drop]]) -> dict[str, Any] | None:
    """From which thickness on F(t) stays the same, among the most drops that differ in nothing else; None: too few."""
    alike: dict[str, dict[float, list[dict[str, float]]]] = {}
    for row, some in zip(rows, members, strict=True):
        others = {k: v for k, v in row["by"].items() if k != "thickness_mm"}
        if "thickness_mm" in row["by"] and not others.pop("stack", None):
            alike.setdefault(repr(others), {})[row["by"]["thickness_mm"] * 1e-3] = curves(some)
    found = thickness_threshold(max(alike.values(), key=len, default={}))
    if found is None:
        return None
    told = [
        {"thickness": r.thickness, "ratios": {s: _ends(i) for s, i in r.ratios.items()}, "same": r.same}
        for r in found.rows
    ]
    return {
        "value": found.thickness, "unit": "m", "against": found.thickest, "margin": MARGIN, "rows": told,
        "test": f"F_M and t_c each within {MARGIN:.0%} of the thickest, two one-sided tests at 5 %",
    }  # fmt: skip


def curves(drops: list[Drop]) -> list[dict[str, float]]:
    """v0, F_M and t_c of the drops that are whole."""
    wanted = ("v0", *POWERS)
    rows = [{s: d.value(s) for s in wanted} for d in drops if d.failed is not True]
    return [{s: v for s, v in row.items() if v is not None} for row in rows if None not in row.values()]


def stacks(rows: list[dict[str, Any]], members: list[list[Drop]]) -> list[dict[str, Any]]:
    """Each stack of plates against the one plate that is as thick, all else alike."""
    told: list[dict[str, Any]] = []
    for row, some in zip(rows, members, strict=True):
        if row["by"].get("stack") is None:
            continue
        for other, single in zip(rows, members, strict=True):
            if other["by"] == {**row["by"], "stack": None}:
                found = curves_same(curves(some), curves(single))
                if found is not None:
                    ratios = {s: _ends(i) for s, i in found[0].items()}
                    told.append({"stack": row["name"], "plate": other["name"], "ratios": ratios, "same": found[1]})
    return told


def _ends(found: Interval) -> dict[str, Any]:
    return {"value": found.value, "lo": found.lo, "hi": found.hi, "unit": "1"}


def ranking(drops: list[Drop]) -> dict[str, Any] | None:
    """Materials by the energy they bear (P1, lenses): E_a where every one has it, else E_a′, else what they return."""
    materials: dict[str, list[Drop]] = {}
    for drop in drops:
        materials.setdefault(drop.run.test.specimen.material or "not named", []).append(drop)
    if len(materials) < 2:
        return None
    rows: list[dict[str, Any]] = []
    for name, some in materials.items():
        rupture, _ = rupture_of(some)
        stiff = [F / a for d in some if d.failed is not True and (F := d.value("F_M")) and (a := d.value("alpha_M"))]
        back = [e * e for d in some if d.failed is not True and (e := d.value("eps_exact"))]
        rows.append(
            {
                "material": name, "drops": len(some), "failed": sum(d.failed is True for d in some),
                "E_a": rupture["E_a"], "E_a_prime": rupture["E_a_prime"], "F_rupture": rupture["F_rupture"],
                "stiffness": _mean(stiff, "N/m"), "returned": _mean(back, "1"),
            }
        )  # fmt: skip
    key = next((k for k in ("E_a", "E_a_prime", "returned") if all(row[k] is not None for row in rows)), None)
    if key is None:
        return None
    return {"by": key, "rows": sorted(rows, key=lambda row: -row[key]["value"])}
