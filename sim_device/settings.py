"""What the rig is made of: typed settings with limits, changed by name from the control endpoint or a scenario file."""

from __future__ import annotations

import difflib
import math
import tomllib
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

g = 9.80665
"""m/s², acceleration of gravity."""


class SettingError(ValueError):
    """A key or value that the rig does not take; the text names the key, the limit and the nearest right name."""


def nearest(name: str, known: list[str]) -> str:
    """``name`` with the closest of the known names, or all of them, for a message."""
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return (
        f"{name!r} is not known; did you mean {close[0]!r}?" if close else f"{name!r} is not one of {', '.join(known)}"
    )


def number(low: float, high: float, default: float | None, *, whole: bool = False, optional: bool = False) -> Any:
    """A dataclass field that holds a number between two limits, inclusive."""
    return field(default=default, metadata={"low": low, "high": high, "whole": whole, "optional": optional})


@dataclass(frozen=True)
class Specimen:
    """The specimen and its support; "ring" is a plate free to bend, "rigid" a half-space (PHYSICS.md, Models).

    ``modes`` > 0: the plate has mass, of ``density_kg_m3``, and so many of its modes; ``finite``: the half-space is a
    layer of ``thickness_mm`` that slides on its base. At ``fail_N`` it breaks, at ``crack_N`` a crack takes
    ``crack_loss`` of its stiffness, at ``slip_N`` it gives way by ``slip_mm`` unharmed. ``scatter_E`` and
    ``scatter_load`` are the standard deviations of ln E and of the logarithm of those loads from specimen to specimen.
    """

    kind: str = field(default="ring", metadata={"choices": ("ring", "rigid")})
    E_GPa: float = number(1e-3, 1000, 3.3)
    nu: float = number(0, 0.499, 0.30)
    thickness_mm: float = number(0.1, 100, 4.6)
    support_radius_mm: float = number(1, 500, 30)
    C_i: float | None = number(1, 1e12, 8000, optional=True)
    C_d: float = number(0, 1e6, 10)
    C: float | None = number(1, 1e12, None, optional=True)
    fail_N: float | None = number(1, 1e7, None, optional=True)
    crack_N: float | None = number(1, 1e7, None, optional=True)
    crack_loss: float = number(0.01, 0.95, 0.2)
    slip_N: float | None = number(1, 1e7, None, optional=True)
    slip_mm: float = number(0.001, 10, 0.3)
    scatter_E: float = number(0, 0.5, 0)
    scatter_load: float = number(0, 0.5, 0)
    modes: int = number(0, 6, 0, whole=True)
    density_kg_m3: float = number(100, 30_000, 1310)
    modal_damping: float = number(0, 0.5, 0.01)
    finite: bool = False

    def check(self) -> None:
        """Refuse what is played one way or the other, not both."""
        if self.modes and (self.C_d or self.kind != "ring"):
            raise SettingError("modes are of a plate on a ring without C_d: set kind = 'ring' and C_d = 0 with them")
        if self.finite and self.kind != "rigid":
            raise SettingError("finite is of a specimen on a rigid support: set kind = 'rigid' with it")
        if self.modes and self.crack_N is not None:
            raise SettingError("a plate with modes does not crack in part: set modes = 0 or crack_N = null with it")

    def drawn(self, rng: np.random.Generator) -> Specimen:
        """One specimen of this kind, with its own E and its own loads."""
        E, load = (math.exp(s * rng.standard_normal()) for s in (self.scatter_E, self.scatter_load))
        loads = {k: None if (N := getattr(self, k)) is None else N * load for k in ("fail_N", "crack_N", "slip_N")}
        return replace(self, E_GPa=self.E_GPa * E, **loads)


@dataclass(frozen=True)
class Dart:
    """The falling mass; ``friction_N`` is the guides' force against the motion."""

    mass_kg: float = number(0.01, 100, 0.503)
    tip_radius_mm: float = number(0.1, 1000, 6.35)
    tip_mass_kg: float = number(0, 100, 0)
    friction_N: float = number(0, 1000, 0)

    def check(self) -> None:
        """Refuse a dart whose tip outweighs it or which its guides would hold fast."""
        if self.tip_mass_kg >= 0.9 * self.mass_kg:
            raise SettingError(f"tip_mass_kg must be below 0.9 of mass_kg, {0.9 * self.mass_kg:g}")
        if self.friction_N > 0.9 * self.mass_kg * g:
            raise SettingError(f"friction_N must be at most 0.9 of the weight, {0.9 * self.mass_kg * g:.4g}")


@dataclass(frozen=True)
class Sensor:
    """Force sensor, charge amplifier and converter."""

    noise_N: float = number(0, 1e5, 3)
    offset_N: float = number(-1e5, 1e5, 5)
    gain: float = number(-10, 10, 1)
    range_N: float = number(1, 1e7, 3200)
    bits: int = number(12, 16, 14, whole=True)
    ringing: float = number(0, 10, 0.01)
    ringing_Hz: float = number(1, 1e6, 10_000)
    ringing_decay_s: float = number(1e-6, 1, 0.5e-3)
    time_constant_s: float | None = number(1e-3, 1e4, None, optional=True)


@dataclass(frozen=True)
class Displacement:
    """Displacement sensor on channel 3: the tip's way from the undeformed specimen, positive into it."""

    noise_mm: float = number(0, 1e3, 0.005)
    offset_mm: float = number(-1e3, 1e3, 0)
    gain: float = number(-10, 10, 1)
    range_mm: float = number(0.01, 1e4, 20)


