"""A drop of a series: its run and its answer, read by symbol."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from analysis.fit import Fit, NotFitted
from api.fitting import fit_of
from daq.run import RunData


@dataclass(frozen=True)
class Drop:
    """run : with its conditions; answer : what was found."""

    run: RunData
    answer: dict[str, Any]

    def value(self, symbol: str) -> float | None:
        """A finding, or a parameter of the fit, in SI; None where it is not known."""
        found = self.answer["findings"].get(symbol)
        if found is None and self.answer["fit"] is not None:
            found = self.answer["fit"]["parameters"].get(symbol)
        value = None if found is None else found["value"]
        return None if value is None or isinstance(value, str | bool) else float(value)

    @cached_property
    def fit(self) -> Fit | NotFitted:
        """The fit itself, for figures and joint fits; or why there is none."""
        try:
            return fit_of(self.run)
        except NotFitted as e:
            return e

    @property
    def failed(self) -> bool | None:
        """Whether the specimen failed: as the operator saw it, else as the record tells; None: neither."""
        seen = self.run.test.measured.failed
        if seen is not None:
            return seen
        told = self.answer["findings"]["failed"]["value"]
        return told if isinstance(told, bool) else None

    @property
    def load_lasts(self) -> float | None:
        """s from contact until the load is gone: the contact time, or the time of complete failure."""
        return self.value("t_c") or (self.value("t_failure") if self.failed else None)

    @property
    def total_mm(self) -> float:
        """Thickness of the specimen, or of the stack."""
        stack = self.run.test.specimen.stack_mm
        return sum(stack) if stack else self.run.test.specimen.thickness_mm
