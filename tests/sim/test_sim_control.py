"""What the control endpoint and the command line promise."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys

import pytest
from clients import Scpi, record, take
from emulator import ROOT, Emulator, address, until


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        ({"do": "relaese"}, ["relaese", "release"]),
        ({}, ["None"]),
        ({"do": "specimen", "E_Gpa": 3}, ["E_Gpa", "E_GPa"]),
        ({"do": "specimen", "E_GPa": -3}, ["E_GPa", "0.001 to 1000"]),
        ({"do": "specimen", "kind": "lens"}, ["kind", "ring, rigid"]),
        ({"do": "specimen", "nu": "0.3"}, ["nu", "number"]),
        ({"do": "specimen", "E_GPa": None}, ["E_GPa", "number"]),
        ({"do": "dart", "mass_kg": True}, ["mass_kg", "number"]),
        ({"do": "dart", "friction_N": 5}, ["friction_N", "weight"]),
        ({"do": "dart", "tip_mass_kg": 0.6}, ["tip_mass_kg", "mass_kg"]),
        ({"do": "sensor", "bits": 11}, ["bits", "12 to 16"]),
        ({"do": "sensor", "bits": 12.5}, ["bits", "whole"]),
        ({"do": "gate", "width_error_mm": -10}, ["width_error_mm", "flag"]),
        ({"do": "height"}, ["height_mm", "v0"]),
        ({"do": "height", "height_mm": 100, "v0": 1}, ["one of"]),
        ({"do": "height", "heigth_mm": 100}, ["heigth_mm", "height_mm"]),
        ({"do": "catcher"}, ["on", "true or false"]),
        ({"do": "door", "open": 1}, ["open", "true or false"]),
        ({"do": "release", "now": True}, ["now"]),
        ({"do": "fault", "name": "flip_bite"}, ["flip_bite", "flip_byte", "drop_byte", "stall"]),
        ({"do": "fault", "name": "flip_byte", "bit": 8}, ["bit", "0 to 7"]),
        ({"do": "fault", "name": "flip_byte", "comand": "FETC?"}, ["comand", "command"]),
        ({"do": "fault", "name": "flip_byte", "command": "FECH?"}, ["FECH?"]),
    ],
)
def test_a_wrong_request_is_told_what_is_wrong_and_changes_nothing(shared_emulator: Emulator, request_, words):
    before = shared_emulator.do("status")
    answer = shared_emulator.control(**request_)
    assert answer["ok"] is False
    assert all(word in answer["error"] for word in words), answer
    assert shared_emulator.do("status") == before


@pytest.mark.parametrize("line", [b"{", b"[]", b"\xff\xfe", b'"do"', b"nan"])
def test_what_is_no_request_is_answered_too(shared_emulator: Emulator, line):
    with socket.create_connection(address(shared_emulator.endpoints["control"]), timeout=10) as client:
        client.sendall(line + b"\n" + b'{"do": "status"}\n')
        answers = client.makefile("rb")
        assert json.loads(answers.readline())["ok"] is False
        assert json.loads(answers.readline())["ok"] is True
        answers.close()


def test_what_is_not_named_stays(shared_emulator: Emulator):
    shared_emulator.do("specimen", E_GPa=2.0)
    shared_emulator.do("specimen", nu=0.4, C_i=None)
    specimen = shared_emulator.do("status")["settings"]["specimen"]
    assert (specimen["E_GPa"], specimen["nu"], specimen["C_i"], specimen["C_d"]) == (2.0, 0.4, None, 10)


def test_height_and_speed_replace_each_other(shared_emulator: Emulator):
    shared_emulator.do("height", height_mm=200)
    truth = shared_emulator.do("release")["truth"]
    assert truth["v0"] == pytest.approx((2 * 9.80665 * 0.2) ** 0.5, rel=1e-12)
    assert shared_emulator.do("status")["settings"]["drop"]["v0"] is None


def test_the_hardware_holds_the_dart_while_the_door_is_open(shared_emulator: Emulator):
    with Scpi(shared_emulator.endpoints["scpi_tcp"]) as scpi:
        assert scpi.ask("INT:STAT?") == "15"
        shared_emulator.do("door", open=True)
        assert scpi.ask("INT:STAT?") == "6"
        answer = shared_emulator.control(do="release")
        assert answer["ok"] is False
        assert "door" in answer["error"]
        shared_emulator.do("door", open=False)
        shared_emulator.do("release")
        assert scpi.ask("INT:STAT?") == "5"


def test_one_dart_falls_at_a_time(shared_emulator: Emulator):
    drops = shared_emulator.do("status")["drops"]
    assert shared_emulator.do("release")["drop"] == drops + 1
    answer = shared_emulator.control(do="release")
    assert answer["ok"] is False
    assert "not in its clamp" in answer["error"]
    until(lambda: not shared_emulator.do("status")["moving"])
    assert shared_emulator.do("release")["drop"] == drops + 2


def test_a_failed_drop_answers_with_null_where_there_is_no_meaning(shared_emulator: Emulator):
    shared_emulator.do("specimen", fail_N=400)
    truth = shared_emulator.do("release")["truth"]
    assert truth["failed"] is True
    assert truth["t_c"] is truth["v1"] is truth["eps_exact"] is truth["t_second"] is None
    assert truth["F_failure"] == 400


def test_every_drops_truth_is_in_the_log(shared_emulator: Emulator):
    answer = shared_emulator.do("release")
    line = next(line for line in shared_emulator.log.splitlines() if f" drop {answer['drop']}: {{" in line)
    assert json.loads(line.split(": ", 1)[1]) == answer["truth"]


def test_a_scenario_is_the_rig_at_the_start(tmp_path):
    scenario = tmp_path / "rig.toml"
    scenario.write_text(
        '[specimen]\nkind = "rigid"\nE_GPa = 2.1\nC = 30000\n[sensor]\nbits = 12\n[drop]\nheight_mm = 100\n'
    )
    with Emulator("--scenario", scenario) as emulator, Scpi(emulator.endpoints["scpi_tcp"]) as scpi:
        settings = emulator.do("status")["settings"]
        assert (settings["specimen"]["C"], settings["sensor"]["bits"], settings["drop"]["v0"]) == (30000, 12, None)
        take(emulator, scpi, "TRIG:LEV 100")
        assert 1000 < record(scpi).max() <= 2047


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[specimen]\nE_Gpa = 3", ["[specimen]", "E_Gpa", "E_GPa"]),
        ("[specimn]\n", ["specimn", "specimen"]),
        ("[drop]\nv0 = 99", ["[drop]", "v0", "0.05 to 20"]),
        ("[drop\n", ["rig.toml"]),
        ("drop = 3", ["drop", "table"]),
        (None, ["rig.toml"]),
    ],
)
def test_a_wrong_scenario_is_one_message_with_file_and_key(tmp_path, text, words):
    scenario = tmp_path / "rig.toml"
    if text is not None:
        scenario.write_text(text)
    run = subprocess.run(
        [sys.executable, "-m", "sim_device", "--scenario", scenario], cwd=ROOT, capture_output=True, text=True
    )
    assert run.returncode == 1
    assert run.stdout == ""
    assert len(run.stderr.splitlines()) == 1
    assert all(word in run.stderr for word in [str(scenario), *words]), run.stderr


@pytest.mark.parametrize("arguments", [["--bad"], ["--baud", "5"], ["--baud", "x"], ["--seed", "-1"], ["file"]])
def test_wrong_usage_exits_with_two(arguments):
    run = subprocess.run([sys.executable, "-m", "sim_device", *arguments], cwd=ROOT, capture_output=True, text=True)
    assert run.returncode == 2


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_it_ends_cleanly_even_in_mid_drop(number):
    emulator = Emulator()
    with Scpi(emulator.endpoints["scpi_tcp"]) as scpi:
        scpi.done("INIT")
        emulator.do("release")
        emulator.process.send_signal(number)
        emulator.process.wait(10)
    assert "Traceback" not in emulator.log
    assert emulator.stop() == 0


def test_it_goes_on_when_nobody_reads_its_output():
    emulator = Emulator()
    assert emulator.process.stdout is not None
    emulator.process.stdout.close()
    emulator.do("release")
    with Scpi(emulator.endpoints["scpi_tcp"]) as scpi:
        assert scpi.ask("*OPC?") == "1"
    assert emulator.stop() == 0


@pytest.mark.parametrize("closed", [True, False])
def test_a_log_that_nobody_reads_stops_nothing(closed):
    run = subprocess.Popen(
        [sys.executable, "-m", "sim_device"], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert run.stdout is not None
    assert run.stderr is not None
    control = json.loads(run.stdout.readline())["control"]
    if closed:
        run.stderr.close()
    with socket.create_connection(address(control), timeout=10) as client, client.makefile("rb") as answers:
        # A pipe takes 64 KiB.
        for _ in range(1500):
            client.sendall(b'{"do": "specimen", "E_GPa": 3.3, "nu": 0.3, "thickness_mm": 4.6, "C_i": 8000}\n')
            assert json.loads(answers.readline())["ok"]
    run.terminate()
    assert run.wait(10) == 0
    run.stdout.close()
    run.stderr.close()
