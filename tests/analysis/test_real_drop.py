"""One real guided drop from public research."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from analysis import Impact, Record, analyze

FILE = Path(__file__).resolve().parents[3] / "shared" / "data" / "guided_drop_1.lvm.txt.gz"


@pytest.mark.skipif(not FILE.exists(), reason=f"the real record is not at {FILE}")
def test_release_hit_bounce_and_flight_time_of_a_real_guided_drop_come_out() -> None:
    text = gzip.decompress(FILE.read_bytes()).decode("latin-1").split("***End_of_Header***")[2]
    rows = [line.split("\t")[:3] for line in text.splitlines()[2:] if line.strip()]
    table = np.array(rows, dtype=float)
    record = Record(table[:, 2] / 0.225e-3, 1e-5, acceleration=table[:, 1] / 1.023e-3 * 9.80665)
    found = analyze(record, Impact(0.35839, 4.25e-3, None, None, "rigid", None, shape="other"))
    value = {s: float(f.value) for s, f in found.values.items() if f.value is not None}
    # Read off a plot of the record: release at 0.040 s, first touch 0.1342 to 0.1351 s, peak 0.1358 s, bounce 0.190 s.
    assert 0.1340 < value["t_contact"] < 0.1352
    assert value["t_contact"] + value["t_M"] == pytest.approx(0.13575, abs=1e-4)
    assert value["F_M"] == pytest.approx(640, abs=5)
    assert value["t_second"] == pytest.approx(0.190, abs=5e-4)
    assert value["bounces"] == 3, "at 0.190, 0.211 and 0.222 s"
    assert value["t_fall"] == pytest.approx(0.0945, abs=1e-3)
    assert value["v0"] == pytest.approx(0.92, abs=0.02)
    assert value["eps_flight"] == pytest.approx(0.287, abs=0.01)
    assert "v0-from-fall" in {w.code for w in found.warnings}
