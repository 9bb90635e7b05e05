"""Profiles: what a device says and understands, as TOML, so that foreign gear needs no code (docs/profiles.md)."""

import re
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from daq.errors import SettingsError
from daq.template import places
from daq.toml_file import parse, read_text

SHIPPED = Path(__file__).parent / "profiles"
_TIMES = {"interval_s", "interval_ns", "rate_Hz", "delay_s", "delay_ns"}
READ_BACK = _TIMES | {"points", "pretrigger", "level", "source", "slope"}
SETTINGS = READ_BACK | {"pretrigger_s", "window_s", "center_s"}
"""What a setting command may hold: the window is that of the record, its centre is against the trigger."""
SPAN = {"channel", "start", "count", "first", "last"}
ACKNOWLEDGEMENT = {"record", "crc"}

Patience = Annotated[float, Field(gt=0, le=60)]
"""s, how long the first byte of a reply is waited for."""
Sample = Literal["i8", "u8", "i16", "u16"]
Number = Literal["u16", "i16", "u32", "i32", "u64", "i64", "f32"]
State = Literal["idle", "filling", "armed", "measuring", "complete"]
SCPI_STATUS = {"condition", "boot", "held", "last", "config_hash"}
SCPI_HEADER = {
    "-", "record", "boot", "config_hash", "points", "interval_ns", "first_ns", "trigger_us", "bits", "channels", "crcs",
    "x_increment_s", "x_origin_s", "x_reference", "y_increment", "y_origin", "y_reference",
}  # fmt: skip
REGISTERS = {
    "sentinel", "at_once", "identity", "condition", "state", "boot", "held", "last", "config_hash", "interlock", "beam",
    "error", "crc", "gate_record", "gate_count", "gate_edges_ns", "gate_passages", "gate_blocked_s", "y_increment",
    "y_origin", *(f"record{k}" for k in ("", "_boot", "_hash", "_points", "_interval_ns", "_first_ns", "_trigger_us")),
    "record_bits", "record_channels", "record_crcs", *READ_BACK,
}  # fmt: skip


class Part(BaseModel):
    """A table of a profile."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Query(Part):
    """A query of one value: the field of its reply, parted by commas, and a factor."""

    query: str
    field: Annotated[int, Field(ge=0)] = 0
    scale: float = 1.0


def _as_query(given: Any) -> Any:
    return {"query": given} if isinstance(given, str) else given


AnyQuery = Annotated[Query, BeforeValidator(_as_query)]
Words = dict[str, dict[str, str]]


def _check(what: str, templates: list[str], allowed: set[str]) -> None:
    for template in templates:
        if unknown := places(template) - allowed:
            raise ValueError(
                f"{what}: {template!r} has no {{{sorted(unknown)[0]}}}; there is {', '.join(sorted(allowed))}"
            )


class ScpiStatus(Part):
    """How the recorder tells its state: numbers in `fields`, or one word that `states` translates."""

    query: str
    fields: list[str] | None = None
    states: dict[str, State] | None = None

    @model_validator(mode="after")
    def _one_of_both(self) -> "ScpiStatus":
        if (self.fields is None) == (self.states is None):
            raise ValueError("give one of fields and states")
        if self.fields is not None and (wrong := set(self.fields) ^ SCPI_STATUS):
            raise ValueError(f"fields are {', '.join(sorted(SCPI_STATUS))}, each once; see {sorted(wrong)[0]!r}")
        return self


class ScpiHeader(Part):
    """What the recorder says of its record; `commands` go out before, once a channel.

    bits, interval_ns, first_ns : what it does not say and always is so
    """

    query: str
    fields: list[str]
    commands: list[str] = Field(default_factory=list[str])
    bits: Annotated[int, Field(ge=4, le=16)] | None = None
    interval_ns: Annotated[int, Field(gt=0)] | None = None
    first_ns: int | None = None

    @model_validator(mode="after")
    def _enough(self) -> "ScpiHeader":
        if unknown := set(self.fields) - SCPI_HEADER:
            raise ValueError(f"field {sorted(unknown)[0]!r} is not known; known are {', '.join(sorted(SCPI_HEADER))}")
        told = set(self.fields) | {key for key in ("bits", "interval_ns", "first_ns") if getattr(self, key) is not None}
        for needed in (("points",), ("interval_ns", "x_increment_s"), ("first_ns", "x_origin_s"), ("bits",)):
            if not set(needed) & told:
                raise ValueError(f"needs the field {' or '.join(needed)}; what the recorder does not say is a key here")
        _check("commands", [*self.commands, self.query], {"channel"})
        return self

    @property
    def scaled(self) -> bool:
        """Whether it says what a count is in volts."""
        return "y_increment" in self.fields


class ScpiData(Part):
    """How samples are asked for and what they look like. `base`: the number of the first sample."""

    query: str
    commands: list[str] = Field(default_factory=list[str])
    form: Literal["block", "ascii"] = "block"
    type: Sample = "i16"
    order: Literal["sentinel", "high-first", "low-first"] = "high-first"
    sentinel: str | None = None
    most: Annotated[int, Field(ge=1000)]
    base: Literal[0, 1] = 0

    @model_validator(mode="after")
    def _whole(self) -> "ScpiData":
        if (self.order == "sentinel") != (self.sentinel is not None):
            raise ValueError('order = "sentinel" and the query sentinel belong together')
        _check("query", [self.query, *self.commands], SPAN)
        return self


class ScpiGate(Part):
    """The photodetector: edges on the recorder's clock, and the beam."""

    query: str | None = None
    fields: list[Literal["record", "count", "edges_ns"]] = ["record", "count", "edges_ns"]
    beam: str | None = None


