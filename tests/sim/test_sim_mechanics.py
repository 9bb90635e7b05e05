"""What the solver promises: published numbers, closed forms, balances and limits."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

from sim_device import mechanics
from sim_device.fall import Motion
from sim_device.mechanics import Law, solve
from sim_device.settings import Dart, Hang, Rig, Specimen, g

CONSERVATIVE = Law(m=0.503, friction=0, K_i=4e8, K_d=math.inf, C_i=math.inf, C_d=0, fail_N=math.inf)


def motion(v0: float = 1.39, *, dart: Dart | None = None, catcher: bool = False, **specimen: object) -> Motion:
    drop = Hang(v0=v0, catcher=catcher)
    return Motion(Rig(specimen=replace(Specimen(), **specimen), dart=dart or Dart(), drop=drop))


@pytest.mark.parametrize(
    ("v0", "E_GPa", "C_i", "C_d", "F_M", "alpha_M", "epsilon"),
    [(1.39, 3.30, 8000, 10, 700, 1.28e-3, 0.90), (2.80, 3.42, 5000, 15, 1412, 2.61e-3, 0.81)],
)
def test_the_flexed_plate_gives_table_1(v0, E_GPa, C_i, C_d, F_M, alpha_M, epsilon):
    truth = motion(v0, E_GPa=E_GPa, C_i=C_i, C_d=C_d).truth()
    assert truth["F_M"] == pytest.approx(F_M, rel=0.025)
    assert truth["alpha_M"] == pytest.approx(alpha_M, rel=0.05)
    assert truth["eps_published"] == pytest.approx(epsilon, abs=0.02)


def test_the_middle_row_of_table_1_comes_out_at_975_newton():
    assert motion(1.95, E_GPa=3.40, C_i=4500, C_d=10).truth()["F_M"] == pytest.approx(975, abs=0.5)


def test_without_gravity_and_loss_the_contact_is_hertz_in_closed_form(monkeypatch):
    monkeypatch.setattr(mechanics, "g", 0.0)
    v0, m, k = 1.7, CONSERVATIVE.m, CONSERVATIVE.K_i
    contact = solve(CONSERVATIVE, v0)
    alpha_M = (5 * m * v0**2 / (4 * k)) ** 0.4
    shape = 2 * math.sqrt(math.pi) * math.gamma(1.4) / math.gamma(0.9)
    assert contact.x_max == pytest.approx(alpha_M, rel=1e-9)
    assert pytest.approx(k * alpha_M**1.5, rel=1e-9) == contact.F_M
    assert contact.end == pytest.approx(shape * alpha_M / v0, rel=1e-9)
    assert contact.v_end == pytest.approx(-v0, rel=1e-9)


def test_the_peak_agrees_with_another_integrator_to_eight_digits():
    law = Law.of(Specimen(), Dart())

    def force(y):
        return law.K_i * max(y[0], 0.0) ** 1.5

    # Another formulation as well: α₁ is a state, x is not.
    def equations(t, y):
        rate3 = (force(y) - law.K_d * y[2]) / law.C_d
        return y[1] - force(y) / law.C_i - rate3, g - force(y) / law.m, rate3

    def crest(t, y):
        return equations(t, y)[0]

    crest.terminal = True
    run = solve_ivp(equations, (0, 5e-3), (0, 1.39, 0), "Radau", rtol=1e-10, atol=1e-15, first_step=1e-9, events=crest)
    contact = solve(law, 1.39)
    assert pytest.approx(force(run.y_events[0][0]), rel=1e-8) == contact.F_M
    assert contact.t_M == pytest.approx(run.t_events[0][0], rel=1e-5)


@pytest.mark.parametrize("friction", [0.0, 0.4])
@pytest.mark.parametrize("C_d", [0.0, 10.0])
def test_impulse_and_energy_balance_with_the_force_itself(friction, C_d):
    drop = motion(1.39, dart=Dart(friction_N=friction), C_d=C_d)
    truth, (_, contact) = drop.truth(), drop.contacts[0]
    impulse = energy = lost = 0.0
    law = drop.law
    for piece in contact.pieces:

        def along(t, piece=piece):
            y = piece.solution(t)
            F = contact.force(np.array([t]))[0]
            rate3 = (F - law.K_d * y[3]) / C_d if C_d else 0.0
            return F, y[1], F * F / law.C_i + C_d * rate3**2

        marks = np.linspace(piece.start, piece.end * (1 - 1e-15), 30)
        for low, high in itertools.pairwise(marks):
            impulse += quad(lambda t: along(t)[0], low, high, epsrel=1e-10)[0]
            energy += quad(lambda t: along(t)[0] * along(t)[1], low, high, epsrel=1e-10)[0]
            lost += quad(lambda t: along(t)[2], low, high, epsrel=1e-10)[0]
    stored = 0.5 * law.K_d * contact.alpha3_end**2
    assert truth["J"] == pytest.approx(impulse, rel=1e-8)
    assert truth["E_diss"] == pytest.approx(energy, rel=1e-7)
    assert truth["E_diss"] == pytest.approx(lost + stored, rel=1e-6)
    assert truth["alpha_perm"] == pytest.approx(truth["J"] / law.C_i, rel=1e-8)


def test_a_plate_that_cannot_bend_is_the_series_model():
    plate = motion(1.5, thickness_mm=100, support_radius_mm=1, C_i=20_000, C_d=0).truth()
    series = motion(1.5, kind="rigid", C=20_000).truth()
    for name in ("F_M", "t_M", "alpha_M", "t_c", "J", "v1", "alpha_perm"):
        assert plate[name] == pytest.approx(series[name], rel=1e-6), name


def test_the_damper_fades_continuously_into_none():
    without = motion(C_d=0).truth()
    gap = [abs(motion(C_d=C_d).truth()["F_M"] - without["F_M"]) for C_d in (1, 0.1, 0.01)]
    assert gap[0] > 5 * gap[1] > 25 * gap[2]
    assert motion(C_d=1e-4).truth()["t_c"] == pytest.approx(without["t_c"], rel=1e-6)


@pytest.mark.parametrize("C_d", [1e-6, 1.01e-10 * 65_200])
def test_a_plate_as_good_as_undamped_is_played_in_finite_time(C_d):
    # The second case was once caught integrating its own rounding for ever.
    constants = {
        "E_GPa": 0.325544,
        "nu": 0.064767,
        "thickness_mm": 2.96777,
        "support_radius_mm": 13.8125,
        "C_i": 32_547.5,
    }
    dart = Dart(mass_kg=4.563, tip_radius_mm=5.9, friction_N=3.7)
    truth = motion(1.836, dart=dart, C_d=C_d, **constants).truth()
    assert truth["F_M"] == pytest.approx(motion(1.836, dart=dart, C_d=0, **constants).truth()["F_M"], rel=1e-6)


def test_a_stiff_dashpot_fades_into_none():
    assert motion(C_i=1e12).truth()["eps_exact"] == pytest.approx(motion(C_i=None).truth()["eps_exact"], rel=1e-7)


@pytest.mark.parametrize(("v0", "alpha_r", "mark"), [(1.52, 0.214e-3, 3.30e-3), (1.60, 0.235e-3, 3.45e-3)])
def test_marks_on_petg_follow_from_what_the_dashpot_has_let_through(v0, alpha_r, mark):
    dart = Dart(mass_kg=0.743)

    def truth(C):
        return motion(v0, dart=dart, kind="rigid", E_GPa=2.2, nu=0.32, C=C).truth()

    found = truth(brentq(lambda C: truth(C)["alpha_r"] - alpha_r, 2000, 100_000, rtol=1e-6))
    assert found["alpha_perm"] == pytest.approx(found["alpha_r"], rel=1e-9)
    assert 2 * math.sqrt(2 * 6.35e-3 * found["alpha_r"]) == pytest.approx(mark, rel=0.01)


def test_without_a_damper_the_dart_comes_back_after_two_v1_over_g():
    truth = motion(C_d=0).truth()
    assert truth["t_second"] - truth["t_c"] == pytest.approx(2 * truth["v1"] / g, rel=1e-9)


def test_bending_that_relaxes_in_flight_delays_the_second_contact_or_hastens_it():
    truth = motion().truth()
    late = truth["t_second"] - truth["t_c"] - 2 * truth["v1"] / g
    # The dart parts at α_r and lands where the plate has come back to, α_perm, higher up.
    assert late == pytest.approx(-(truth["alpha_r"] - truth["alpha_perm"]) / truth["v1"], rel=1e-3)


def test_friction_takes_speed_on_the_way_up_and_on_the_way_down():
    f = 0.25
    drop = motion(dart=Dart(friction_N=f), C_d=0)
    truth, drag = drop.truth(), f / 0.503
    rise = truth["v1"] ** 2 / (2 * (g + drag))
    flight = truth["v1"] / (g + drag) + math.sqrt(2 * rise / (g - drag))
    assert truth["t_second"] - truth["t_c"] == pytest.approx(flight, rel=1e-9)
    assert truth["t_fall"] == pytest.approx(1.39 / (g - drag), rel=1e-12)


def test_a_caught_dart_does_not_come_back():
    drop = motion(catcher=True)
    assert drop.truth()["t_second"] is None
    assert drop.force(np.linspace(0.004, 1.0, 1000)).max() == 0


def test_bounces_go_on_until_the_dart_lies_and_weighs():
    drop = motion(0.05)
    t = np.linspace(0, drop.over, 20_000)
    force = drop.force(t)
    assert len(drop.contacts) > 5
    assert math.isfinite(drop.rest_from)
    resting = (t > drop.rest_from) & (t < drop.over)
    assert np.all(force[resting] == 0.503 * g)


def test_a_specimen_fails_at_its_load_and_lets_the_dart_through():
    intact, drop = motion(2.8), motion(2.8, fail_N=1000)
    truth, (_, contact) = drop.truth(), drop.contacts[0]
    assert truth["failed"] is True
    assert truth["F_failure"] == truth["F_M"] == 1000
    assert all(truth[name] is None for name in ("t_c", "v1", "eps_exact", "alpha_r", "t_second"))
    before = np.linspace(1e-6, truth["t_failure"] * 0.999, 500)
    assert contact.force(before) == pytest.approx(intact.contacts[0][1].force(before), rel=1e-7)
    after = truth["t_failure"] + np.array([10e-6, 100e-6])
    assert contact.force(after)[0] == pytest.approx(1000 * math.exp(-1), rel=0.1)
    assert contact.force(after)[1] < 0.5
    assert len(drop.contacts) == 1


def test_a_load_that_is_not_reached_fails_nothing():
    assert motion(fail_N=5000).truth()["F_M"] == pytest.approx(motion().truth()["F_M"], rel=1e-9)


def test_a_crack_takes_its_share_of_the_energy_that_a_spring_would_give_back(monkeypatch):
    monkeypatch.setattr(mechanics, "g", 0.0)
    law = replace(CONSERVATIVE, crack_N=800.0, crack_loss=0.25)
    contact = solve(law, 1.7)
    K, at = law.K_i, contact.x_crack
    assert at == pytest.approx((800 / K) ** (2 / 3), rel=1e-6)
    energy = 0.5 * law.m * 1.7**2
    # ½·m·v0² = ∫F dα, along K up to the crack and 0.75·K after it; the 10 µs it takes cost a little more.
    deepest = ((2.5 * energy / K - at**2.5) / 0.75 + at**2.5) ** 0.4
    assert contact.x_max == pytest.approx(deepest, rel=0.003)
    returned = 0.4 * 0.75 * K * contact.x_max**2.5
    assert contact.v_end == pytest.approx(-math.sqrt(2 * returned / law.m), rel=1e-5)
    assert contact.force(np.array([contact.t_crack + 100e-6]))[0] == pytest.approx(
        0.75 * K * contact.position(np.array([contact.t_crack + 100e-6]))[0] ** 1.5, rel=1e-4
    )


def test_a_specimen_that_slips_is_whole_after_it(monkeypatch):
    monkeypatch.setattr(mechanics, "g", 0.0)
    law = replace(CONSERVATIVE, slip_N=800.0, slip=50e-6)
    contact = solve(law, 1.7)
    later = np.array([contact.t_slip + 400e-6])
    assert contact.force(later)[0] == pytest.approx(law.K_i * (contact.position(later)[0] - 50e-6) ** 1.5, rel=1e-4)
    assert contact.x_end == pytest.approx(50e-6, rel=1e-4)


def test_what_has_cracked_is_softer_when_it_is_hit_again():
    hit_twice = motion(2.2, crack_N=600.0, crack_loss=0.3, C_d=0)
    hit_twice.extend(0.5)
    first, second = (contact for _, contact in hit_twice.contacts[:2])
    assert second.law.K_d == pytest.approx(0.7 * first.law.K_d)
    assert second.t_crack is None
    assert hit_twice.truth()["failure_kind"] == "partial"


def test_specimens_scatter_as_asked():
    rng = np.random.default_rng(7)
    made = [Specimen(E_GPa=3.0, fail_N=1800.0, scatter_E=0.03, scatter_load=0.06).drawn(rng) for _ in range(2000)]
    assert np.std(np.log([s.E_GPa for s in made])) == pytest.approx(0.03, rel=0.06)
    assert np.std(np.log([s.fail_N for s in made])) == pytest.approx(0.06, rel=0.06)
    assert np.median([s.fail_N for s in made]) == pytest.approx(1800, rel=0.01)
