"""Findings of an instrumented impact, from arrays alone."""

from analysis.conditions import GateSetup, Impact
from analysis.findings import Caution, Finding, Findings
from analysis.impact import analyze, kinematics
from analysis.kinematics import Kinematics
from analysis.record import Record

__all__ = [
    "Caution",
    "Finding",
    "Findings",
    "GateSetup",
    "Impact",
    "Kinematics",
    "Record",
    "analyze",
    "kinematics",
]