class ScpiInterlock(Part):
    """The interlock: its bits as in the device protocol."""

    query: str


class ScpiProfile(Part):
    """An SCPI device. `level`: what the trigger level is given in."""

    driver: Literal["scpi"]
    tried_on: str
    patience_s: Patience = 1.0
    identity: str = "*IDN?"
    errors: str | None = None
    level: Literal["counts", "volts"] = "counts"
    configure: list[str] = Field(default_factory=list[str])
    arm: list[str] = Field(default_factory=list[str])
    abort: list[str] = Field(default_factory=list[str])
    acknowledge: list[str] = Field(default_factory=list[str])
    crc: str | None = None
    settings: dict[str, AnyQuery] = Field(default_factory=dict[str, Query])
    words: Words = Field(default_factory=Words)
    status: ScpiStatus | None = None
    header: ScpiHeader | None = None
    data: ScpiData | None = None
    gate: ScpiGate | None = None
    interlock: ScpiInterlock | None = None

    @model_validator(mode="after")
    def _templates(self) -> "ScpiProfile":
        _check("configure", self.configure, SETTINGS)
        _check("arm, abort", [*self.arm, *self.abort], set())
        _check("acknowledge", self.acknowledge, ACKNOWLEDGEMENT)
        _check("crc", [self.crc or ""], SPAN)
        _known("settings", set(self.settings), READ_BACK)
        _known("words", set(self.words), {"source", "slope"})
        if any((self.status, self.header, self.data, self.arm)) and not all(
            (self.status, self.header, self.data, self.arm, self.abort)
        ):
            raise ValueError("a recorder needs arm, abort, [status], [header] and [data], all of them")
        return self

    @property
    def is_recorder(self) -> bool:
        return self.data is not None

    @property
    def scaled(self) -> bool:
        """Whether the recorder says what a count is in volts."""
        return self.header is not None and self.header.scaled

    @property
    def keeps_records(self) -> bool:
        """Whether the recorder counts its records and keeps each until it is acknowledged."""
        return bool(self.acknowledge) and self.status is not None and self.status.fields is not None

    @property
    def has_crc(self) -> bool:
        return self.crc is not None


def _known(what: str, given: set[str], known: set[str]) -> None:
    if unknown := given - known:
        raise ValueError(f"{what}: {sorted(unknown)[0]!r} is not known; known are {', '.join(sorted(known))}")


class Register(Part):
    """Where a value is read: first register, type, function code, how many of it, factor, and what it must be."""

    at: Annotated[int, Field(ge=0, le=65535)]
    type: Number | Literal["text"]
    function: Literal[3, 4] = 4
    length: Annotated[int, Field(ge=1, le=125)] = 1
    scale: float = 1.0
    value: int | None = None

    @property
    def size(self) -> int:
        """Registers that it takes."""
        return self.length * {"u16": 1, "i16": 1, "text": 1, "u64": 4, "i64": 4}.get(self.type, 2)


class Write(Part):
    """Registers written in one request: `name:type`, or `number:type`, from `at` on."""

    at: Annotated[int, Field(ge=0, le=65535)]
    values: list[Annotated[str, Field(pattern=r"^\w+:(u16|i16|u32|i32|u64|i64|f32)$")]]


_ALLOWED = {"configure": SETTINGS, "acknowledge": ACKNOWLEDGEMENT, "span": SPAN, "page": SPAN}


