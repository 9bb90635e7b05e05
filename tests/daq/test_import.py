"""A CSV or LVM file becomes a run, or one message says which line is wrong."""

import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from records import CR39, half_sine

from daq.errors import ImportFileError, SettingsError
from daq.importing import import_file, read_drops
from daq.run import RunData
from daq.test_file import load_test

WriteCsv = Callable[..., Path]


def imported(path: Path, test_file: Path, **values: object) -> RunData:
    test, text = load_test(test_file)
    return import_file(path, test, text, "s", values, "a table")


@pytest.mark.parametrize(
    ("header", "delimiter", "decimal", "time_factor", "force_factor"),
    [
        ("time_s,force_N", ",", ".", 1, 1),
        ("Time (ms);Force (kN)", ";", ",", 1e3, 1e-3),
        ("Zeit [ms]\tKraft [N]", "\t", ",", 1e3, 1),
        ("t_us;load_N", ";", ".", 1e6, 1),
        ('"time_s","force_N"', ",", ".", 1, 1),
    ],
)
def test_names_units_delimiters_and_decimal_commas_are_understood(
    tmp_path: Path, cr39: Path, header: str, delimiter: str, decimal: str, time_factor: float, force_factor: float
) -> None:
    t, f = half_sine()
    rows = [f"{a * time_factor:.9g}{delimiter}{b * force_factor:.9g}" for a, b in zip(t, f, strict=True)]
    text = "\n".join(["# made by a test", header, *(r.replace(".", decimal) for r in rows)])
    path = tmp_path / "drop.csv"
    path.write_text(text, encoding="utf-8")
    run = imported(path, cr39)
    assert run.dt == pytest.approx(1e-6, rel=1e-9)
    np.testing.assert_allclose(run.channels[0].calibrated(), f, atol=1e-5)
    assert run.channels[0].calibration.unit == "N"


def _shuffled(lines: list[str]) -> list[str]:
    body = lines[1:]
    random.Random(1).shuffle(body)
    return [lines[0], *body]


def _without(first: int, last: int) -> Callable[[list[str]], list[str]]:
    return lambda lines: lines[:first] + lines[last:]


def _line(number: int, text: str) -> Callable[[list[str]], list[str]]:
    return lambda lines: [*lines[: number - 1], text, *lines[number:]]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_line(3002, "3.0e-3,nan"), ["line 3002", "not a finite number"]),
        (_line(3002, "3.0e-3,"), ["line 3002", "column 2 is empty"]),
        (_line(3002, "3.0e-3"), ["line 3002", "column 2 is empty"]),
        (_line(3002, "3.0e-3,abc"), ["line 3002", "'abc'", "not a number"]),
        (_without(2000, 2100), ["line 2001", "gap of 100 samples"]),
        (_shuffled, ["time runs back", "shuffled"]),
        (lambda lines: [*lines[:100], *lines[99:]], ["line 101", "time stands still"]),
        (lambda lines: lines[1:], ["line 1", "header is missing"]),
        (lambda lines: lines[:10], ["9 samples", "at least 16"]),
        (lambda lines: lines[:1], ["0 samples", "at least 16"]),
        (lambda lines: ["\x1b[31m,\x07", *lines[1:]], ["no time column", "'\\x1b[31m"]),
        (lambda lines: [], ["empty"]),
        (lambda lines: ["no table here", "at all"], ["line 1", "no columns"]),
        (_line(1, "time_s,volts_V"), ["no force column", "[[import.channel]]"]),
        (_line(1, "sample,force_N"), ["no time column", "sample"]),
        (_line(1, "time,force_N"), ["time needs a unit"]),
    ],
)
def test_a_bad_file_is_named_with_its_line(
    write_csv: WriteCsv, cr39: Path, change: Callable[[list[str]], list[str]], words: list[str]
) -> None:
    with pytest.raises(ImportFileError) as caught:
        imported(write_csv(change=change), cr39)
    for word in words:
        assert word in str(caught.value)


def test_a_table_gives_each_file_its_own_conditions(write_csv: WriteCsv, cr39: Path, tmp_path: Path) -> None:
    table = tmp_path / "drops.csv"
    table.write_text("file;height_mm;specimen_id;dart.mass_kg\na.csv;150;s-1;0.7\nb.csv;;s-2;\n")
    drops = read_drops(table)
    a = imported(write_csv("a.csv"), cr39, **drops.values(Path("a.csv")))
    assert (a.test.drop.height_mm, a.test.drop.v0, a.test.specimen.id, a.test.dart.mass_kg) == (150, None, "s-1", 0.7)
    b = imported(write_csv("b.csv"), cr39, **drops.values(Path("b.csv")))
    assert (b.test.drop.v0, b.test.specimen.id, b.test.dart.mass_kg) == (2.0, "s-2", 0.503)
    with pytest.raises(SettingsError, match=r"no row for c\.csv"):
        drops.values(Path("c.csv"))


