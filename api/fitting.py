"""The fit of a run as part of its answer, beside what was measured otherwise."""

import math
import threading
from typing import TYPE_CHECKING, Any

from analysis import Impact, Record
from analysis.fit_problem import Corrected
from analysis.models import Kind
from api.join import impact_of, record_of
from daq.run import RunData
from daq.test_file import TestFile

if TYPE_CHECKING:
    from analysis.fit import Fit


def warm() -> None:
    """Load what a fit needs, in the background: the operator does not wait for it at the first drop."""

    def load() -> None:
        from analysis.fit_problem import kernel

        kernel()

    threading.Thread(target=load, name="kernel", daemon=True).start()


def fit_of(run: RunData, kind: Kind | None = None, corrections: tuple[Corrected, ...] = ()) -> "Fit":
    """The fit of a run, for figures.

    Raises
    ------
    NotFitted : says why there is none.
    """
    from analysis.fit import fit_record

    return fit_record(record_of(run)[0], impact_of(run), kind, corrections)


def fitted(
    record: Record,
    impact: Impact,
    test: TestFile,
    shift: float,
    kind: Kind | None = None,
    corrections: tuple[Corrected, ...] = (),
) -> tuple[dict[str, Any] | None, dict[str, Any], list[dict[str, str]]]:
    """The ``fit`` of an answer (None: why is in the warnings), findings that come of it, and warnings.

    shift : s, of the record's first sample on the run's own axis; kind : another model than the support's
    """
    from analysis.fit import NotFitted, fit_record
    from analysis.fit_answer import to_json
    from analysis.validity import validity

    try:
        fit = fit_record(record, impact, kind, corrections)
    except NotFitted as e:
        return None, {}, [{"code": "not-fitted", "text": str(e)}]
    answer, cautions = to_json(fit)
    warnings = [{"code": c.code, "text": c.text} for c in cautions]
    t0 = answer["parameters"]["t0"]
    for key in ("value", "lo", "hi"):
        t0[key] += shift
    findings: dict[str, Any] = {}
    permanent = answer.pop("alpha_perm")
    if permanent is not None:
        findings = _marks(permanent, impact.tip_radius)
    checked, cautions = validity(fit)
    answer["validity"] = checked
    warnings += [{"code": c.code, "text": c.text} for c in cautions]
    answer["measured"] = _beside(answer, findings, test)
    mark = test.measured.imprint_diameter_mm
    if answer["compared"] is not None and mark is not None:
        # A dashpot beside the spring leaves no mark (P2); one in series does.
        answer["compared"]["by_the_mark"] = "series" if mark > 0 else "parallel"
    return answer, findings, warnings


def _marks(permanent: dict[str, float | None], radius: float) -> dict[str, Any]:
    """α_perm = J/C and the mark 2√(2·r·α_perm) that it leaves (P2)."""
    value, u = permanent["value"], permanent["u"]
    assert value is not None, "J/C is 0 at the least"
    mark = 2 * math.sqrt(2 * radius * value)
    u_mark = None if u is None or value <= 0 else mark * u / (2 * value)
    return {
        "alpha_perm": {"value": value, "unit": "m", "u": u},
        "mark_diameter": {"value": mark, "unit": "m", "u": u_mark},
    }


def _beside(answer: dict[str, Any], findings: dict[str, Any], test: TestFile) -> list[dict[str, Any]]:
    """What the model says beside what the test file has from elsewhere."""
    rows: list[dict[str, Any]] = []
    E = answer["parameters"]["E"]["value"]
    static = test.specimen.E_static_GPa
    if static is not None:
        text = "at the strain rate of the impact a polymer is stiffer than in a tensile test"
        rows.append(_row("E", "E_static_GPa", E, static * 1e9, "Pa", text))
    diameter, depth = test.measured.imprint_diameter_mm, test.measured.imprint_depth_um
    if "mark_diameter" in findings and diameter is not None:
        text = "the mark at the end of contact; its rim recovers little"
        mark = findings["mark_diameter"]["value"]
        rows.append(_row("mark_diameter", "imprint_diameter_mm", mark, diameter * 1e-3, "m", text))
    if "alpha_perm" in findings and depth is not None:
        text = "not the same thing: the bottom of a mark recovers, after a day some hundred times (P2)"
        rows.append(_row("alpha_perm", "imprint_depth_um", findings["alpha_perm"]["value"], depth * 1e-6, "m", text))
    return rows


def _row(symbol: str, key: str, model: float, measured: float, unit: str, text: str) -> dict[str, Any]:
    ratio = model / measured if measured else None
    return {
        "symbol": symbol, "key": key, "model": model, "measured": measured, "unit": unit, "ratio": ratio, "text": text
    }  # fmt: skip
