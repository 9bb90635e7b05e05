"""Where the specimens of a series fail, as the answer of the series has it."""

from collections.abc import Sequence
from typing import Any

from analysis.rupture import failure_speed, mean_of, plate_stress
from analysis.staircase import staircase
from analysis.study import transition
from api.drop import Drop


def rupture_of(drops: list[Drop]) -> tuple[dict[str, Any], list[dict[str, str]]]:
    """v0_fail with bracket and interval, rupture load, stress (natural and as published), E_a, E_a′; and warnings."""
    warnings: list[dict[str, str]] = []
    unknown = [drop.run.run for drop in drops if drop.failed is None]
    if unknown:
        text = (
            f"{len(unknown)} of {len(drops)} runs neither rebound nor fail for sure and are left out of v0_fail: "
            f"{', '.join(unknown)}; "
            "say what is seen on the specimen by `droptower correct RUN --set measured.failed=true`"
        )
        warnings.append({"code": "outcome-unknown", "text": text})
    known = [(drop, drop.failed is True) for drop in drops if drop.failed is not None and drop.value("v0")]
    speeds = [(drop.value("v0") or 0.0, failed) for drop, failed in known]
    survived = [v for v, failed in speeds if not failed]
    lost = [drop for drop, failed in known if failed]
    answer: dict[str, Any] = {
        "v0_fail": None, "v0_survived_max": _speed(max(survived, default=None)),
        "v0_failed_min": _speed(min((v for v, failed in speeds if failed), default=None)),
        "F_rupture": _mean([drop.value("F_failure") for drop in lost], "N"),
        "sigma_r": None, "sigma_r_as_published": None, "E_a": None,
        "E_a_prime": _mean([drop.value("E_failure") for drop in lost], "J"),
    }  # fmt: skip
    answer["staircase"] = _staircase(known)
    limit = failure_speed([v for v, _ in speeds], [failed for _, failed in speeds]) if speeds else None
    if limit is not None:
        answer["v0_fail"] = {"value": limit.value, "unit": "m/s", "lo": limit.lo, "hi": limit.hi}
        masses = {drop.run.test.dart.mass_kg for drop, _ in known}
        if len(masses) == 1:
            m = masses.pop()
            ends = {end: None if v is None else 0.5 * m * v**2 for end, v in (("lo", limit.lo), ("hi", limit.hi))}
            answer["E_a"] = {"value": 0.5 * m * limit.value**2, "unit": "J", **ends}
        else:
            text = "the drops have several masses, so that one failure speed is no one energy: E_a is not given"
            warnings.append({"code": "several-masses", "text": text})
    for key, as_published in (("sigma_r", False), ("sigma_r_as_published", True)):
        answer[key] = _mean([_stress(drop, as_published) for drop in lost], "Pa")
    answer["transition"] = _transition([drop for drop, _ in known])
    answer["plate_checks"] = _plate_checks(lost)
    return answer, warnings


def _transition(drops: list[Drop]) -> dict[str, Any] | None:
    """Where the load begins to last shorter, without a word on which drops failed: P1's way to v0_fail."""
    told = [(v, t, F) for d in drops if (v := d.value("v0")) and (t := d.load_lasts) and (F := d.value("F_M"))]
    found = transition([v for v, _, _ in told], [t for _, t, _ in told])
    if found is None:
        return None
    above = [F for v, _, F in told if v >= found.hi]
    return {
        "v0_lo": _speed(found.lo), "v0_hi": _speed(found.hi), "t_c_before": {"value": found.before, "unit": "s"},
        "t_c_after": {"value": found.after, "unit": "s"}, "ratio": found.ratio, "F_M_after": _mean(above, "N"),
    }  # fmt: skip


def _plate_checks(lost: list[Drop]) -> list[dict[str, Any]]:
    """The checks of plate theory at failure, each at its worst over the drops that failed."""
    worst: dict[str, dict[str, Any]] = {}
    for drop in lost:
        for row in (drop.answer["fit"] or {}).get("validity", []):
            if row["check"] in ("thin-plate", "deflection") and row["value"] is not None:
                before = worst.get(row["check"])
                worst[row["check"]] = row if before is None or row["value"] > before["value"] else before
    return list(worst.values())


def _staircase(known: list[tuple[Drop, bool]]) -> dict[str, Any] | None:
    """Mean failure energy by the up-and-down method, where heights of one mass make a ladder; else None."""
    heights = [drop.run.test.drop.height_mm for drop, _ in known]
    masses = {drop.run.test.dart.mass_kg for drop, _ in known}
    if len(masses) != 1 or any(h is None for h in heights):
        return None
    found = staircase([float(h or 0) for h in heights], [failed for _, failed in known])
    if found is None:
        return None
    per_mm = masses.pop() * known[0][0].run.g * 1e-3

    def joules(height: float | None) -> float | None:
        return None if height is None else height * per_mm

    return {
        "E_50": {"value": joules(found.mean), "unit": "J", "u": joules(found.u)},
        "deviation": {"value": joules(found.deviation), "unit": "J"},
        "height_mm": found.mean, "next_height_mm": found.following, "step_mm": found.step, "drops": found.drops,
    }  # fmt: skip


def _stress(drop: Drop, as_published: bool) -> float | None:
    test, F = drop.run.test, drop.value("F_failure")
    if F is None or test.support.kind != "ring" or test.support.radius_mm is None or test.specimen.shape != "plate":
        return None
    d, R = test.specimen.thickness_mm * 1e-3, test.support.radius_mm * 1e-3
    return plate_stress(F, d, R, test.specimen.nu, as_published=as_published)


def _speed(v: float | None) -> dict[str, Any] | None:
    return None if v is None else {"value": v, "unit": "m/s"}


def _mean(values: Sequence[float | None], unit: str) -> dict[str, Any] | None:
    known = [v for v in values if v is not None]
    if not known:
        return None
    mean, spread, u = mean_of(known)
    return {"value": mean, "unit": unit, "u": u, "spread": spread, "n": len(known)}
