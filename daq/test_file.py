"""The test file: dart, specimen, support and drop, with a standard uncertainty for any number."""

from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, model_validator

from daq.toml_file import parse, read_text, validate

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]


def _is_number(annotation: Any) -> bool:
    parts = (annotation, *get_args(annotation))
    return float in parts or any(float in get_args(p) for p in parts if get_origin(p) is Annotated)


class Table(BaseModel):
    """A table of the file; `u` holds the standard uncertainty of its numbers, by key, in the key's own unit."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    u: dict[str, float] = Field(default_factory=dict)

    @model_validator(mode="before")
    @classmethod
    def _take_uncertainties(cls, tree: Any) -> Any:
        """Move each `u_<key>` whose key is a number of this table into `u`."""
        if not isinstance(tree, dict):
            return tree
        rest: dict[str, Any] = {}
        u: dict[str, float] = dict(tree.get("u", {}))
        numbers = {n for n, f in cls.model_fields.items() if _is_number(f.annotation)}
        for key, value in tree.items():
            if key == "u":
                continue
            if key.startswith("u_") and key[2:] in numbers:
                if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value < float("inf"):
                    raise ValueError(f"{key}: a standard uncertainty is a number of 0 or more, not {value!r}")
                u[key[2:]] = float(value)
            else:
                rest[key] = value
        return {**rest, "u": u}


class Dart(Table):
    mass_kg: Positive
    tip_radius_mm: Positive
    tip_mass_kg: NotNegative = 0.0
    range_N: Positive | None = None
    tip_E_GPa: Positive | None = None
    tip_nu: Annotated[float, Field(gt=-1, lt=0.5)] = 0.3

    @model_validator(mode="after")
    def _tip_is_part_of_the_dart(self) -> "Dart":
        if self.tip_mass_kg >= self.mass_kg:
            raise ValueError(f"tip_mass_kg is part of mass_kg and has to be below {self.mass_kg}")
        return self


class Specimen(Table):
    thickness_mm: Positive
    nu: Annotated[float, Field(gt=-1, lt=0.5)]
    id: str | None = None
    material: str | None = None
    shape: Literal["plate", "lens", "other"] = "plate"
    diameter_mm: Positive | None = None
    stack_mm: list[Positive] | None = None
    E_static_GPa: Positive | None = None
    yield_MPa: Positive | None = None


class Support(Table):
    kind: Literal["ring", "rigid"]
    radius_mm: Positive | None = None

    @model_validator(mode="after")
    def _ring_has_a_radius(self) -> "Support":
        if self.kind == "ring" and self.radius_mm is None:
            raise ValueError("a ring support needs the key 'radius_mm'")
        return self


class Drop(Table):
    v0: Positive | None = None
    height_mm: Positive | None = None
    energy_J: Positive | None = None
    catcher: bool = False

    @model_validator(mode="after")
    def _one_route(self) -> "Drop":
        if self.v0 is not None and self.height_mm is not None:
            raise ValueError("give v0 or height_mm, not both")
        return self


class Environment(Table):
    temperature_C: Annotated[float, Field(gt=-273.15)] | None = None
    humidity_pct: Annotated[float, Field(ge=0, le=100)] | None = None
    g: Positive | None = None


class Operator(Table):
    name: str | None = None
    batch: str | None = None
    note: str | None = None


class Measured(Table):
    """What is seen on the specimen after the test; `failed` and `failure_type` (ISO 6603-2) overrule the record's."""

    imprint_diameter_mm: NotNegative | None = None
    imprint_depth_um: NotNegative | None = None
    failed: bool | None = None
    failure_type: Literal["YD", "YS", "YU", "NY"] | None = None


class ImportChannel(Table):
    """A column of a file to import that does not carry a force or its unit in its name.

    `scale` is in `unit` per unit of the column (N per volt, say).
    """

    column: str
    quantity: Literal["force", "acceleration", "displacement"]
    unit: str
    scale: Finite = 1.0
    offset: Finite = 0.0
    time_constant_s: Positive | None = None

    @model_validator(mode="after")
    def _scale_is_not_zero(self) -> "ImportChannel":
        if self.scale == 0:
            raise ValueError("scale is 0: every sample would be lost")
        return self


class ImportTable(Table):
    channel: list[ImportChannel] = Field(default_factory=list[ImportChannel])


class TestFile(BaseModel):
    """One drop's conditions, as the operator wrote them."""

    __test__ = False  # not a pytest class
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    dart: Dart
    specimen: Specimen
    support: Support
    drop: Drop = Field(default_factory=Drop)
    environment: Environment = Field(default_factory=Environment)
    operator: Operator = Field(default_factory=Operator)
    measured: Measured = Field(default_factory=Measured)
    import_: ImportTable = Field(default_factory=ImportTable, alias="import")


def load_test(path: Path) -> tuple[TestFile, str]:
    """The test file at `path` and its text; the specimen's id defaults to the file's stem.

    Raises
    ------
    SettingsError : unknown or missing key, a value outside its limits, not TOML.
    """
    text = read_text(path)
    test = parse(text, TestFile, str(path))
    return (override(test, {"specimen.id": path.stem}, str(path)) if test.specimen.id is None else test), text


def override(test: TestFile, values: dict[str, Any], name: str) -> TestFile:
    """The same test with other values, by dotted key (`dart.mass_kg`, `drop.u_v0`).

    Raises
    ------
    SettingsError : as `load_test`; `name` says where the values come from.
    """
    tree = test.model_dump(by_alias=True, exclude_none=True)
    if "drop.v0" in values:
        tree["drop"].pop("height_mm", None)
    if "drop.height_mm" in values:
        tree["drop"].pop("v0", None)
    for dotted, value in values.items():
        table, _, key = dotted.partition(".")
        branch = tree.setdefault(table, {}) if key else tree
        branch[key or table] = value
    return validate(tree, TestFile, name)