@pytest.mark.parametrize("text", ["name,v0\na.csv,2\n", "file,speed\na.csv,2\n", "file,v0\na.csv,1\na.csv,2\n"])
def test_a_bad_table_is_told(tmp_path: Path, text: str) -> None:
    table = tmp_path / "drops.csv"
    table.write_text(text)
    with pytest.raises(SettingsError, match=str(table)):
        read_drops(table)


LVM_CHANNELS = """
[[import.channel]]
column = "Load"
quantity = "force"
unit = "N"
scale = 4444.444     # 0.225 mV/N

[[import.channel]]
column = "Acceleration"
quantity = "acceleration"
unit = "g"
scale = 977.517      # 1.023 mV/g
"""


def test_the_real_lvm_record_is_read_whole(shared: Path, tmp_path: Path) -> None:
    test_file = tmp_path / "real.toml"
    test_file.write_text(CR39.replace("v0 = 2.0\nu_v0 = 0.01\n", "") + LVM_CHANNELS)
    run = imported(shared / "data" / "guided_drop_1.lvm.txt.gz", test_file)
    assert (run.points, run.dt, run.started) == (100_000, 1e-5, "2023-10-19T17:13:10.932")
    assert [c.calibration.quantity for c in run.channels] == ["force", "acceleration"]
    assert run.channels[0].samples[0] == 0.000556
    assert run.channels[1].samples[0] == -0.000236
    assert run.channels[0].samples[-1] == 0.000240


def _lvm(rows: int = 100, samples: int = 100, decimal: str = ".", extra: str = "") -> str:
    head = [
        "LabVIEW Measurement",
        "Separator\tTab",
        f"Decimal_Separator\t{decimal}",
        "X_Columns\tOne",
        "Date\t2026/01/02",
    ]
    head += ["Time\t03:04:05.678", "***End_of_Header***", "", "Channels\t1", f"Samples\t{samples}", "Y_Unit_Label\tN"]
    head += [f"Delta_X\t{'1.0E-5'.replace('.', decimal)}", "***End_of_Header***", "X_Value\tForce\tComment"]
    body = [f"{i * 1e-5:.6f}\t{i:.1f}".replace(".", decimal) for i in range(rows)]
    return "\n".join([*head, *body]) + extra


def test_an_lvm_file_with_decimal_comma_and_force_in_newtons(tmp_path: Path, cr39: Path) -> None:
    path = tmp_path / "drop.lvm"
    path.write_text(_lvm(decimal=","))
    run = imported(path, cr39)
    assert (run.dt, run.started) == (1e-5, "2026-01-02T03:04:05.678")
    np.testing.assert_array_equal(run.channels[0].calibrated(), np.arange(100.0))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (_lvm(rows=80), "states 100 samples, the file holds 80"),
        (_lvm().replace("X_Columns\tOne", "X_Columns\tMulti"), "X_Columns is 'Multi'"),
        (_lvm().replace("\t1.0E-5", "\t2.0E-5"), "Delta_X is 2e-05 s, the X column steps by 1e-05 s"),
        (_lvm().replace("Delta_X", "Delta"), "no Delta_X"),
        (_lvm(extra="\nChannels\t1\n***End_of_Header***\n"), "second segment"),
        (_lvm().partition("***End_of_Header***\nX_Value")[0], "two headers"),
    ],
)
def test_a_bad_lvm_file_is_told(tmp_path: Path, cr39: Path, text: str, words: str) -> None:
    path = tmp_path / "drop.lvm"
    path.write_text(text)
    with pytest.raises(ImportFileError, match=words):
        imported(path, cr39)


def test_volts_without_a_scale_are_refused_with_the_way_out(tmp_path: Path, cr39: Path) -> None:
    path = tmp_path / "drop.lvm"
    path.write_text(_lvm().replace("Y_Unit_Label\tN", "Y_Unit_Label\tVolts"))
    with pytest.raises(ImportFileError, match=r'Force \[Volts\].*\[\[import\.channel\]\] column = "Force"'):
        imported(path, cr39)
