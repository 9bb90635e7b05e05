"""When a record begins and what belongs to it."""

from __future__ import annotations

import numpy as np
import pytest
from clients import Scpi, arm, header, record, take
from emulator import Emulator, until


@pytest.fixture
def scpi(shared_emulator: Emulator):
    with Scpi(shared_emulator.endpoints["scpi_tcp"]) as client:
        yield client


def gate(scpi: Scpi) -> list[int]:
    return [int(field) for field in scpi.ask("GATE:DATA?").split(",")]


def test_an_immediate_trigger_needs_no_drop(scpi: Scpi):
    arm_at = scpi.ask("TRAC:STAT?")
    scpi.done("TRIG:SOUR IMM")
    scpi.done("INIT")
    until(lambda: scpi.condition() == 256)
    assert header(scpi)[0] == int(arm_at.split(",")[3]) + 1
    assert np.abs(record(scpi).mean() - 5 * 8192 / 3200) < 1
    assert gate(scpi) == [0, 0]


def test_the_contact_input_fires_on_the_leading_edge_of_the_flag(shared_emulator: Emulator, scpi: Scpi):
    take(shared_emulator, scpi, "TRIG:SOUR EXT", "SENS:SWE:POIN 40000", "SENS:SWE:OFFS:POIN 0")
    samples, edges = record(scpi), gate(scpi)
    first = np.flatnonzero(samples > 100)[0] * 1000
    assert edges[2] == 0
    # From 25 mm above contact at 1.39 m/s: 19.3 ms.
    assert first == pytest.approx(19.3e6, abs=0.2e6)


def test_a_falling_slope_fires_at_the_end_of_contact(shared_emulator: Emulator, scpi: Scpi):
    # With noise the comparator would already see the force go down through the level on its way up.
    shared_emulator.do("sensor", noise_N=0, ringing=0)
    truth = take(shared_emulator, scpi, "TRIG:SLOP NEG", "TRIG:LEV 300", "SENS:SWE:OFFS:POIN -4000")
    samples = record(scpi)
    assert samples[3999] > 300 >= samples[4000]
    assert np.argmax(samples) == pytest.approx(4000 - (truth["t_c"] - truth["t_M"]) * 1e6, abs=200)


def test_a_delay_moves_the_window_by_exactly_itself(shared_emulator: Emulator, scpi: Scpi):
    truth = take(shared_emulator, scpi, "TRIG:LEV 300", "TRIG:DEL 1e-3", "SENS:SWE:OFFS:POIN 0")
    assert header(scpi)[5] == 1_000_000
    samples = record(scpi)
    # The crest, no later than a level of 300 counts takes to be reached, is as far from the trigger as in truth.
    crest = np.argmax(samples) * 1e-6 + 1e-3
    assert truth["t_M"] - 0.35e-3 < crest < truth["t_M"]


def test_a_level_that_is_never_reached_leaves_the_recorder_armed(shared_emulator: Emulator, scpi: Scpi):
    arm(scpi, "TRIG:LEV 8000")
    shared_emulator.do("release")
    until(lambda: not shared_emulator.do("status")["moving"])
    assert scpi.condition() == 40
    assert gate(scpi) == [0, 0]


def test_a_level_within_the_noise_fires_by_itself(scpi: Scpi):
    scpi.done("TRIG:LEV 30")
    scpi.done("INIT")
    until(lambda: scpi.condition() == 256)
    samples = record(scpi)
    assert samples[499] < 30 <= samples[500]
    assert samples.max() < 100


def test_a_drop_without_an_armed_recorder_leaves_no_record_and_no_edges(shared_emulator: Emulator, scpi: Scpi):
    shared_emulator.do("release")
    until(lambda: not shared_emulator.do("status")["moving"])
    assert scpi.condition() == 0
    assert gate(scpi) == [0, 0]


def test_a_recorder_armed_while_the_dart_falls_still_sees_the_contact(shared_emulator: Emulator, scpi: Scpi):
    shared_emulator.do("height", v0=2.5)
    shared_emulator.do("release")
    scpi.done("TRIG:LEV 300")
    scpi.done("INIT")
    until(lambda: scpi.condition() == 256)
    assert record(scpi).max() > 2000


def test_the_pretrigger_memory_must_be_full_first(shared_emulator: Emulator, scpi: Scpi):
    scpi.done("SENS:SWE:POIN 1000000")
    scpi.done("SENS:SWE:OFFS:POIN -999999")
    scpi.done("INIT")
    assert scpi.condition() == 72
    shared_emulator.do("release")
    assert until(lambda: scpi.condition() != 72 and scpi.condition(), limit=5) == 40


def test_edges_appear_when_the_flag_passes_and_are_timed_against_the_trigger(shared_emulator: Emulator, scpi: Scpi):
    shared_emulator.do("gate", edge_sd_mm=0)
    truth = take(shared_emulator, scpi, "TRIG:LEV 100")
    held = header(scpi)[0]
    found = until(lambda: (seen := gate(scpi))[1] == 4 and seen)
    assert found[0] == held
    down, up = np.diff(found[2:4])[0] * 1e-9, np.diff(found[4:])[0] * 1e-9
    v_down = 10e-3 / down + 9.80665 * -(found[2] + found[3]) / 2 * 1e-9
    assert v_down == pytest.approx(truth["v0"], rel=2e-3)
    mid = (found[4] + found[5]) / 2 * 1e-9 - truth["t_c"]
    assert 10e-3 / up + 9.80665 * mid == pytest.approx(truth["v1"], rel=3e-3)


def test_the_same_seed_and_drop_number_give_the_same_samples():
    taken = []
    for _ in range(2):
        with Emulator("--seed", "11") as emulator, Scpi(emulator.endpoints["scpi_tcp"]) as scpi:
            take(emulator, scpi)
            taken.append(record(scpi))
    assert np.array_equal(*taken)


def test_a_million_samples_show_the_bounces(shared_emulator: Emulator, scpi: Scpi):
    shared_emulator.do("catcher", on=False)
    truth = take(shared_emulator, scpi, "SENS:SWE:POIN 1000000", "TRIG:LEV 300")
    until(lambda: scpi.condition() == 256)
    assert header(scpi)[3] == 1_000_000
    assert gate(scpi)[1] == 8
    parts = [np.frombuffer(scpi.block(f"TRAC:DATA? CH1,{k},500000"), ">i2") for k in (0, 500_000)]
    samples = np.concatenate(parts)
    above = np.flatnonzero((samples[1:] >= 300) & (samples[:-1] < 300) & (np.arange(999_999) > 5000))
    assert (above[0] - 500) * 1e-6 == pytest.approx(truth["t_second"], abs=0.3e-3)
