"""What a drop will be like, before it is spent: force against range, contact against record, height for energy."""

import math
from typing import Any

from analysis.contact_solver import NotSolved, solve
from analysis.models import Model, overhang, plate_stiffness, tip_stiffness
from analysis.predict import predict
from daq.rig_file import RigFile
from daq.run import now, resolve_g
from daq.test_file import TestFile

Event = dict[str, Any]
MARGIN = 1.1
"""By which a drop may exceed its prediction: E of an impact lies above the static one, and ringing on top."""
OFF = 0.02
"""Of an energy that is asked for: how far the drop may be from it."""
SHOWN = ("v0", "F_M", "t_c", "alpha_M")


def ahead(rig: RigFile, test: TestFile) -> list[Event]:
    """The event `predicted`, and a `warning` for each thing that will not fit; none where too little is given."""
    g = resolve_g(test, rig)[0]
    friction = rig.tower.friction_N
    falling = g - friction / test.dart.mass_kg
    found = _energy(test, falling)
    v0 = test.drop.v0
    if v0 is None and test.drop.height_mm is not None:
        v0 = math.sqrt(max(2 * falling * test.drop.height_mm * 1e-3, 0.0))
    E = test.specimen.E_static_GPa
    if v0 and E is not None and test.specimen.shape == "plate":
        try:
            found = _predicted(rig, test, v0, E * 1e9, g) + found
        except (NotSolved, ValueError) as e:
            found.append({"event": "not-predicted", "at": now(), "text": str(e)})
    return found


def _warning(code: str, text: str) -> Event:
    return {"event": "warning", "at": now(), "code": code, "text": text}


def _energy(test: TestFile, falling: float) -> list[Event]:
    energy, mass = test.drop.energy_J, test.dart.mass_kg
    if energy is None:
        return []
    height = 1e3 * energy / (mass * falling)
    speed = math.sqrt(2 * energy / mass)
    text = f"{energy:g} J takes {height:.1f} mm with {mass:g} kg, {speed:.3f} m/s at contact"
    found: list[Event] = [{"event": "height", "at": now(), "height_mm": height, "v0": speed, "text": text}]
    own = None
    if test.drop.height_mm is not None:
        own = test.drop.height_mm * 1e-3 * mass * falling
    elif test.drop.v0 is not None:
        own = 0.5 * mass * test.drop.v0**2
    if own is not None and abs(own / energy - 1) > OFF:
        found.append(_warning("energy-not-met", f"this drop has {own:.3g} J, the test asks for {energy:g} J: {text}"))
    return found


def _predicted(rig: RigFile, test: TestFile, v0: float, E: float, g: float) -> list[Event]:
    nu, r = test.specimen.nu, test.dart.tip_radius_mm * 1e-3
    tip_E = None if test.dart.tip_E_GPa is None else test.dart.tip_E_GPa * 1e9
    K_d = math.inf
    if test.support.kind == "ring" and test.support.radius_mm is not None:
        R = test.support.radius_mm * 1e-3
        K_d = plate_stiffness(test.specimen.thickness_mm * 1e-3, R, E, nu)
        if test.specimen.diameter_mm is not None:
            K_d *= overhang(test.specimen.diameter_mm * 0.5e-3, R, nu)
    kind = "conservative" if math.isinf(K_d) else "flexed"
    K_i = tip_stiffness(r, E, nu, tip_E, test.dart.tip_nu)[0]
    findings = predict(solve(Model(kind, test.dart.mass_kg, K_i, K_d, g=g), v0), r).to_json()["findings"]
    assert isinstance(findings, dict)
    shown: dict[str, Any] = {symbol: findings[symbol] for symbol in SHOWN}
    F_M, t_c = shown["F_M"]["value"], shown["t_c"]["value"]
    text = f"without dampers, E {E * 1e-9:g} GPa: {F_M:.0f} N at the most, {1e3 * (t_c or 0):.2f} ms of contact"
    found: list[Event] = [{"event": "predicted", "at": now(), "findings": shown, "text": text}]
    ranges = [c.range for c in rig.recorder.channel if c.quantity == "force" and c.range is not None]
    ranges += [test.dart.range_N] if test.dart.range_N is not None else []
    if ranges and min(ranges) < MARGIN * F_M:
        found.append(
            _warning(
                "force-beyond-range",
                f"this drop will reach some {F_M:.0f} N, the range ends at {min(ranges):g} N: take a larger "
                "range, or a smaller height",
            )
        )
    after = (rig.recorder.samples - rig.recorder.pretrigger) / rig.recorder.sample_rate_Hz
    if t_c is not None and MARGIN * t_c > after:
        found.append(
            _warning(
                "contact-beyond-record",
                f"this contact will last some {1e3 * t_c:.2f} ms, the record ends {1e3 * after:.2f} ms after its "
                "trigger: take more samples, or a lower rate",
            )
        )
    return found
