"""Digits as a technician reads them."""

import pytest

from analysis.findings import UNITS
from api.http import present
from api.http.symbols import SYMBOLS


@pytest.mark.parametrize(
    ("value", "u", "unit", "expected"),
    [
        (712.3456, 0.271, "N", ("712.35", "0.27", "N")),
        (2.97934e-3, 4.5e-6, "s", ("2.9793", "0.0045", "ms")),
        (1.34e-3, None, "m", ("1.340", "", "mm")),
        (0.879, 0.014, "1", ("0.879", "0.014", "")),
        (3.3e9, 4e7, "Pa", ("3.300", "0.040", "GPa")),
        (-0.25, 0.1, "J", ("−0.25", "0.10", "J")),
        (12345.0, 230.0, "N", ("12340", "230", "N")),
        (10000.0, None, "Hz", ("10000", "", "Hz")),
        (0.0, None, "N", ("0.000", "", "N")),
        (1e-12, 1e-13, "J", ("1e−12", "1e−13", "J")),
        (None, None, "m", ("–", "", "mm")),
        (True, None, "1", ("yes", "", "")),
        (False, None, "1", ("no", "", "")),
        ("yielding", None, "1", ("yielding", "", "")),
    ],
)
def test_value_and_uncertainty_have_the_digits_that_the_uncertainty_bears(
    value: float | None, u: float | None, unit: str, expected: tuple[str, str, str]
) -> None:
    found = present.shown("x", {"value": value, "u": u, "unit": unit})
    assert (found.value, found.u, found.unit) == expected


def test_every_symbol_of_an_answer_has_a_definition() -> None:
    assert set(UNITS) <= set(SYMBOLS)


def test_a_symbol_nobody_defined_is_shown_last_and_escaped() -> None:
    groups = present.grouped(
        {"<b>": {"value": 1.0, "u": None, "unit": "N"}, "F_M": {"value": 2.0, "u": None, "unit": "N"}}
    )
    assert list(groups) == ["Impact", present.OTHER]
    assert str(groups[present.OTHER][0].symbol.sign) == "&lt;b&gt;"
