"""The answer of a run: its findings as JSON, made once and kept beside it."""

from importlib.metadata import version
from typing import Any

from analysis import Impact, Kinematics, Record, analyze, kinematics
from analysis.findings import UNITS
from analysis.fit_problem import Corrected
from analysis.models import Kind
from api.fitting import fitted
from api.join import impact_of, record_of
from daq.errors import StoreError
from daq.run import RunData
from daq.store import Store

ON_THE_RECORDS_AXIS = ("t_contact", "t_second")


def answer_of(store: Store, run: str) -> dict[str, Any]:
    """The newest answer if this version made it from the raw file and test as they are; otherwise a new one, stored.

    Raises
    ------
    RunNotFound : no such run.
    StoreError : its file is damaged.
    """
    made_by = {
        "droptower": version("droptower"), "raw_sha256": store.sha256(run),
        "corrections": [path.name for path in store.corrections(run)],
    }  # fmt: skip
    kept = store.analysis(run)
    if kept is not None and {k: kept.get(k) for k in made_by} == made_by:
        return kept
    answer = {**analysed(store.read(run)), **made_by}
    try:
        store.add_analysis(run, answer)
    except StoreError as e:
        text = f"{e}; the answer is not kept beside its run"
        return {**answer, "warnings": [*answer["warnings"], {"code": "answer-not-kept", "text": text}]}
    return answer


def analysed(
    run: RunData, model: Kind | None = None, corrections: tuple[Corrected, ...] = (), fit: bool = True
) -> dict[str, Any]:
    """What the record of a run says; a failure of the analysis is a warning in it.

    model : another than the support's; corrections : of it; fit : False leaves the model out
    """
    by_model: dict[str, Any] | None = None
    try:
        record, first = record_of(run)
        impact = impact_of(run)
        found: dict[str, Any] = analyze(record, impact).to_json()
        for symbol in ON_THE_RECORDS_AXIS:
            if found["findings"][symbol]["value"] is not None:
                found["findings"][symbol]["value"] += first * run.dt
        if fit:
            by_model = _with_model(found, record, impact, run, first, (model, corrections))
    except Exception as e:  # a run is never dropped because its analysis failed: the answer says that it did
        text = f"the analysis failed ({type(e).__name__}: {e}); the record is safe"
        found = {
            "findings": {s: {"value": None, "unit": unit, "u": None} for s, unit in UNITS.items()},
            "warnings": [{"code": "analysis-failed", "text": text}],
        }
    if run.missing:
        text = (
            f"{run.missing} samples could not be had; the findings are those of the stretch around the greatest force"
        )
        found["warnings"].insert(0, {"code": "partial-record", "text": text})
    found["warnings"] += run.provenance.get("told", [])
    seen = run.test.measured.failure_type
    found["findings"]["failure_type_operator"] = {"value": seen, "unit": "1", "u": None}
    settings = {"g": run.g, "g_source": run.g_source}
    return {
        "run": run.run, "series": run.series, "findings": found["findings"], "fit": by_model,
        "warnings": found["warnings"], "settings": settings,
    }  # fmt: skip


def _with_model(
    found: dict[str, Any],
    record: Record,
    impact: Impact,
    run: RunData,
    first: int,
    how: tuple[Kind | None, tuple[Corrected, ...]],
) -> dict[str, Any] | None:
    """The fit; what comes of it is put into ``found``."""
    try:
        fit, findings, warnings = fitted(record, impact, run.test, first * run.dt, *how)
    except Exception as e:  # as above
        text = f"the fit failed ({type(e).__name__}: {e}); the findings without a model stand"
        found["warnings"].append({"code": "fit-failed", "text": text})
        return None
    found["findings"] |= findings
    found["warnings"] += warnings
    return fit


def kinematics_of(run: RunData) -> Kinematics:
    """Force, speed, displacement and energy over the contact of a run; empty where it has none."""
    return kinematics(record_of(run)[0], impact_of(run))
