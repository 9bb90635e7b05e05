"""What the gate promises."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_device.fall import Motion
from sim_device.gate import edges
from sim_device.settings import Dart, Gate, Hang, Rig, Specimen, g

STILL = Gate(edge_sd_mm=0)


def passes(gate: Gate = STILL, *, v0=1.39, catcher=False, dart: Dart | None = None, specimen: Specimen | None = None):
    motion = Motion(Rig(drop=Hang(v0=v0, catcher=catcher), dart=dart or Dart(), specimen=specimen or Specimen()))
    return motion, edges(motion, gate, np.random.default_rng(1))


def before(v0: float, height: float, fall: float = g) -> float:
    """Time from height to contact, of a dart that arrives with v0."""
    return (v0 - math.sqrt(v0**2 - 2 * fall * height)) / fall


def test_the_flag_breaks_and_frees_the_beam_on_its_way_down():
    _, found = passes(catcher=True)
    assert [-edge.time for edge in found[:2]] == pytest.approx([before(1.39, 0.025), before(1.39, 0.015)], rel=1e-12)
    assert [edge.free for edge in found] == [False, True, False, True]


def test_the_rebound_is_timed_by_the_same_flag():
    motion, found = passes(catcher=True)
    truth = motion.truth()
    v1, t_c, x = truth["v1"], truth["t_c"], truth["alpha_r"]
    rise = [(v1 - math.sqrt(v1**2 - 2 * g * (height + x))) / g for height in (0.015, 0.025)]
    assert [edge.time - t_c for edge in found[2:]] == pytest.approx(rise, rel=1e-9)


def test_friction_slows_fall_and_rebound_alike_in_sign():
    _, found = passes(dart=Dart(friction_N=0.5), catcher=True)
    assert -found[0].time == pytest.approx(before(1.39, 0.025, g - 0.5 / 0.503), rel=1e-12)


def test_a_dart_that_bounces_on_leaves_eight_edges_at_the_most():
    _, found = passes()
    assert len(found) == 8
    assert [edge.free for edge in found] == [False, True] * 4
    assert [edge.time for edge in found] == sorted(edge.time for edge in found)


def test_a_rebound_that_turns_within_the_beam_breaks_and_frees_it_once():
    # v1 of about 0.63 m/s rises 20 mm: past the trailing edge at 15 mm, short of the leading one at 25 mm.
    _, found = passes(v0=0.72)
    assert [edge.free for edge in found][:4] == [False, True, False, True]
    assert 0.05 < found[3].time - found[2].time < 0.2


def test_a_failed_specimen_lets_nothing_come_back():
    _, found = passes(specimen=Specimen(fail_N=300))
    assert len(found) == 2


def test_a_flag_of_another_width_than_stated_is_timed_as_it_is():
    _, found = passes(Gate(edge_sd_mm=0, width_error_mm=0.5), catcher=True)
    assert -found[0].time == pytest.approx(before(1.39, 0.02525), rel=1e-12)


def test_edges_scatter_by_a_position():
    motion, exact = passes(catcher=True)
    rng = np.random.default_rng(3)
    spread = np.std([edges(motion, Gate(edge_sd_mm=0.03), rng)[0].time - exact[0].time for _ in range(2000)])
    speed = math.sqrt(1.39**2 - 2 * g * 0.025)
    assert spread * speed == pytest.approx(0.03e-3, rel=0.06)
