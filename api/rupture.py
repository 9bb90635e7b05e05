"""Where the specimens of a series fail, as the answer of the series has it."""

from typing import Any

from analysis.rupture import failure_speed, mean_of, plate_stress
from analysis.staircase import staircase
from daq.run import RunData

Drop = tuple[RunData, dict[str, Any]]
"""A run, and its findings."""


def rupture_of(drops: list[Drop]) -> tuple[dict[str, Any], list[dict[str, str]]]:
    """v0_fail with bracket and interval, rupture load, stress (natural and as published), E_a, E_a′; and warnings."""
    warnings: list[dict[str, str]] = []
    told = [(run, found, _failed(found)) for run, found in drops]
    unknown = [run.run for run, _, failed in told if failed is None]
    if unknown:
        text = (
            f"{len(unknown)} runs neither rebound nor fail for sure and are left out of v0_fail: {', '.join(unknown)}"
        )
        warnings.append({"code": "outcome-unknown", "text": text})
    known = [(run, found, failed) for run, found, failed in told if failed is not None and _value(found, "v0")]
    speeds = [(float(found["v0"]["value"]), bool(failed)) for _, found, failed in known]
    survived = [v for v, failed in speeds if not failed]
    lost = [(run, found) for run, found, failed in known if failed]
    answer: dict[str, Any] = {
        "v0_fail": None, "v0_survived_max": _speed(max(survived, default=None)),
        "v0_failed_min": _speed(min((v for v, failed in speeds if failed), default=None)),
        "F_rupture": _mean([found["F_failure"]["value"] for _, found in lost], "N"),
        "sigma_r": None, "sigma_r_as_published": None, "E_a": None,
        "E_a_prime": _mean([found["E_failure"]["value"] for _, found in lost], "J"),
    }  # fmt: skip
    answer["staircase"] = _staircase(known)
    limit = failure_speed([v for v, _ in speeds], [failed for _, failed in speeds]) if speeds else None
    if limit is not None:
        answer["v0_fail"] = {"value": limit.value, "unit": "m/s", "lo": limit.lo, "hi": limit.hi}
        masses = {run.test.dart.mass_kg for run, _, _ in known}
        if len(masses) == 1:
            m = masses.pop()
            ends = {end: None if v is None else 0.5 * m * v**2 for end, v in (("lo", limit.lo), ("hi", limit.hi))}
            answer["E_a"] = {"value": 0.5 * m * limit.value**2, "unit": "J", **ends}
        else:
            text = "the drops have several masses, so that one failure speed is no one energy: E_a is not given"
            warnings.append({"code": "several-masses", "text": text})
    for key, as_published in (("sigma_r", False), ("sigma_r_as_published", True)):
        answer[key] = _mean([s for run, found in lost if (s := _stress(run, found, as_published)) is not None], "Pa")
    return answer, warnings


def _staircase(known: list[tuple[RunData, dict[str, Any], bool]]) -> dict[str, Any] | None:
    """Mean failure energy by the up-and-down method, where heights of one mass make a ladder; else None."""
    heights = [run.test.drop.height_mm for run, _, _ in known]
    masses = {run.test.dart.mass_kg for run, _, _ in known}
    if len(masses) != 1 or any(h is None for h in heights):
        return None
    found = staircase([float(h or 0) for h in heights], [failed for _, _, failed in known])
    if found is None:
        return None
    per_mm = masses.pop() * known[0][0].g * 1e-3

    def joules(height: float | None) -> float | None:
        return None if height is None else height * per_mm

    return {
        "E_50": {"value": joules(found.mean), "unit": "J", "u": joules(found.u)},
        "deviation": {"value": joules(found.deviation), "unit": "J"},
        "height_mm": found.mean, "next_height_mm": found.following, "step_mm": found.step, "drops": found.drops,
    }  # fmt: skip


def _value(found: dict[str, Any], symbol: str) -> Any:
    return found[symbol]["value"]


def _failed(found: dict[str, Any]) -> bool | None:
    """True or False; None where the record tells neither a failure nor a rebound."""
    if _value(found, "failed") is True:
        return True
    eps = _value(found, "eps_exact")
    return False if eps is not None and 0 < eps <= 1.05 else None


def _stress(run: RunData, found: dict[str, Any], as_published: bool) -> float | None:
    test = run.test
    if test.support.kind != "ring" or test.support.radius_mm is None or test.specimen.shape != "plate":
        return None
    d, R = test.specimen.thickness_mm * 1e-3, test.support.radius_mm * 1e-3
    return plate_stress(found["F_failure"]["value"], d, R, test.specimen.nu, as_published=as_published)


def _speed(v: float | None) -> dict[str, Any] | None:
    return None if v is None else {"value": v, "unit": "m/s"}


def _mean(values: list[float], unit: str) -> dict[str, Any] | None:
    if not values:
        return None
    mean, spread, u = mean_of(values)
    return {"value": mean, "unit": unit, "u": u, "spread": spread, "n": len(values)}
