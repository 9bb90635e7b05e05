"""The rig file: recorder, gate and interlock, each with driver, port and settings."""

from datetime import date
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from daq.test_file import Finite, NotNegative, Positive, Table
from daq.toml_file import parse, read_text

Driver = Literal["scpi", "modbus"]


class Port(Table):
    """A wire. `port` is a device path, `socket://host:port` or `rfc2217://…` (scpi), or `tcp://host:port` (modbus).

    `profile`: what the device speaks, a shipped name or the path of one's own file (from the rig file's folder).
    """

    driver: Driver
    port: str
    profile: str = ""
    baud: Annotated[int, Field(gt=0)] = 115200
    unit_id: Annotated[int, Field(ge=1, le=247)] = 1

    @model_validator(mode="after")
    def _port_fits_driver(self) -> "Port":
        scheme = self.port.partition("://")[0] if "://" in self.port else ""
        fits = {"scpi": ("", "socket", "rfc2217"), "modbus": ("", "tcp")}[self.driver]
        if scheme not in fits:
            wanted = ", ".join(f"{s}://…" if s else "a device path" for s in fits)
            raise ValueError(f"driver {self.driver!r} takes {wanted} as its port, not {self.port!r}")
        return self

    @property
    def profile_name(self) -> str:
        """Name or path of the profile; by default that of the device protocol."""
        return self.profile or f"droptower-{self.driver}"


class Channel(Table):
    """A channel of the recorder: value in `unit` = counts × counts_to_unit + offset.

    Of a recorder that says its own scale in volts it is volts × volts_to_unit + offset.
    """

    name: str = "CH1"
    quantity: Literal["force", "acceleration", "displacement"] = "force"
    unit: str = "N"
    counts_to_unit: Finite | None = None
    volts_to_unit: Finite | None = None
    offset: Finite = 0.0
    range: Positive | None = None
    time_constant_s: Positive | None = None
    calibrated_on: str | None = None
    calibration_due: str | None = None
    certificate: str | None = None

    @model_validator(mode="after")
    def _dates(self) -> "Channel":
        if self.calibration_due is not None:
            try:
                date.fromisoformat(self.calibration_due)
            except ValueError:
                raise ValueError(f'calibration_due is a date like "2027-05-01", not {self.calibration_due!r}') from None
        return self

    @model_validator(mode="after")
    def _one_scale(self) -> "Channel":
        if self.counts_to_unit is None and self.volts_to_unit is None:
            raise ValueError("needs the key 'counts_to_unit' (or 'volts_to_unit', for a recorder that gives volts)")
        for key in ("counts_to_unit", "volts_to_unit"):
            if getattr(self, key) == 0:
                raise ValueError(f"{key} is 0: every sample would be lost")
        return self

    @property
    def scale(self) -> float:
        """Unit a count, as a run has it.

        Raises
        ------
        ValueError : only a record's own header says it.
        """
        if self.counts_to_unit is None:
            raise ValueError(f"channel {self.name} is scaled in volts; a count is known once there is a record")
        return self.counts_to_unit

    def in_volts(self, volts_a_count: float, volts_at_zero: float) -> "Channel":
        """The channel with the scale that a recorder states of its record."""
        assert self.volts_to_unit is not None, "a rig was checked for it"
        scale, u = volts_a_count * self.volts_to_unit, self.u.get("volts_to_unit")
        relative = None if u is None else abs(u / self.volts_to_unit)
        return self.model_copy(
            update={
                "counts_to_unit": scale,
                "offset": self.offset + volts_at_zero * self.volts_to_unit,
                "u": self.u if relative is None else {**self.u, "counts_to_unit": relative * abs(scale)},
            }
        )


class RecorderTable(Port):
    """`identity`: what the recorder's identity has to contain. `trigger_level`: in the unit of channel 1; if it is not
    given, 2 % of its range. `wait_s`: how long an armed recorder waits for its trigger."""

    identity: str | None = None
    sample_rate_Hz: Positive = 1e6
    samples: Annotated[int, Field(gt=0)] = 5000
    pretrigger: Annotated[int, Field(ge=0)] = 500
    trigger_level: Finite | None = None
    trigger_slope: Literal["POS", "NEG"] = "POS"
    wait_s: Positive = 120.0
    channel: Annotated[list[Channel], Field(min_length=1, max_length=4)]

    @model_validator(mode="after")
    def _window_and_trigger(self) -> "RecorderTable":
        if self.pretrigger >= self.samples:
            raise ValueError(f"pretrigger has to be below samples ({self.samples}), not {self.pretrigger}")
        first = self.channel[0]
        if first.quantity != "force":
            raise ValueError(f"channel 1 triggers the recorder and has to be the force, not {first.quantity}")
        if self.trigger_level is None and first.range is None:
            raise ValueError("give trigger_level, or the range of channel 1 to take 2 % of")
        return self


class GateTable(Port):
    """The photodetector. `gap_mm`: from the beam to contact. `edge_mm`, `clock_us`: standard uncertainty of an edge,
    resolution of its time. `wait_s`: how long after the record the edges of the rebound are waited for."""

    flag_width_mm: Positive
    gap_mm: NotNegative | None = None
    edge_mm: NotNegative = 0.03
    clock_us: Positive = 1.0
    wait_s: NotNegative = 0.0


class InterlockTable(Port):
    """The interlock. `wait_s`: how long arming waits for it to allow a drop."""

    wait_s: NotNegative = 0.0


class TowerTable(Table):
    """`mass_kg`: dart masses of this tower by name; `friction_N`: guide friction against the motion."""

    g: Positive | None = None
    mass_kg: dict[str, Positive] = Field(default_factory=dict)
    catcher: bool = False
    friction_N: NotNegative = 0.0


class RigFile(BaseModel):
    """One rig, as its owner wrote it."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    recorder: RecorderTable
    gate: GateTable | None = None
    interlock: InterlockTable | None = None
    tower: TowerTable = Field(default_factory=TowerTable)


def load_rig(path: Path) -> tuple[RigFile, str]:
    """The rig file at `path` and its text.

    Raises
    ------
    SettingsError : unknown or missing key, a value outside its limits, not TOML.
    """
    text = read_text(path)
    rig = parse(text, RigFile, str(path))
    own = {
        name: port.model_copy(update={"profile": str(path.parent / port.profile)})
        for name in ("recorder", "gate", "interlock")
        if (port := getattr(rig, name)) is not None and port.profile.endswith(".toml")
    }
    return rig.model_copy(update=own), text
