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
    ("load", "ringing"), [(250.0, 0.0), (250.0, 0.02), (500.0, 0.0), (500.0, 0.02), (800.0, 0.05), (1000.0, 0.05)]
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
    assert number(found, "alpha_failure") == pytest.approx(truth["alpha_failure"], rel=0.03)
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
    assert found.values["failed"].value is None
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
