"""A wrong rig or test file is told by file, line, key and the nearest right name."""

from pathlib import Path

import pytest
from records import CR39

from daq.errors import SettingsError
from daq.rig_file import load_rig
from daq.test_file import load_test, override

RIG = """[recorder]
driver = "scpi"
port = "socket://127.0.0.1:1"
trigger_level = 50
[[recorder.channel]]
counts_to_unit = 0.1
"""


def test_the_examples_in_the_docs_are_valid() -> None:
    examples = Path(__file__).parents[2] / "docs" / "examples"
    assert load_test(examples / "cr39.toml")[0].drop.v0 == 1.39
    assert load_rig(examples / "rig.toml")[0].gate is not None


def test_a_good_test_file_keeps_its_uncertainties_by_key(cr39: Path) -> None:
    test, text = load_test(cr39)
    assert text == CR39
    assert test.dart.u == {"mass_kg": 0.0005}
    assert test.drop.u == {"v0": 0.01}


def test_the_specimen_is_named_after_the_file_unless_it_has_a_name(tmp_path: Path) -> None:
    path = tmp_path / "petg-07.toml"
    path.write_text(CR39.replace('id = "cr39-1"\n', ""))
    assert load_test(path)[0].specimen.id == "petg-07"


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("mass_kg = 0.503", "mas_kg = 0.503", 2, ["'mas_kg'", "did you mean 'mass_kg'"]),
        ("mass_kg = 0.503", "mass_kg = 0", 2, ["mass_kg", "greater than 0", "given: 0"]),
        ("mass_kg = 0.503", "mass_kg = nan", 2, ["mass_kg", "finite"]),
        ("tip_radius_mm = 6.35", "", 1, ["needs the key 'tip_radius_mm'"]),
        ("nu = 0.30", "nu = 0.5", 10, ["nu", "less than 0.5"]),
        ("nu = 0.30", 'nu = "0.3"', 10, ["nu", "valid number"]),
        ("radius_mm = 30", "", 12, ["'radius_mm'"]),
        ('kind = "ring"', 'kind = "rung"', 13, ["'ring' or 'rigid'", "rung"]),
        ("u_v0 = 0.01", "u_v0 = -1", 16, ["u_v0", "0 or more"]),
        ("u_v0 = 0.01", "height_mm = 100", 16, ["v0 or height_mm, not both"]),
        ("u_v0 = 0.01", "u_v1 = 0.01", 18, ["'u_v1'"]),
        ("[drop]", "[dorp]", 16, ["[dorp]", "did you mean 'drop'"]),
        ("u_mass_kg = 0.0005", "tip_mass_kg = 0.6", 1, ["tip_mass_kg", "below 0.503"]),
    ],
)
def test_each_mistake_is_named_with_its_line(tmp_path: Path, old: str, new: str, line: int, words: list[str]) -> None:
    path = tmp_path / "test.toml"
    path.write_text(CR39.replace(old, new))
    with pytest.raises(SettingsError) as caught:
        load_test(path)
    message = str(caught.value)
    assert f"{path}, line {line}:" in message
    for word in words:
        assert word in message


def test_all_mistakes_of_a_file_are_told_at_once(tmp_path: Path) -> None:
    path = tmp_path / "test.toml"
    path.write_text(CR39.replace("mass_kg = 0.503", "mass_kg = -1").replace("nu = 0.30", "nu = 7"))
    with pytest.raises(SettingsError) as caught:
        load_test(path)
    assert len(str(caught.value).splitlines()) == 2


def test_text_that_is_not_toml_and_a_file_that_is_not_there(tmp_path: Path) -> None:
    path = tmp_path / "test.toml"
    path.write_text("[dart\n")
    with pytest.raises(SettingsError, match=r"not valid TOML.*line 1"):
        load_test(path)
    with pytest.raises(SettingsError, match="no such file"):
        load_test(tmp_path / "none.toml")


def test_values_can_be_overridden_by_dotted_key_and_are_checked_too(cr39: Path) -> None:
    test, _ = load_test(cr39)
    changed = override(test, {"drop.height_mm": 150.0, "dart.mass_kg": 1.504}, "table")
    assert (changed.drop.v0, changed.drop.height_mm, changed.dart.mass_kg) == (None, 150.0, 1.504)
    with pytest.raises(SettingsError, match=r"--v0.*greater than 0"):
        override(test, {"drop.v0": -2.0}, "--v0")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("trigger_level = 50", "", ["trigger_level", "range of channel 1"]),
        ('"socket://127.0.0.1:1"', '"tcp://127.0.0.1:1"', ["driver 'scpi' takes", "tcp://127.0.0.1:1"]),
        ('driver = "scpi"', 'driver = "gpib"', ["line 2", "'scpi' or 'modbus'"]),
        ("counts_to_unit = 0.1", "counts_to_unt = 0.1", ["line 6", "did you mean 'counts_to_unit'"]),
        ("counts_to_unit = 0.1", "counts_to_unit = 0", ["counts_to_unit is 0"]),
        ("trigger_level = 50", "samples = 100", ["pretrigger has to be below samples (100)"]),
        ("[recorder]", "[gate]\n[recorder]", ["[gate] needs the key 'flag_width_mm'"]),
    ],
)
def test_mistakes_in_a_rig_file_are_named(tmp_path: Path, old: str, new: str, words: list[str]) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(RIG.replace(old, new))
    with pytest.raises(SettingsError) as caught:
        load_rig(path)
    for word in words:
        assert word in str(caught.value)
