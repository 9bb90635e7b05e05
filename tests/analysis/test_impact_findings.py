"""Definitions, routes, uncertainties and answers."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import drops
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis import GateSetup, Record, analyze, kinematics
from analysis.findings import UNITS, Findings
from analysis.speed import flight_rebound

CONTRACT = {
    "F_M": "N", "F_M_raw": "N", "t_M": "s", "alpha_M": "m", "t_c": "s", "J": "N*s", "eps_published": "1",
    "eps_exact": "1", "eps_flight": "1", "eps_gate": "1", "v0": "m/s", "v1": "m/s", "E_M": "J", "l_M": "m",
    "E_diss": "J", "alpha_r": "m", "t_contact": "s",
}  # fmt: skip
HALF_SINE = drops.half_sine()
FLEXED = drops.shapes()["flexed C_d=5"]


def values(found: Findings) -> dict[str, float]:
    return {s: float(f.value) for s, f in found.values.items() if f.value is not None}


def clean(drop: drops.Drop = FLEXED, seed: int = 1, **recorder: float) -> tuple[Record, float]:
    return drops.record(drop, drops.Recorder(**recorder), np.random.default_rng(seed))


@pytest.mark.parametrize("drop", drops.shapes().values(), ids=lambda d: d.name)
def test_definitions_agree_with_the_closed_form_and_the_tight_integration(drop: drops.Drop) -> None:
    record, _ = clean(drop)
    found = values(analyze(record, drops.impact(drop)))
    assert found["J"] == pytest.approx(drop.J, rel=1e-5)
    assert found["eps_exact"] == pytest.approx(drop.eps, abs=3e-5)
    assert found["eps_published"] == pytest.approx(drop.J / (drop.mass * drop.v0) - 1, abs=3e-5)
    assert found["v1"] == pytest.approx(drop.eps * drop.v0, abs=1e-4)
    assert found["alpha_M"] == pytest.approx(drop.alpha_M, rel=1e-4)
    assert found["alpha_r"] == pytest.approx(drop.alpha_r, abs=1e-6)
    assert found["E_diss"] == pytest.approx(drop.E_diss, abs=1e-4 * drop.mass * drop.v0**2)


def test_published_restitution_overstates_as_the_paper_conditions_say() -> None:
    for v0, bias in ((1.39, 0.021), (2.80, 0.010)):
        drop = drops.plate(f"P1 {v0}", v0=v0, C_i=8000.0 if v0 < 2 else 5000.0, C_d=10.0, E=3.3e9)
        found = values(analyze(clean(drop)[0], drops.impact(drop)))
        assert found["eps_published"] - found["eps_exact"] == pytest.approx(bias, abs=0.001)


def test_kinematics_run_from_contact_to_contact() -> None:
    path = kinematics(clean()[0], drops.impact(FLEXED))
    assert path.t[0] == 0
    assert path.t[-1] == pytest.approx(FLEXED.t_c, abs=1e-6)
    assert path.v[0] == FLEXED.v0
    assert path.v[-1] == pytest.approx(-FLEXED.eps * FLEXED.v0, abs=1e-4)
    closure = FLEXED.mass * ((path.v[0] ** 2 - path.v[-1] ** 2) / 2 + drops.G * path.alpha[-1])
    assert path.energy[-1] == pytest.approx(closure, rel=1e-5)


@settings(max_examples=8, deadline=None)
@given(st.floats(-300, 300), st.integers(0, 500), st.floats(0.05, 20))
def test_findings_do_not_depend_on_offset_time_or_scale(offset: float, shift: int, scale: float) -> None:
    record, _ = clean(noise=0.003)
    base = values(analyze(record, drops.impact(FLEXED)))
    moved = replace(record, force=np.concatenate((record.force[:shift], record.force)) * scale + offset)
    impact = drops.impact(FLEXED, mass=FLEXED.mass * scale)
    found = values(analyze(moved, impact))
    assert found["t_contact"] - shift * record.dt == pytest.approx(base["t_contact"], abs=2e-6)
    assert found["F_M"] == pytest.approx(base["F_M"] * scale, rel=2e-3)
    assert found["eps_exact"] == pytest.approx(base["eps_exact"], abs=2e-3)


def test_tip_mass_makes_the_sensor_read_low_and_is_put_right() -> None:
    record, _ = clean()
    low = replace(record, force=record.force * (FLEXED.mass - 0.05) / FLEXED.mass)
    found = values(analyze(low, drops.impact(FLEXED, tip_mass=0.05)))
    assert found["F_M"] == pytest.approx(FLEXED.F_M, rel=1e-4)
    assert found["eps_exact"] == pytest.approx(FLEXED.eps, abs=1e-4)


def test_droop_of_the_charge_amplifier_is_undone() -> None:
    record, _ = clean(HALF_SINE, noise=0.001)
    tau, fall = 0.1, np.empty_like(record.force)
    level = 0.0  # dF_meas/dt = dF/dt − F_meas/τ
    steps = np.diff(record.force, prepend=0.0)
    for k, step in enumerate(steps):
        level = level * math.exp(-record.dt / tau) + step
        fall[k] = level
    impact = drops.impact(HALF_SINE)
    assert values(analyze(replace(record, force=fall), impact))["eps_exact"] < HALF_SINE.eps - 0.015
    right = values(analyze(replace(record, force=fall, time_constant=tau), impact))
    assert right["eps_exact"] == pytest.approx(HALF_SINE.eps, abs=2e-3)


def gate_edges(v0: float, t0: float, t_end: float, v1: float, drop_height: float = 0.05) -> tuple[float, ...]:
    """Edges of a 10 mm flag whose middle passes `drop_height` above contact, going down and up."""
    g, w = drops.G, 0.01

    def when(v: float, height: float) -> float:
        return (v - math.sqrt(v * v - 2 * g * height)) / g

    down = [t0 - when(v0, h) for h in (drop_height + w / 2, drop_height - w / 2)]
    up = [t_end + when(v1, h) for h in (drop_height - w / 2, drop_height + w / 2)]
    return (*down, *up)


@pytest.mark.parametrize("on_clock", [True, False])
def test_gate_speed_is_carried_to_contact_with_half_a_percent(on_clock: bool) -> None:
    record, t0 = clean()
    v1 = FLEXED.eps * FLEXED.v0
    edges = gate_edges(FLEXED.v0, t0, t0 + FLEXED.t_c, v1)
    late = 0.0 if on_clock else 5.0
    record = replace(record, gate_edges=tuple(e + late for e in edges), gate_on_record_clock=on_clock)
    gate = GateSetup(0.01, gap=0.05)
    found = analyze(record, drops.impact(FLEXED, v0=None, gate=gate))
    v0 = found.values["v0"]
    assert v0.value == pytest.approx(FLEXED.v0, rel=1e-3)
    assert v0.u is not None
    assert v0.u / FLEXED.v0 == pytest.approx(0.0047 * (1 - 2 * drops.G * 0.05 / FLEXED.v0**2) ** 0.5, rel=0.35)
    assert found.values["eps_gate"].value == pytest.approx(FLEXED.eps, abs=2e-3)
    assert found.values["v1_gate"].value == pytest.approx(v1, rel=1e-3)
    assert [w.code for w in found.warnings] == []


def test_a_gate_1_39_m_s_50_mm_above_contact_means_1_71() -> None:
    record, _ = clean()
    edges = (0.0, 0.01 / 1.39)
    impact = drops.impact(FLEXED, v0=None, gate=GateSetup(0.01, gap=0.05))
    found = analyze(replace(record, gate_edges=edges, gate_on_record_clock=False), impact)
    assert found.values["v0"].value == pytest.approx(1.71, abs=0.005)


def test_order_of_v0_routes_is_given_gate_height() -> None:
    record, t0 = clean()
    edges = gate_edges(FLEXED.v0, t0, t0 + FLEXED.t_c, FLEXED.eps * FLEXED.v0)
    record = replace(record, gate_edges=edges)
    height = 1.9**2 / 2 / drops.G
    with_all = drops.impact(FLEXED, v0=2.003, gate=GateSetup(0.01), height=height)
    assert analyze(record, with_all).values["v0"].value == 2.003
    without = drops.impact(FLEXED, v0=None, gate=GateSetup(0.01), height=height)
    found = analyze(record, without)
    assert found.values["v0"].value == pytest.approx(2.0, rel=1e-3)
    assert "v0-routes-disagree" in [w.code for w in found.warnings]
    only = analyze(record, drops.impact(FLEXED, v0=None, height=height))
    assert only.values["v0"].value == pytest.approx(1.9)
    assert "v0-from-height" in [w.code for w in only.warnings]


def test_guide_friction_of_5_percent_of_weight_reads_0_858_for_0_878_by_flight() -> None:
    free = drops.impact(FLEXED, mass=0.5)
    guided = drops.impact(FLEXED, mass=0.5, friction=0.05 * 0.5 * drops.G)
    right, wrong = flight_rebound(guided, 0.3, 0.0), flight_rebound(free, 0.3, 0.0)
    assert right is not None
    assert wrong is not None
    # Without friction v1 reads g·t/2; the drop whose true ε is 0.878 shows 0.858.
    assert wrong.value / right.value == pytest.approx(0.858 / 0.878, abs=2e-3)


def test_uncertainty_of_v0_mass_and_gain_reach_restitution_as_the_formula_says() -> None:
    record, _ = clean()
    eps = FLEXED.eps
    for more, relative in (
        ({"u_v0": 0.01}, 0.005),
        ({"u_mass": 0.005 * FLEXED.mass}, 0.005),
        ({"u_gain": 0.005}, 0.005),
    ):
        u = analyze(record, drops.impact(FLEXED, **more)).values["eps_exact"].u
        assert u == pytest.approx((1 + eps) * relative, rel=0.02)


def test_every_symbol_of_the_contract_is_always_there_in_its_unit() -> None:
    assert CONTRACT.items() <= UNITS.items()
    for force in (np.zeros(0), np.zeros(500), clean()[0].force):
        answer = analyze(Record(force, 1e-6), drops.impact(FLEXED)).to_json()
        text = json.loads(json.dumps(answer, allow_nan=False))
        assert {s: f["unit"] for s, f in text["findings"].items() if s in CONTRACT} == CONTRACT


def test_a_gate_that_cannot_be_read_is_said() -> None:
    record, t0 = clean()
    gate = GateSetup(0.01)
    for edges, on_clock in (((), True), ((t0 - 0.02,), True), ((t0 + 0.02, t0 + 0.025), True), ((0.0, 0.005), False)):
        broken = replace(record, gate_edges=edges, gate_on_record_clock=on_clock)
        found = analyze(broken, drops.impact(FLEXED, v0=None, gate=gate))
        assert {"gate-unread", "no-v0"} == {w.code for w in found.warnings}
