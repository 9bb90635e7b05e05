"""A profile that is wrong says where, and what would be right; the shipped ones are right."""

from pathlib import Path

import pytest

from daq.errors import SettingsError
from daq.profile import load_profile, shipped
from daq.rig import Rig
from daq.rig_file import load_rig
from daq.template import render

SCOPE = (Path(__file__).parents[2] / "daq" / "profiles" / "rigol-ds1000z.toml").read_text()
COUNTER = (Path(__file__).parents[2] / "daq" / "profiles" / "droptower-modbus.toml").read_text()


def test_every_shipped_profile_is_valid_and_says_what_it_was_tried_on():
    for name in shipped():
        driver = "scpi" if "scpi" in name or "rigol" in name else "modbus"
        assert load_profile(name, driver)[0].tried_on


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("identity =", "identiy =", ["identiy", "did you mean 'identity'"]),
        ('arm = [":SING"]\n', "", ["needs arm"]),
        ("{points}", "{point}", ["{point}", "points"]),
        ("{points}", "{points", ["'{'", "place"]),
        ('STOP = "complete"', 'STOP = "done"', ["STOP", "'complete'"]),
        ('"x_increment_s"', '"x_step"', ["x_step", "x_increment_s"]),
        ("bits = 8\n", "", ["bits"]),
        ("most = 250_000", "most = 10", ["most", "1000"]),
        ('type = "u8"', 'type = "u12"', ["type", "'u8'"]),
        ('rate_Hz = ":ACQ:SRAT?"', 'sample_rate = ":ACQ:SRAT?"', ["sample_rate", "rate_Hz"]),
        ('driver = "scpi"', 'driver = "modbus"', ["driver", "'scpi'"]),
    ],
)
def test_a_mistake_in_an_scpi_profile_is_named(tmp_path: Path, old: str, new: str, said: list[str]):
    assert old in SCOPE
    path = tmp_path / "own.toml"
    path.write_text(SCOPE.replace(old, new, 1))
    with pytest.raises(SettingsError) as refused:
        load_profile(str(path), "scpi")
    assert all(word in str(refused.value) for word in ["own.toml", *said]), refused.value


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('held = { at = 67, type = "u32" }', 'held = { at = 67, type = "u24" }', ["held", "u24"]),
        ("boot = { at = 65", "boots = { at = 65", ["boots", "boot"]),
        ('"record:u32"', '"recrod:u32"', ["recrod", "record"]),
        ('"1:u16"', '"1"', ["values", "pattern"]),
        (", value = 0x01020304", "", ["sentinel"]),
        ("page_samples = 61_440", "page_samples = 61_441", ["65535"]),
        ('abort = [{ at = 16, values = ["2:u16"] }]', "", ["abort"]),
    ],
)
def test_a_mistake_in_a_modbus_map_is_named(tmp_path: Path, old: str, new: str, said: list[str]):
    path = tmp_path / "own.toml"
    assert old in COUNTER
    path.write_text(COUNTER.replace(old, new, 1))
    with pytest.raises(SettingsError) as refused:
        load_profile(str(path), "modbus")
    assert all(word in str(refused.value) for word in ["own.toml", *said]), refused.value


RIG = """[recorder]
driver = "{driver}"
profile = "{profile}"
port = "{port}"
trigger_level = 60
[[recorder.channel]]
{scale} = 0.39
"""


@pytest.mark.parametrize(
    ("driver", "profile", "scale", "said"),
    [
        ("scpi", "rigol", "counts_to_unit", ["'rigol'", "rigol-ds1000z"]),
        ("scpi", "no.toml", "counts_to_unit", ["no.toml", "no such file"]),
        ("modbus", "modbus-counter", "counts_to_unit", ["modbus-counter", "no recorder"]),
        ("scpi", "rigol-ds1000z", "counts_to_unit", ["volts_to_unit", "rigol-ds1000z"]),
        ("scpi", "droptower-scpi", "volts_to_unit", ["counts_to_unit", "droptower-scpi"]),
    ],
)
def test_a_profile_that_does_not_fit_the_rig_is_told_before_any_wire_is_opened(
    tmp_path: Path, driver: str, profile: str, scale: str, said: list[str]
):
    port = "socket://127.0.0.1:1" if driver == "scpi" else "tcp://127.0.0.1:1"
    path = tmp_path / "rig.toml"
    path.write_text(RIG.format(driver=driver, profile=profile, port=port, scale=scale))
    file, _ = load_rig(path)
    with pytest.raises(SettingsError) as refused:
        Rig(file)
    assert all(word in str(refused.value) for word in said), refused.value


def test_places_take_factors_and_formats():
    assert render(":TIM {window_s/12:.3e};{points};{level*1000:g}", {"window_s": 0.024, "points": 7, "level": 0.5}) == (
        ":TIM 2.000e-03;7;500"
    )
