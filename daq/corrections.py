"""Corrections of a run's test file: small TOML files beside it, each with author and reason, written once, applied in
order over what raw.h5 holds. The record itself never changes.
"""

import json
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from daq.errors import SettingsError, StoreError
from daq.run import RunData, now, resolve_g
from daq.test_file import override


def correction_text(run: str, values: Mapping[str, Any], author: str, reason: str) -> str:
    """A correction as its file has it; `values` by dotted key (`measured.failure_type`)."""
    # TOML's strings, numbers and truth values are written as JSON's are.
    rows = [f"{json.dumps(key)} = {json.dumps(value, ensure_ascii=False)}" for key, value in values.items()]
    head = {"author": author, "reason": reason, "at": now()}
    facts = [f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in head.items()]
    return "\n".join([f"# Correction of the test file of run {run}.", *facts, "", "[set]", *rows, ""])


def corrected(run: RunData, texts: Sequence[tuple[str, str]]) -> RunData:
    """The run with its corrections, (name, text) each, applied; they stand in its provenance.

    Raises
    ------
    StoreError : a correction cannot be read; the text names its file.
    """
    if not texts:
        return run
    test = run.test
    for name, text in texts:
        try:
            test = override(test, tomllib.loads(text)["set"], name)
        except (tomllib.TOMLDecodeError, KeyError, TypeError, SettingsError) as e:
            raise StoreError(
                f"correction {name} of run {run.run} cannot be applied: {e}; move it away, the record is whole"
            ) from None
    g, source = resolve_g(test, run.rig)
    provenance = {**run.provenance, "corrections": [text for _, text in texts]}
    return replace(run, test=test, g=g, g_source=source, provenance=provenance)


def value_of(text: str) -> Any:
    """What stands behind the = of `--set key=value`: as TOML has it, else a word."""
    try:
        return tomllib.loads(f"v = {text}")["v"]
    except tomllib.TOMLDecodeError:
        return text
