"""Several channels of one recorder, each with its calibration, from the converter to the answer."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from emulator import Emulator
from rigs import WIRES, Daq, write_rig, write_test

from api.answer import answer_of
from daq.export import export_csv
from daq.recorder import crc32
from daq.store import Store

CHANNELS = """
calibrated_on = "2026-03-02"
certificate = "K-117"

[[recorder.channel]]
name = "second tup"
counts_to_unit = 0.390625
range = 3200
calibrated_on = "2026-03-03"
certificate = "K-118"

[[recorder.channel]]
name = "way"
quantity = "displacement"
unit = "mm"
counts_to_unit = 2.44140625e-3
range = 20

[[recorder.channel]]
name = "accelerometer"
quantity = "acceleration"
unit = "m/s2"
counts_to_unit = 1.220703125
range = 10000

[gate]
"""


def rig_of(emulator: Emulator, folder: Path, wire: str, samples: int = 5000) -> Path:
    rig = write_rig(folder, emulator.endpoints[wire], wire.partition("_")[0], samples)
    rig.write_text(rig.read_text().replace("[gate]", CHANNELS.strip(), 1))
    return rig


@pytest.mark.parametrize("wire", WIRES)
def test_four_channels_are_stored_bit_for_bit_with_their_calibrations(wire: str, emulator: Emulator, tmp_path: Path):
    emulator.do("recorder", channels=4)
    emulator.do("height", v0=1.39)
    daq = Daq("acquire", rig_of(emulator, tmp_path, wire), tmp_path / "data", "--test", str(write_test(tmp_path)))
    daq.until("armed")
    truth = emulator.do("release")["truth"]
    run = daq.end()["run"]
    daq.close()
    store = Store(tmp_path / "data")
    data = store.read(run)
    assert [crc32(channel.samples) for channel in data.channels] == emulator.do("status")["captured"]["crcs"]
    tup, second, way, accelerometer = (channel.calibrated() for channel in data.channels)
    assert tup.max() == pytest.approx(truth["F_M"], rel=0.03)
    assert second.max() == pytest.approx(0.98 * truth["F_M"], rel=0.03)
    assert way.max() == pytest.approx(truth["alpha_M"] * 1e3, abs=0.03)
    assert accelerometer.max() == pytest.approx(truth["F_M"] / 0.503, rel=0.03)
    with h5py.File(store.raw(run)) as file:
        instrument = file["entry/instrument"]
        assert instrument["channel_1"].attrs["calibration_certificate"] == "K-117"
        assert instrument["channel_2"].attrs["calibration_calibrated_on"] == "2026-03-03"
        assert instrument["channel_3"].attrs["calibration_unit"] == "mm"
    found = answer_of(store, run)["findings"]
    assert found["F_M"]["value"] == pytest.approx(truth["F_M"], rel=0.02)
    export_csv(data, tmp_path / "run.csv")
    head, first, *_ = (tmp_path / "run.csv").read_text().splitlines()
    assert len(head.split(",")) == len(first.split(",")) == 5


def test_a_rig_file_that_names_other_channels_than_the_recorder_has_is_told_and_nothing_is_lost(
    emulator: Emulator, tmp_path: Path
):
    emulator.do("recorder", channels=3)
    emulator.do("height", v0=1.39)
    rig = rig_of(emulator, tmp_path, "scpi_tcp")
    daq = Daq("acquire", rig, tmp_path / "data", "--test", str(write_test(tmp_path)))
    daq.until("armed")
    emulator.do("release")
    end = daq.end()
    daq.close()
    assert end["event"] == "failed"
    assert "3 channels" in end["text"]
    assert emulator.do("status")["held"]
    before, _, after = rig.read_text().partition('[[recorder.channel]]\nname = "accelerometer"')
    rig.write_text(before + after[after.index("[gate]") :])
    again = Daq("recover", rig, tmp_path / "data")
    run = again.end()["run"]
    again.close()
    assert len(Store(tmp_path / "data").read(run).channels) == 3


def test_a_gap_is_mapped_by_channel(emulator: Emulator, tmp_path: Path):
    emulator.do("recorder", channels=4)
    emulator.do("height", v0=1.39)
    rig = rig_of(emulator, tmp_path, "scpi_tcp", 30_000)
    daq = Daq("acquire", rig, tmp_path / "data", "--test", str(write_test(tmp_path)))
    daq.until("armed")
    emulator.do("release")
    daq.until("triggered")
    # After some chunks nothing comes whole any more.
    emulator.do("fault", name="flip_byte", command="TRAC:DATA?", nth=100, skip=3, count=None)
    end = daq.end()
    daq.close()
    emulator.do("clear")
    data = Store(tmp_path / "data").read(end["run"])
    assert data.missing
    first = next(n for n, channel in enumerate(data.channels) if channel.gaps)
    assert first > 0
    for channel in data.channels[:first]:
        assert not channel.gaps
    assert np.isnan(data.channels[-1].calibrated()).sum() == sum(count for _, count in data.channels[-1].gaps)
    again = Daq("recover", rig, tmp_path / "data")
    run = again.end()["run"]
    again.close()
    whole = Store(tmp_path / "data").read(run)
    assert [crc32(c.samples) for c in whole.channels] == emulator.do("status")["captured"]["crcs"]