@dataclass(frozen=True)
class Accelerometer:
    """Accelerometer on channel 4, fast to the dart, positive up: g in the clamp, 0 in free fall, F/m in contact."""

    noise_m_s2: float = number(0, 1e6, 5)
    offset_m_s2: float = number(-1e6, 1e6, 0)
    gain: float = number(-10, 10, 1)
    range_m_s2: float = number(1, 1e7, 10_000)


@dataclass(frozen=True)
class Recorder:
    """Channels that are recorded: tup, second tup, displacement, accelerometer, in this order."""

    channels: int = number(1, 4, 1, whole=True)


@dataclass(frozen=True)
class Gate:
    """Flag and beam; the flag's middle passes the beam when the tip is ``gap_mm`` above contact."""

    flag_width_mm: float = number(0.1, 1000, 10)
    gap_mm: float = number(0, 10_000, 20)
    width_error_mm: float = number(-10, 10, 0)
    edge_sd_mm: float = number(0, 10, 0.03)
    clock_ns: int = number(1, 1_000_000, 1000, whole=True)

    def check(self) -> None:
        """Refuse a flag of no width."""
        if self.flag_width_mm + self.width_error_mm <= 0:
            raise SettingError("width_error_mm leaves a flag of no width")


@dataclass(frozen=True)
class Hang:
    """Where the dart hangs before the drop: a height, or the speed it is to have at contact (one of the two)."""

    height_mm: float | None = number(0.1, 20_000, None, optional=True)
    v0: float | None = number(0.05, 20, 1.39, optional=True)
    catcher: bool = False
    door_open: bool = False

    def check(self) -> None:
        """Refuse neither or both."""
        if (self.height_mm is None) == (self.v0 is None):
            raise SettingError("give one of height_mm and v0")


@dataclass(frozen=True)
class Rig:
    """All that a hand can change at the tower."""

    specimen: Specimen = field(default_factory=Specimen)
    dart: Dart = field(default_factory=Dart)
    sensor: Sensor = field(default_factory=Sensor)
    second_sensor: Sensor = field(default_factory=lambda: Sensor(noise_N=6, offset_N=-3, gain=0.98))
    displacement: Displacement = field(default_factory=Displacement)
    accelerometer: Accelerometer = field(default_factory=Accelerometer)
    recorder: Recorder = field(default_factory=Recorder)
    gate: Gate = field(default_factory=Gate)
    drop: Hang = field(default_factory=Hang)


Part = TypeVar("Part", Specimen, Dart, Sensor, Displacement, Accelerometer, Recorder, Gate, Hang)


def _value(key: str, value: object, default: object, limits: dict[str, Any]) -> object:
    if "choices" in limits:
        if value not in limits["choices"]:
            raise SettingError(f"{key} must be one of {', '.join(limits['choices'])}, not {value!r}")
        return value
    if isinstance(default, bool):
        if not isinstance(value, bool):
            raise SettingError(f"{key} must be true or false, not {value!r}")
        return value
    if value is None and limits["optional"]:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise SettingError(f"{key} must be a number, not {value!r}")
    if limits["whole"] and value != int(value):
        raise SettingError(f"{key} must be a whole number, not {value!r}")
    if not limits["low"] <= value <= limits["high"]:
        raise SettingError(f"{key} must be {limits['low']:g} to {limits['high']:g}, not {value!r}")
    return int(value) if limits["whole"] else value


def changed(part: Part, changes: dict[str, Any]) -> Part:
    """``part`` with some of its keys changed; what is not named stays.

    Raises
    ------
    SettingError
        Unknown key, wrong type or a value beyond its limits; the part is as before.
    """
    known = {entry.name: entry for entry in fields(part)}
    values: dict[str, Any] = {}
    for key, value in changes.items():
        if key not in known:
            raise SettingError(nearest(key, list(known)))
        values[key] = _value(key, value, known[key].default, dict(known[key].metadata))
    if isinstance(part, Hang):
        if values.get("height_mm") is not None:
            values.setdefault("v0", None)
        elif values.get("v0") is not None:
            values.setdefault("height_mm", None)
    result = replace(part, **values)
    if isinstance(result, Specimen | Dart | Gate | Hang):
        result.check()
    return result


def load_scenario(path: Path) -> tuple[Rig, list[dict[str, Any]]]:
    """The rig of a scenario file (TOML: the control endpoint's names and keys) and its ``[[fault]]`` tables.

    Raises
    ------
    SettingError
        The file cannot be read or holds something unknown; the text names file and key.
    """
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise SettingError(f"scenario {path}: {error}") from error
    faults: Any = tables.pop("fault", [])
    if not isinstance(faults, list) or not all(isinstance(table, dict) for table in faults):  # pyright: ignore[reportUnknownVariableType]  whatever TOML holds
        raise SettingError(f"scenario {path}: a fault is a table [[fault]]")
    rig = Rig()
    for name, table in tables.items():
        try:
            if name not in (names := [entry.name for entry in fields(rig)]):
                raise SettingError(nearest(name, [*names, "fault"]))
            if not isinstance(table, dict):
                raise SettingError(f"{name} must be a table")
            rig = replace(rig, **{name: changed(getattr(rig, name), table)})
        except SettingError as error:
            raise SettingError(f"scenario {path}: [{name}] {error}") from error
    return rig, faults
