"""The control endpoint: what a hand does at a tower, as JSON lines over TCP."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import Awaitable, Callable
from dataclasses import asdict, replace
from typing import Any

from sim_device.acquisition import State
from sim_device.device import Device, log
from sim_device.fault import Fault
from sim_device.faults import Faults
from sim_device.scpi_commands import SCPI
from sim_device.settings import SettingError, changed, nearest
from sim_device.tower import Refused

LONGEST_REQUEST = 1 << 16

Answer = dict[str, Any]


class Control:
    """Answers requests; each is one object with ``do`` and the keys that belong to it."""

    def __init__(self, device: Device) -> None:
        """Act on ``device`` and its tower."""
        self._device, self._tower = device, device.tower
        self._requests: dict[str, Callable[[Answer], Answer | Awaitable[Answer]]] = {
            "specimen": lambda keys: self._part("specimen", keys),
            "dart": lambda keys: self._part("dart", keys),
            "sensor": lambda keys: self._part("sensor", keys),
            "second_sensor": lambda keys: self._part("second_sensor", keys),
            "displacement": lambda keys: self._part("displacement", keys),
            "accelerometer": lambda keys: self._part("accelerometer", keys),
            "recorder": lambda keys: self._part("recorder", keys),
            "gate": lambda keys: self._part("gate", keys),
            "height": self._height,
            "catcher": lambda keys: self._switch("catcher", "on", keys),
            "door": lambda keys: self._switch("door_open", "open", keys),
            "release": self._release,
            "tap": self._tap,
            "fault": self._fault,
            "clear": self._clear,
            "status": self._status,
            "reset": self._reset,
        }

    async def answer(self, line: bytes) -> Answer:
        """The answer to one request line."""
        try:
            request = json.loads(line)
            if not isinstance(request, dict):
                raise SettingError("a request is a JSON object")
            keys: dict[str, Any] = dict(request)  # pyright: ignore[reportUnknownArgumentType]  whatever JSON holds
            do = keys.pop("do", None)
            if not isinstance(do, str) or do not in self._requests:
                raise SettingError("do: " + nearest(str(do), list(self._requests)))
            reply = self._requests[do](keys)
            return {"ok": True} | (reply if isinstance(reply, dict) else await reply)
        except (SettingError, Refused, ValueError) as error:
            return {"ok": False, "error": str(error)}

    def _part(self, name: str, keys: Answer) -> Answer:
        rig = self._tower.rig
        self._tower.rig = replace(rig, **{name: changed(getattr(rig, name), keys)})
        log(f"{name}: {keys}")
        return {}

    def _height(self, keys: Answer) -> Answer:
        for key in keys:
            if key not in ("height_mm", "v0"):
                raise SettingError(nearest(key, ["height_mm", "v0"]))
        if len(keys) != 1:
            raise SettingError("height takes one of height_mm and v0")
        return self._part("drop", keys)

    def _switch(self, setting: str, key: str, keys: Answer) -> Answer:
        for name in keys:
            if name != key:
                raise SettingError(nearest(name, [key]))
        if not isinstance(keys.get(key), bool):
            raise SettingError(f"{key} must be true or false")
        return self._part("drop", {setting: keys[key]})

    async def _release(self, keys: Answer) -> Answer:
        _none(keys)
        number, truth = await self._tower.release()
        return {"drop": number, "truth": truth}

    def _tap(self, keys: Answer) -> Answer:
        peak = keys.pop("peak_N", 100)
        _none(keys)
        if isinstance(peak, bool) or not isinstance(peak, int | float) or not 1 <= abs(peak) <= 1e5:
            raise SettingError(f"peak_N must be 1 to 1e5 in magnitude, not {peak!r}")
        self._tower.tap(peak)
        return {}

    def _fault(self, keys: Answer) -> Answer:
        fault = set_fault(self._device.faults, keys)
        log(f"fault set: {fault.name}")
        return {}

    def _clear(self, keys: Answer) -> Answer:
        name = keys.pop("name", None)
        _none(keys)
        return {"removed": self._device.faults.clear(name)}

    def _reset(self, keys: Answer) -> Answer:
        _none(keys)
        self._device.power_cycle()
        return {"boot": self._device.memory.boot}

    def _status(self, keys: Answer) -> Answer:
        _none(keys)
        recorder, tower = self._device.recorder, self._tower
        return {
            "state": State(recorder.state).name.lower(),
            "boot": self._device.memory.boot,
            "held": self._device.held_id,
            "captured": recorder.captured,
            "moving": tower.moving,
            "interlock": tower.interlock,
            "settings": asdict(tower.rig),
            "faults": self._device.faults.report(),
            "drops": tower.drops,
            "truth": tower.last_truth,
        }

    async def serve_client(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """One client, until it goes."""
        with contextlib.suppress(ConnectionError, asyncio.CancelledError):
            while True:
                try:
                    line = await reader.readuntil(b"\n")
                except asyncio.IncompleteReadError:
                    break
                except asyncio.LimitOverrunError:
                    writer.write(b'{"ok": false, "error": "the request is too long"}\n')
                    break
                if line.strip():
                    writer.write(json.dumps(await self.answer(line)).encode() + b"\n")
                    await writer.drain()
        writer.close()


def set_fault(faults: Faults, keys: Answer) -> Fault:
    """Set a fault of a request or a scenario file; its command in any spelling.

    Raises
    ------
    SettingError
        Unknown fault, option or command, or a value beyond its limits.
    """
    keys = dict(keys)
    name = keys.pop("name", None)
    if isinstance(command := keys.get("command"), str):
        known = SCPI.find(command)
        if known is None and not (command[:2] == "FC" and command[2:].isdigit()):
            raise SettingError(f'command {command!r} is neither an SCPI header nor a Modbus function like "FC04"')
        keys["command"] = command if known is None else known.name
    elif command is not None:
        raise SettingError("command must be text")
    return faults.add(name, keys)


def _none(keys: Answer) -> None:
    for key in keys:
        raise SettingError(f"{key!r}: this request takes no keys")
