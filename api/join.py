"""From a run file to what analysis takes: arrays and conditions in SI. The one place where settings meet physics."""

import math

import numpy as np

from analysis import GateSetup, Impact, Record
from daq.run import ChannelData, RunData
from daq.test_file import Table


def record_of(run: RunData) -> tuple[Record, int]:
    """The force record of a run, as the sensor saw it, and the sample of the run that it starts with.

    Of a partial run it is the stretch without gaps that holds the greatest force. Gate edges are on its own axis.
    """
    force = run.channel("force")
    assert force is not None, "a run is made with a force channel, or not at all"
    scale = force.calibration
    part = whole_part(force)
    shift = part.start * run.dt
    rails = lsb = None
    if force.bits is not None:
        half = 2 ** (force.bits - 1)
        ends = sorted((counts * scale.scale + scale.offset) for counts in (-half, half - 1))
        rails, lsb = (ends[0], ends[1]), abs(scale.scale)
    acceleration = run.channel("acceleration")
    record = Record(
        force=force.calibrated(part),
        dt=run.dt,
        rails=rails,
        lsb=lsb,
        time_constant=scale.time_constant_s,
        gate_edges=tuple(
            (e - (run.first_sample_ns or 0)) * 1e-9 - shift if run.gate_on_clock else e * 1e-9
            for e in run.gate_edges_ns
        ),
        gate_on_record_clock=run.gate_on_clock,
        pretrigger=None if run.pretrigger is None else max(0, run.pretrigger - part.start),
        acceleration=None if acceleration is None or acceleration.gaps else acceleration.calibrated(part),
    )
    return record, part.start


def whole_part(channel: ChannelData) -> slice:
    """The stretch without gaps that holds the greatest magnitude."""
    edges = [0, *(e for start, count in channel.gaps for e in (start, start + count)), len(channel.samples)]
    stretches = [slice(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b > a]
    values = channel.calibrated()
    return max(stretches, key=lambda s: float(np.abs(values[s]).max()))


def impact_of(run: RunData) -> Impact:
    """The conditions of a run's impact."""
    test, rig = run.test, run.rig
    force = run.channel("force")
    assert force is not None, "a run is made with a force channel, or not at all"
    scale = force.calibration
    gate = rig.gate if rig is not None else None
    # Where a gate has measured the speed, the test file's is what the operator aimed at.
    measured = gate is not None and len(run.gate_edges_ns) >= 2
    return Impact(
        mass=test.dart.mass_kg,
        tip_radius=test.dart.tip_radius_mm * 1e-3,
        tip_mass=test.dart.tip_mass_kg,
        thickness=test.specimen.thickness_mm * 1e-3,
        nu=test.specimen.nu,
        shape=test.specimen.shape,
        support=test.support.kind,
        support_radius=None if test.support.radius_mm is None else test.support.radius_mm * 1e-3,
        v0=None if measured else test.drop.v0,
        u_v0=test.drop.u.get("v0"),
        height=None if test.drop.height_mm is None else test.drop.height_mm * 1e-3,
        u_height=_scaled(test.drop, "height_mm", 1e-3),
        g=run.g,
        catcher=test.drop.catcher or run.provenance.get("catcher", rig is not None and rig.tower.catcher),
        friction=rig.tower.friction_N if rig is not None else 0.0,
        gate=None
        if gate is None
        else GateSetup(
            flag_width=gate.flag_width_mm * 1e-3,
            u_flag_width=gate.u.get("flag_width_mm", 0.02) * 1e-3,
            u_edge=gate.edge_mm * 1e-3,
            gap=None if gate.gap_mm is None else gate.gap_mm * 1e-3,
            clock=gate.clock_us * 1e-6,
        ),
        u_mass=test.dart.u.get("mass_kg", 0.0),
        u_tip_mass=test.dart.u.get("tip_mass_kg", 0.0),
        u_thickness=(_scaled(test.specimen, "thickness_mm", 1e-3) or 0.0),
        u_nu=test.specimen.u.get("nu", 0.0),
        u_tip_radius=(_scaled(test.dart, "tip_radius_mm", 1e-3) or 0.0),
        u_support_radius=(_scaled(test.support, "radius_mm", 1e-3) or 0.0),
        tip_E=None if test.dart.tip_E_GPa is None else test.dart.tip_E_GPa * 1e9,
        tip_nu=test.dart.tip_nu,
        yield_stress=None if test.specimen.yield_MPa is None else test.specimen.yield_MPa * 1e6,
        diameter=None if test.specimen.diameter_mm is None else test.specimen.diameter_mm * 1e-3,
        u_gain=math.fabs(scale.u.get("counts_to_unit", 0.0) / scale.scale),
    )


def _scaled(table: Table, key: str, scale: float) -> float | None:
    u = table.u.get(key)
    return None if u is None else u * scale
