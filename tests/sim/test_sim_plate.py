"""A plate with mass and a specimen of finite thickness, as the emulator plays them."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from sim_device.fall import Motion
from sim_device.plate import Layer, modes_of, shapes
from sim_device.settings import Dart, Hang, Rig, SettingError, Specimen, changed

E, NU, D, R, RHO = 3.3e9, 0.30, 4.6e-3, 30e-3, 1310.0
PLATE = Rig(specimen=Specimen(C_d=0.0, C_i=8000.0), drop=Hang(None, 2.0, catcher=True))


def test_modes_are_those_of_leissa():
    assert [root**2 for root, _ in shapes(3, 0.3)] == pytest.approx([4.935, 29.72, 74.16], abs=6e-3)
    first = modes_of(1, E, NU, D, R, RHO)[0]
    assert pytest.approx(4.9e-3, rel=0.02) == first.M
    assert first.omega / (2 * math.pi) == pytest.approx(1930, rel=0.01)


def test_the_modes_bend_as_far_as_the_plate_under_a_steady_force():
    K_d = 4 * math.pi / 3 * D**3 / ((1 - NU) * (3 + NU) * R**2) * E
    bent = sum(1 / (m.M * m.omega**2) for m in modes_of(6, E, NU, D, R, RHO))
    assert 0.99 < bent * K_d < 1


def test_mass_makes_the_force_ring_and_peak_higher():
    massless = Motion(PLATE).truth()["F_M"]
    shaking = Motion(replace(PLATE, specimen=replace(PLATE.specimen, modes=4))).truth()
    assert massless is not None
    assert shaking["F_M"] is not None
    assert 1.03 < shaking["F_M"] / massless < 1.15


def test_a_plate_of_no_weight_is_the_massless_one():
    light = Motion(replace(PLATE, specimen=replace(PLATE.specimen, modes=2, density_kg_m3=100.0))).truth()
    massless = Motion(PLATE).truth()
    for symbol, within in (("t_c", 0.01), ("alpha_perm", 0.01), ("eps_exact", 0.01)):
        assert light[symbol] == pytest.approx(massless[symbol], rel=within)


def test_momentum_and_energy_are_kept_with_modes():
    motion = Motion(replace(PLATE, specimen=replace(PLATE.specimen, modes=3, modal_damping=0.0, C_i=None)))
    truth = motion.truth()
    assert truth["J"] == pytest.approx(0.503 * (2.0 + (truth["v1"] or 0) + 9.80665 * (truth["t_c"] or 0)), rel=1e-9)
    lost = truth["E_diss"]
    assert lost is not None
    assert 0 < lost < 0.05 * 0.5 * 0.503 * 4  # what stays in the plate as vibration


def test_a_layer_is_stiffer_and_a_thick_one_is_a_half_space():
    assert Layer(6.35e-3, 1.0, 0.32).factor(4e-4) == pytest.approx(1, abs=2e-3)
    rigid = Specimen("rigid", 2.3, 0.32, 8.0, C=8000.0, C_d=0.0)
    dart, hang = Dart(0.743), Hang(None, 1.5, catcher=True)
    half_space = Motion(Rig(specimen=rigid, dart=dart, drop=hang)).truth()["F_M"] or 0
    peaks = [
        Motion(Rig(specimen=replace(rigid, finite=True, thickness_mm=h), dart=dart, drop=hang)).truth()["F_M"] or 0
        for h in (8.0, 10.0, 100.0)
    ]
    assert peaks[0] / peaks[1] == pytest.approx(1.015, abs=3e-3)  # PHYSICS: 8 and 10 mm differ by 1.5 %
    assert peaks[2] / half_space == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize("changes", [{"modes": 4}, {"finite": True}, {"modes": 3, "kind": "rigid", "C_d": 0.0}])
def test_what_does_not_go_together_is_refused(changes: dict[str, object]):
    with pytest.raises(SettingError, match="with"):
        changed(Specimen(), changes)