def _check_writes(what: str, writes: list[Write]) -> None:
    for name in (value.partition(":")[0] for write in writes for value in write.values):
        if not re.fullmatch(r"\d+", name) and name not in (allowed := _ALLOWED.get(what, set[str]())):
            raise ValueError(
                f"{what}: {name!r} is neither a number nor one of {', '.join(sorted(allowed)) or 'nothing'}"
            )


class ModbusData(Part):
    """The window on the record: `page` moves it to `start`; without it the whole record has to lie in the window."""

    at: Annotated[int, Field(ge=0, le=65535)]
    type: Literal["i16", "u16"] = "i16"
    function: Literal[3, 4] = 4
    page: list[Write] = Field(default_factory=list[Write])
    page_samples: Annotated[int, Field(ge=125, le=65536)]
    per_read: Annotated[int, Field(ge=1, le=125)] = 125
    channel_step: Annotated[int, Field(ge=0, le=65535)] = 0

    @model_validator(mode="after")
    def _in_the_map(self) -> "ModbusData":
        if self.at + self.page_samples > 0x10000:
            raise ValueError(f"page_samples from {self.at} on run past register 65535")
        _check_writes("page", self.page)
        return self


class ModbusProfile(Part):
    """A Modbus device. `order`: of the words of a value; `at_once`: requests it takes in flight, on TCP."""

    driver: Literal["modbus"]
    tried_on: str
    patience_s: Patience = 1.0
    order: Literal["sentinel", "high-first", "low-first"] = "high-first"
    at_once: Annotated[int, Field(ge=1, le=16)] = 1
    bits: Annotated[int, Field(ge=4, le=16)] = 16
    level: Literal["counts", "volts"] = "counts"
    registers: dict[str, Register]
    states: dict[str, State] = Field(default_factory=dict[str, State])
    words: Words = Field(default_factory=Words)
    writes: dict[Literal["configure", "arm", "abort", "acknowledge", "clear_errors", "span"], list[Write]] = Field(
        default_factory=dict
    )
    data: ModbusData | None = None

    @model_validator(mode="after")
    def _complete(self) -> "ModbusProfile":
        _known("registers", set(self.registers), REGISTERS)
        _known("words", set(self.words), {"source", "slope"})
        for what, writes in self.writes.items():
            _check_writes(what, writes)
        if self.order == "sentinel" and getattr(self.registers.get("sentinel"), "value", None) is None:
            raise ValueError('order = "sentinel" needs the register sentinel with the value that it holds')
        if ("state" in self.registers) != bool(self.states):
            raise ValueError("the register state and the table [states] belong together")
        if self.data is not None:
            missing = {"record_points", "record_interval_ns"} - set(self.registers)
            missing |= {"arm", "abort"} - set(self.writes)
            if not {"condition", "state"} & set(self.registers):
                missing.add("condition or state")
            if missing:
                raise ValueError(f"a recorder needs {', '.join(sorted(missing))} too")
        return self

    @property
    def is_recorder(self) -> bool:
        return self.data is not None

    @property
    def scaled(self) -> bool:
        """Whether the recorder says what a count is in volts."""
        return "y_increment" in self.registers

    @property
    def keeps_records(self) -> bool:
        """Whether the recorder counts its records and keeps each until it is acknowledged."""
        needed = {"condition", "boot", "held", "last", "config_hash", "record", "record_boot", "record_hash"}
        return "acknowledge" in self.writes and needed <= set(self.registers)

    @property
    def has_crc(self) -> bool:
        return "crc" in self.registers and "span" in self.writes


Profile = ScpiProfile | ModbusProfile


def shipped() -> list[str]:
    """Names of the profiles that come with droptower."""
    return sorted(item.name.removesuffix(".toml") for item in SHIPPED.iterdir() if item.name.endswith(".toml"))


def load_profile(name: str, driver: str) -> tuple[Profile, str]:
    """A shipped profile by its name, or one's own by its path, and its text.

    Raises
    ------
    SettingsError : there is none, something in it is wrong, or it is for another driver.
    """
    if name.endswith(".toml"):
        text, where = read_text(Path(name)), name
    elif name in shipped():
        text, where = (SHIPPED / f"{name}.toml").read_text(encoding="utf-8"), f"profile {name}"
    else:
        raise SettingsError(
            f"profile {name!r} is not known: give one of {', '.join(shipped())}, or a path to FILE.toml"
        )
    profile = parse(text, ScpiProfile if driver == "scpi" else ModbusProfile, where)
    return profile, text
