"""What an analysis answers with: values, units, standard uncertainties, and cautions in words."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

UNITS: dict[str, str] = {
    "F_M": "N",
    "F_M_raw": "N",
    "t_M": "s",
    "alpha_M": "m",
    "t_c": "s",
    "J": "N*s",
    "eps_published": "1",
    "eps_exact": "1",
    "eps_flight": "1",
    "eps_gate": "1",
    "v0": "m/s",
    "v1": "m/s",
    "E_M": "J",
    "l_M": "m",
    "E_diss": "J",
    "alpha_r": "m",
    "t_contact": "s",
    "alpha_perm": "m",
    "mark_diameter": "m",
    "failed": "1",
    "failure_kind": "1",
    "t_failure": "s",
    "F_failure": "N",
    "alpha_failure": "m",
    "E_failure": "J",
    "confidence": "1",
    "F_D": "N",
    "l_D": "m",
    "E_D": "J",
    "F_P": "N",
    "l_P": "m",
    "E_P": "J",
    "failure_type": "1",
    # beyond the contract
    "load_lost": "1",
    "bounces": "1",
    "t_second": "s",
    "t_nc": "s",
    "t_fall": "s",
    "v0_gate": "m/s",
    "v0_height": "m/s",
    "v0_fall": "m/s",
    "v1_gate": "m/s",
    "v1_flight": "m/s",
    "baseline": "N",
    "noise": "N",
    "ringing_Hz": "Hz",
    "ringing_decay": "s",
    "ringing_amplitude": "N",
}


@dataclass(frozen=True)
class Finding:
    """A value in `unit` with its standard uncertainty `u`; None where unknown."""

    value: float | bool | str | None
    unit: str
    u: float | None = None


@dataclass(frozen=True)
class Caution:
    """A warning: a documented code, and words that name the thing, the limit and the way out."""

    code: str
    text: str


@dataclass(frozen=True)
class Findings:
    """Findings by symbol, and the cautions that go with them."""

    values: dict[str, Finding]
    warnings: list[Caution] = field(default_factory=list[Caution])

    def to_json(self) -> dict[str, object]:
        """The contract's `findings` and `warnings`; numbers that are not finite become None."""
        return {
            "findings": {
                s: {"value": _plain(f.value), "unit": f.unit, "u": _plain(f.u)} for s, f in self.values.items()
            },
            "warnings": [{"code": w.code, "text": w.text} for w in self.warnings],
        }


class Answer:
    """Findings under construction: every symbol is there from the start, unknown."""

    def __init__(self) -> None:
        self.values = {symbol: Finding(None, unit) for symbol, unit in UNITS.items()}
        self.warnings: list[Caution] = []

    def set(self, symbol: str, value: float | None, u: float | None = None) -> None:
        """Set `symbol`, in the unit it has; a value that is not finite stays unknown."""
        if value is not None and math.isfinite(value):
            good_u = u if u is not None and math.isfinite(u) else None
            self.values[symbol] = Finding(float(value), UNITS[symbol], None if good_u is None else float(good_u))

    def say(self, symbol: str, value: bool | str) -> None:
        """Set `symbol` to a word, or to true or false."""
        self.values[symbol] = Finding(value, UNITS[symbol])

    def forget(self, symbols: Iterable[str]) -> None:
        """Make `symbols` unknown again."""
        for symbol in symbols:
            self.values[symbol] = Finding(None, UNITS[symbol])

    def get(self, symbol: str) -> tuple[float | None, float]:
        """(value, u) of `symbol`; u is 0 where it cannot be had."""
        found = self.values[symbol]
        return (None if found.value is None else float(found.value)), found.u or 0.0

    def warn(self, code: str, text: str) -> None:
        """Add a caution."""
        self.warnings.append(Caution(code, text))

    def done(self) -> Findings:
        """The finished findings."""
        return Findings(dict(self.values), list(self.warnings))


def _plain(value: float | bool | str | None) -> float | bool | str | None:
    if value is None or isinstance(value, bool | str):
        return value
    return float(value) if math.isfinite(value) else None
