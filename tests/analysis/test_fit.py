"""Fits of drops that the emulator's own solver integrates: values, intervals, verdicts, refusals, budget, validity."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.budget import budget
from analysis.conditions import Impact
from analysis.fit import Fit, NotFitted, fit_record
from analysis.fit_answer import to_json
from analysis.fit_intervals import DETERMINED, LOWER, UPPER, parameters, profile_end, spread
from analysis.fit_problem import DAMPER, FLOW, T0
from analysis.fit_profile import elements_of, profile
from analysis.joint import fit_jointly
from analysis.record import Record
from analysis.validity import validity
from sim_device.fall import Motion
from sim_device.settings import Dart, Hang, Rig, Specimen

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "bench"))
from coverage_fits import Drop, drawn

PLATE, REST = "flexed plate", "indentation"


def drop(case: str = PLATE, seed: int = 3, **given: float) -> Drop:
    return drawn(case, np.random.default_rng([11, seed]), **given)


@pytest.mark.parametrize("case", [PLATE, REST, "flexed plate, no C_d"])
def test_intervals_hold_the_truth_and_are_narrow(case: str):
    held, total = 0, 0
    for seed in range(12):
        d = drop(case, seed)
        known = parameters(fit_record(d.record, d.impact))
        for name, truth in d.truth.items():
            p = known[name]
            low, high = -math.inf if p.lo is None else p.lo, math.inf if p.hi is None else p.hi
            held += low <= truth <= high
            total += 1
        assert known["E"].value == pytest.approx(d.truth["E"], rel=0.02)
    assert held / total > 0.86  # 95 % of some 70, less three standard deviations


def test_every_interval_says_what_it_can_tell():
    known = parameters(fit_record(drop("flexed plate, no C_d", 1).record, drop("flexed plate, no C_d", 1).impact))
    assert known["E"].verdict == DETERMINED
    assert known["C_d"].verdict == UPPER
    assert known["C_d"].lo is None
    assert known["C_d"].hi is not None
    d = drop(REST, 1, C=1e9)
    known = parameters(fit_record(d.record, d.impact))
    assert known["C"].verdict == LOWER
    assert known["C"].hi is None
    assert (known["C"].lo or 0) > 1e5


def test_the_profile_agrees_with_the_quadratic_where_that_holds():
    d = drop(PLATE, 5, C=6000.0)
    fit = fit_record(d.record, d.impact)
    u = float(np.sqrt(spread(fit)[FLOW, FLOW]))
    end = profile_end(fit, FLOW, u, 1)
    assert end is not None
    assert (end - fit.best.x[FLOW]) / u == pytest.approx(1.96, abs=0.15)
    values, rise, unit = profile(fit, "C_i")
    assert unit == "Mg/s"
    assert rise.min() == pytest.approx(0, abs=0.05)
    assert values[int(np.argmin(rise))] == pytest.approx(1e-3 / fit.best.x[FLOW], rel=1e-6)


def test_the_budget_is_what_a_new_fit_says():
    d = drop(PLATE, 2)
    fit = fit_record(d.record, d.impact)
    E = math.exp(fit.best.x[0])
    rows = {row.name: row for row in budget(fit)}
    for name in ("thickness", "mass", "nu"):
        changed = replace(d.impact, **{name: 1.01 * getattr(d.impact, name)})
        again = math.exp(fit_record(d.record, changed).best.x[0])
        assert rows[name].sensitivity["E"] == pytest.approx((again / E - 1) / 0.01, abs=0.1)
    louder = fit_record(replace(d.record, force=1.01 * d.record.force, rails=None), d.impact)
    assert rows["gain"].sensitivity["C_d"] == pytest.approx(
        (louder.best.x[DAMPER] - fit.best.x[DAMPER]) / 0.01, rel=0.15
    )


def test_u_total_holds_what_is_known_of_the_inputs():
    d = drop(PLATE, 2)
    answer, _ = to_json(fit_record(d.record, replace(d.impact, u_thickness=2e-5)))
    E = answer["parameters"]["E"]
    thickness = next(row for row in answer["budget"] if row["input"] == "thickness")
    assert thickness["given"]
    assert E["u_total"] == pytest.approx(math.hypot(E["u"], thickness["contribution"]["E"]))
    assert not next(row for row in answer["budget"] if row["input"] == "mass")["given"]


def test_dashpot_beside_and_in_series_are_told_apart():
    d = drop(REST, 4, C=6000.0)
    answer, _ = to_json(fit_record(d.record, d.impact))
    assert answer["compared"]["criterion"] == "BIC"
    assert answer["compared"]["preferred"] == "series"
    other, _ = to_json(fit_record(d.record, d.impact, "parallel"))
    assert other["compared"]["preferred"] == "series"


def test_elements_add_up():
    d = drop(PLATE, 6)
    parts, _ = elements_of(fit_record(d.record, d.impact), 500)
    assert parts["alpha_1"] + parts["alpha_2"] + parts["alpha_3"] == pytest.approx(parts["alpha"], abs=1e-9)


def test_a_saturated_record_is_fitted_in_part_and_says_so():
    d = drop(PLATE, 7)
    limit = 0.8 * float(d.record.force.max())
    clipped = replace(d.record, force=np.minimum(d.record.force, limit), rails=(-limit, limit))
    fit = fit_record(clipped, d.impact)
    answer, cautions = to_json(fit)
    assert "fitted-in-part" in [c.code for c in cautions]
    assert answer["parameters"]["E"]["value"] == pytest.approx(d.truth["E"], rel=0.02)


def test_a_record_that_ends_in_the_contact_is_fitted_in_part():
    d = drop(PLATE, 8)
    n = int((d.truth["t0"] + 2.2e-3) / d.record.dt)
    answer, cautions = to_json(fit_record(replace(d.record, force=d.record.force[:n]), d.impact))
    assert "fitted-in-part" in [c.code for c in cautions]
    assert answer["parameters"]["E"]["value"] == pytest.approx(d.truth["E"], rel=0.03)


def test_a_support_that_gives_slowly_is_no_curve_of_the_model():
    d = drop(PLATE, 9)
    t = np.arange(d.record.force.size) * d.record.dt - d.truth["t0"]
    force = d.record.force * (1 - 0.25 / (1 + np.exp(-(t - 1.2e-3) / 0.15e-3)))
    _, cautions = to_json(fit_record(replace(d.record, force=force), d.impact))
    assert "model-misfit" in [c.code for c in cautions]


@pytest.mark.parametrize(
    ("conditions", "said"),
    [
        ({"nu": 0.6}, "nu has to lie between"),
        ({"thickness": -1e-3}, "thickness has to be above 0"),
        ({"tip_radius": 0.0}, "tip_radius has to be above 0"),
        ({"shape": "lens"}, "shape"),
        ({"v0": None, "u_v0": None}, "speed at contact is not known"),
    ],
)
def test_what_cannot_be_meant_is_refused_by_name(conditions: dict[str, object], said: str):
    d = drop(PLATE, 1)
    with pytest.raises(NotFitted, match=said):
        fit_record(d.record, replace(d.impact, **conditions))


@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_force_in_the_wrong_unit_does_not_close(factor: float):
    d = drop(PLATE, 1)
    with pytest.raises(NotFitted, match="energy does not close"):
        fit_record(Record(d.record.force * factor, d.record.dt, pretrigger=d.record.pretrigger), d.impact)


@pytest.mark.parametrize("kind", ["zeros", "spike", "reversed", "short"])
def test_what_is_no_contact_is_refused(kind: str):
    d = drop(PLATE, 1)
    force = {
        "zeros": np.zeros(5000),
        "spike": np.concatenate((np.zeros(2000), [500.0], np.zeros(2000))),
        "reversed": -d.record.force,
        "short": d.record.force[:1500],
    }[kind]
    with pytest.raises(NotFitted):
        fit_record(Record(force, d.record.dt), d.impact)


def test_the_start_of_contact_is_estimated():
    d = drop(PLATE, 10)
    fit = fit_record(d.record, d.impact)
    assert fit.best.x[T0] == pytest.approx(d.truth["t0"], abs=6e-6)


def test_a_tip_that_yields_is_taken_out_of_E():
    d = drop(REST, 2)
    rigid = parameters(fit_record(d.record, d.impact))["E"].value or 0
    steel = parameters(fit_record(d.record, replace(d.impact, tip_E=210e9)))["E"].value or 0
    assert 1.005 < steel / rigid < 1.025


def test_yield_overhang_and_mass_of_the_plate_are_told():
    d = drop(PLATE, 1)
    fit = fit_record(d.record, replace(d.impact, yield_stress=50e6, diameter=0.07))
    checks, cautions = validity(fit)
    words = {c["check"]: c["word"] for c in checks}
    assert words["contact-pressure"] == "beyond"
    assert words["overhang"] == "beyond"
    assert {"beyond-contact-pressure", "beyond-overhang"} <= {c.code for c in cautions}
    assert next(c for c in checks if c["check"] == "overhang")["value"] == pytest.approx(0.0596, abs=1e-3)


def test_overhang_is_corrected_where_asked():
    d = drop(PLATE, 1)
    impact = replace(d.impact, diameter=0.07)
    plain = parameters(fit_record(d.record, impact))["E"].value or 0
    fit = fit_record(d.record, impact, None, ("overhang",))
    assert (parameters(fit)["E"].value or 0) / plain == pytest.approx(0.945, abs=0.01)
    assert to_json(fit)[0]["corrections"] == ["overhang"]
    assert next(c for c in validity(fit)[0] if c["check"] == "overhang")["word"] == "corrected"


def test_finite_thickness_is_corrected_on_the_emulators_own_layer():
    specimen = Specimen("rigid", 2.3, 0.32, 5.0, C=8000.0, C_d=0.0, finite=True)
    motion = Motion(Rig(specimen=specimen, dart=Dart(0.743), drop=Hang(None, 1.5, catcher=True)))
    t = np.arange(9000) * 1e-6
    noise = 5 * np.random.default_rng(1).standard_normal(t.size)
    record = Record(motion.force(t - 1.5e-3) + noise, 1e-6, pretrigger=1500)
    impact = Impact(0.743, 6.35e-3, 5e-3, 0.32, "rigid", None, v0=1.5, u_v0=0.0075)
    plain = parameters(fit_record(record, impact))["E"].value or 0
    right = parameters(fit_record(record, impact, None, ("finite-thickness",)))["E"].value or 0
    assert plain / 2.3e9 > 1.3
    assert right == pytest.approx(2.3e9, rel=0.01)


def test_corrections_are_refused_where_they_have_no_place():
    d, rest = drop(PLATE, 1), drop(REST, 1)
    with pytest.raises(NotFitted, match="diameter"):
        fit_record(d.record, d.impact, None, ("overhang",))
    with pytest.raises(NotFitted, match="not of a plate"):
        fit_record(d.record, d.impact, None, ("finite-thickness",))
    with pytest.raises(NotFitted, match="overhang is a plate's"):
        fit_record(rest.record, rest.impact, None, ("overhang",))


def test_an_impact_without_uncertainty_of_v0_takes_it_as_exact():
    d = drop(REST, 3)
    fit = fit_record(d.record, replace(d.impact, v0=d.truth["v0"], u_v0=None))
    assert parameters(fit)["v0"].u == 0
    assert parameters(fit)["E"].value == pytest.approx(d.truth["E"], rel=0.02)
    assert isinstance(fit.problem.impact, Impact)


def _joint_drops(n: float, count: int = 6) -> list[Fit]:
    """Indentations of one material, E = 2.3 GPa·(v0/2)^n."""
    fits: list[Fit] = []
    for k in range(count):
        v0 = 1.2 + 0.4 * k
        d = drop(REST, 40 + k, E_GPa=2.3 * (v0 / 2) ** n, C=8000.0, v0=v0)
        fits.append(fit_record(d.record, d.impact))
    return fits


def test_drops_together_tell_more_than_each():
    fits = _joint_drops(0.0)
    joint = fit_jointly(fits, law=False)
    E, single = joint.parameters["E"], parameters(fits[0])["E"]
    assert joint.agree
    assert abs((E.value or 0) - 2.3e9) < 3 * (E.u or 0)
    assert (E.u or 0) < 0.6 * (single.u or 0)
    assert abs((joint.parameters["C"].value or 0) - 8000) < 3 * (joint.parameters["C"].u or 0)


def test_E_over_v0_is_found_and_one_E_is_said_not_to_do():
    fits = _joint_drops(0.1)
    joint = fit_jointly(fits, law=True)
    n = joint.parameters["n"]
    assert abs((n.value or 0) - 0.1) < 3 * (n.u or 0)
    assert n.lo is not None
    assert n.lo > 0.05
    assert joint.agree
    assert not fit_jointly(fits, law=False).agree


def test_a_joint_fit_says_what_it_lacks():
    fits = _joint_drops(0.0, 2)
    with pytest.raises(NotFitted, match="takes 3 fitted drops"):
        fit_jointly(fits, law=True)
    plate = drop(PLATE, 1)
    other = fit_record(plate.record, plate.impact)
    with pytest.raises(NotFitted, match="different models"):
        fit_jointly([*fits, other], law=False)
    with pytest.raises(NotFitted, match="within 5 %"):
        fit_jointly([fits[0], fits[0], fits[0]], law=True)


def test_a_dashpot_beside_the_spring_that_is_not_there_has_an_upper_limit():
    d = drop(REST, 5, C=3e4)  # in series: what a dashpot beside the spring cannot be
    p = parameters(fit_record(d.record, d.impact, "parallel"))["C"]
    assert p.value is not None
    assert p.u is not None
    assert p.u < 1e3
    assert p.hi is None or p.hi < 1e4
