"""Complete failure in one record, against the emulator's truth; and what is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis import Findings, Impact, Record, analyze
from analysis.fit import fit_record
from analysis.fit_intervals import parameters
from sim_device.fall import Motion
from sim_device.sensors import signal, white
from sim_device.settings import Hang, Rig, Sensor, Specimen

BEFORE, DT, N = 1.5e-3, 1e-6, 9000
IMPACT = Impact(0.503, 6.35e-3, 4.6e-3, 0.3, "ring", 0.03, v0=2.0, u_v0=0.01)


def drop(fail_N: float | None, ringing: float = 0.02, noise: float = 8.0, v0: float = 2.0) -> tuple[Record, Motion]:
    """A record of a plate that rings, and its truth."""
    rig = Rig(
        specimen=Specimen(fail_N=fail_N), drop=Hang(None, v0, catcher=True),
        sensor=Sensor(noise_N=noise, ringing=ringing, ringing_Hz=8000.0),
    )  # fmt: skip
    motion = Motion(rig)
    force = signal(rig, motion, 0, -BEFORE, DT, N) + noise * white((7,), 0, N)
    return Record(force, DT, pretrigger=int(BEFORE / DT)), motion


def number(found: Findings, symbol: str) -> float:
    value = found.values[symbol].value
    assert isinstance(value, float)
    return value


@pytest.mark.parametrize(
    ("load", "ringing"),
    [(250.0, 0.0), (250.0, 0.02), (500.0, 0.0), (500.0, 0.02), (500.0, 0.05), (800.0, 0.05), (1000.0, 0.05)],
)
def test_a_complete_failure_is_found_where_it_was(load: float, ringing: float):
    record, motion = drop(load, ringing)
    found = analyze(record, IMPACT)
    truth = motion.truth()
    assert found.values["failed"].value is True
    assert found.values["failure_kind"].value == "complete"
    on_the_record = number(found, "t_contact") + number(found, "t_failure")
    assert on_the_record == pytest.approx(BEFORE + (truth["t_failure"] or 0), abs=3e-6)
    u = found.values["F_failure"].u
    assert u is not None
    assert number(found, "F_failure") == pytest.approx(load, abs=max(0.02 * load, 3 * u))
    assert number(found, "t_contact") == pytest.approx(BEFORE, abs=6e-6)
    assert number(found, "alpha_failure") == pytest.approx(truth["alpha_failure"], rel=0.02)
    assert number(found, "confidence") > 0.99
    assert number(found, "F_M") == number(found, "F_failure")
    for symbol in ("eps_exact", "v1", "t_c", "alpha_r"):
        assert found.values[symbol].value is None
    assert [w.code for w in found.warnings] == ["specimen-failed"]


def test_energy_to_failure_is_what_the_dart_has_lost():
    record, motion = drop(900.0, 0.0, noise=1.0)
    truth = motion.truth()
    v, alpha = float(truth["v_failure"] or 0), float(truth["alpha_failure"] or 0)
    lost = 0.5 * 0.503 * (2.0**2 - v**2) + 0.503 * 9.80665 * alpha
    assert number(analyze(record, IMPACT), "E_failure") == pytest.approx(lost, rel=0.01)


@pytest.mark.parametrize("ringing", [0.0, 0.05, 0.15])
@pytest.mark.parametrize("v0", [1.2, 3.5])
def test_ringing_is_no_failure(ringing: float, v0: float):
    record, _ = drop(None, ringing, v0=v0)
    found = analyze(record, replace(IMPACT, v0=v0, u_v0=0.005 * v0))
    assert found.values["failed"].value is False
    assert found.values["failure_kind"].value is None
    assert found.values["eps_exact"].value is not None


def test_a_wrong_unit_is_no_failure():
    record, _ = drop(None)
    found = analyze(replace(record, force=record.force * 1e-3), IMPACT)
    assert found.values["failed"].value is None
    assert "restitution-impossible" in [w.code for w in found.warnings]


def test_a_saturated_record_is_no_failure():
    record, _ = drop(None)
    clipped = replace(record, force=np.minimum(record.force, 300.0), rails=(-300.0, 300.0))
    found = analyze(clipped, IMPACT)
    assert found.values["failed"].value is None
    assert "saturated" in [w.code for w in found.warnings]


def test_the_model_is_fitted_up_to_the_failure():
    record, _ = drop(900.0)
    fit = fit_record(record, IMPACT)
    E = parameters(fit)["E"]
    assert fit.problem.window.left_out is not None
    assert "failure" in fit.problem.window.left_out
    assert E.lo is not None
    assert E.hi is not None
    assert E.lo < 3.3e9 < E.hi


def broken(ringing: float = 0.02, v0: float = 2.0, **specimen: float) -> tuple[Record, Motion]:
    """A record of a specimen that cracks or slips, and its truth."""
    rig = Rig(
        specimen=replace(Specimen(), **specimen), drop=Hang(None, v0, catcher=True),
        sensor=Sensor(noise_N=8.0, ringing=ringing, ringing_Hz=8000.0),
    )  # fmt: skip
    motion = Motion(rig)
    return Record(signal(rig, motion, 0, -BEFORE, DT, N) + 8.0 * white((8,), 0, N), DT, pretrigger=1500), motion


@pytest.mark.parametrize(("load", "share"), [(400.0, 0.12), (700.0, 0.2), (950.0, 0.3)])
@pytest.mark.parametrize("ringing", [0.0, 0.04])
def test_a_crack_is_found_and_the_specimen_holds(load: float, share: float, ringing: float):
    record, motion = broken(ringing, crack_N=load, crack_loss=share)
    found, truth = analyze(record, IMPACT), motion.truth()
    assert found.values["failed"].value is True
    assert found.values["failure_kind"].value == "partial"
    on_the_record = number(found, "t_contact") + number(found, "t_failure")
    assert on_the_record == pytest.approx(BEFORE + float(truth["t_crack"] or 0), abs=5e-6)
    assert number(found, "F_D") == number(found, "F_failure") == pytest.approx(load, rel=0.05)
    assert number(found, "l_D") == pytest.approx(truth["alpha_crack"], rel=0.03)
    assert number(found, "load_lost") == pytest.approx(share, abs=0.04)
    assert number(found, "eps_exact") == pytest.approx(truth["eps_exact"], abs=0.02)
    assert found.values["F_P"].value is None
    assert [w.code for w in found.warnings] == ["specimen-cracked"]


def test_a_slip_is_no_crack():
    record, _ = broken(slip_N=700.0, slip_mm=0.25)
    found = analyze(record, IMPACT)
    assert found.values["failed"].value is False
    assert found.values["F_D"].value is None
    assert [w.code for w in found.warnings] == ["specimen-slipped"]


def test_a_crack_before_the_failure_is_the_first_damage():
    record, motion = broken(crack_N=500.0, crack_loss=0.25, fail_N=850.0)
    found, truth = analyze(record, IMPACT), motion.truth()
    assert found.values["failure_kind"].value == "complete"
    assert number(found, "F_failure") == pytest.approx(850, rel=0.03)
    assert number(found, "F_D") == pytest.approx(500, rel=0.05)
    assert number(found, "l_D") == pytest.approx(truth["alpha_crack"], rel=0.03)
    assert number(found, "l_P") > number(found, "l_M") > number(found, "l_D")


def test_the_model_is_fitted_up_to_the_crack():
    record, _ = broken(crack_N=900.0, crack_loss=0.2)
    E = parameters(fit_record(record, IMPACT))["E"]
    assert E.lo is not None
    assert E.hi is not None
    assert E.lo < 3.3e9 < E.hi


def test_a_plate_that_shakes_is_told_doubtful_and_not_cracked():
    record, _ = broken(0.0, v0=3.2, C_d=0.0, modes=4)
    found = analyze(record, replace(IMPACT, v0=3.2))
    assert found.values["failed"].value is False
    assert number(found, "confidence") <= 0.5
    assert "crack-uncertain" in [w.code for w in found.warnings]


def test_failure_while_the_load_still_rises_is_without_yielding():
    record, _ = drop(600.0, 0.0)
    found = analyze(record, IMPACT)
    assert found.values["failure_type"].value == "NY"
    assert number(found, "F_P") == pytest.approx(300, rel=0.03)
    assert number(found, "l_P") == pytest.approx(number(found, "l_M"), rel=0.05)


def shaped(way: np.ndarray, force: np.ndarray, v0: float = 5.0) -> Record:
    """The record of a dart that meets ``force`` (n,) N over ``way`` (n,) m, by Newton's law in steps of 0.1 µs."""
    x, v, out = 0.0, v0, list[float]()
    for k in range(60_000):
        F = float(np.interp(x, way, force, right=0.0)) if x > 0 or k == 0 else 0.0
        if k % 10 == 0:
            out.append(F)
        v += (9.80665 - F / 0.503) * 1e-7
        x += v * 1e-7
    record = np.concatenate((np.zeros(1500), out))
    return Record(record + 3.0 * white((9,), 0, record.size), 1e-6, pretrigger=1500)


@pytest.mark.parametrize(
    ("way_mm", "newton", "kind", "failed"),
    [
        ((0, 2, 3, 4, 8, 9), (0, 800, 900, 880, 150, 0), "YD", None),
        ((0, 2, 3, 3.4, 4.2, 4.6), (0, 800, 900, 890, 100, 0), "YS", None),
        ((0, 2, 3, 4, 4.02), (0, 850, 900, 900, 0), "YU", True),
    ],
)
def test_punctures_are_typed_by_how_the_load_goes(way_mm, newton, kind, failed):
    fine = np.linspace(0, way_mm[-1], 400)
    record = shaped(fine * 1e-3, np.interp(fine, way_mm, newton))
    found = analyze(record, replace(IMPACT, v0=5.0, u_v0=0.025))
    assert found.values["failure_type"].value == kind
    assert found.values["failed"].value is failed
    half = float(np.interp(-450, -np.array(newton[2:]), np.array(way_mm[2:])))
    assert number(found, "l_P") == pytest.approx(half * 1e-3, rel=0.03)
    assert number(found, "F_P") == pytest.approx(450, rel=0.03)
