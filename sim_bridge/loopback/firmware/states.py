"""States and settings of a device: their values, and the commands that read or set them.

`states.yaml` lists the first values of all events, bounds included. A command that is named after
an event (`rth.set_delay` and `rth.delay`, `ASettings.X` and `ASettingsState.XChanged`) sets it; the
file lists the commands that differ.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from copy import deepcopy
from functools import cache
from importlib import resources
from typing import Any, Final

import yaml

from sim_bridge.loopback.codec import Message, Values, encode, message_types

Sink = Callable[[bytes, bool], None]  # sends an encoded event; whether it is to be acknowledged

DEVICES: Final = frozenset({"cam_id", "gimbal_id"})  # arguments; there is only number 0 of each

_SETTINGS: Final = "SettingsState"  # suffix of the classes whose states are settings


class States:
    """Keeps the values of all events, and sends them to the client when they change."""

    def __init__(self, device: str, project: str) -> None:
        """Read a section of the file; commands of `project` ask for all states of the device."""
        self._first: dict[str, list[dict[str, Any]]] = {
            event: values if isinstance(values, list) else [values]
            for event, values in deepcopy(_content()[device]).items()
        }
        self._rows = deepcopy(self._first)  # one, or all entries of a list
        self._project = project
        self.sink: Sink | None = None  # None while no client is connected

    def value(self, event: str, argument: str = "current") -> Any:
        """Return the value of an event's argument."""
        return self._rows[event][0][argument]

    def begin(self, event: str, /, **values: Any) -> None:
        """Store the first values of an event's arguments, which a reset restores."""
        self._first[event] = [values]
        self._rows[event] = [dict(values)]

    def set(self, event: str, /, **changes: Any) -> None:
        """Change values of an event (of the first entry of a list), and send it if they differ."""
        before = self._rows[event][0]
        if {**before, **changes} != before:
            self.refresh(event, **changes)

    def refresh(self, event: str, /, **changes: Any) -> None:
        """Change values of an event and send it even if they are the same."""
        self._rows[event][0].update(changes)
        self._send(event)

    def notify(self, event: str, /, **values: Any) -> None:
        """Send an event that is not kept for later clients."""
        if self.sink is not None:
            self.sink(encode(event, values), message_types()[event].buffer != "noack")

    def answer(self, command: Message) -> bool:
        """Execute a command that only reads or sets states; return whether it is one."""
        match command.name.removeprefix(f"{self._project}."):
            case "Common.AllStates":
                self._replay(settings=False)
                self.notify(f"{self._project}.CommonState.AllStatesChanged")
            case "Settings.AllSettings":
                self._replay(settings=True)
                self.notify(f"{self._project}.SettingsState.AllSettingsChanged")
            case "Settings.Reset":
                self._reset()
                self.notify(f"{self._project}.SettingsState.ResetChanged")
            case _:
                return self._take(command)
        return True

    def _take(self, command: Message) -> bool:
        event, takes = self._setting(command.name)
        if not takes:
            return False
        row = self._rows[event][0]
        taken = {
            shown: _within(row, shown, command.values[given]) for shown, given in takes.items()
        }
        self.refresh(event, **taken)
        return True

    def _setting(self, command: str) -> tuple[str, dict[str, str]]:
        """Return the event that a command sets, and its argument for each of the event's."""
        differing = dict(_content()["commands"].get(command, {}))
        where, _, name = command.rpartition(".")
        same = f"{where}State.{name}Changed"
        if "." not in where:
            same = f"{where}.{name.removeprefix('set_')}"
        event = differing.pop("event", same)
        given = {argument.name for argument in message_types()[command].arguments} - DEVICES
        shown = {name: differing.get(name, name) for name in self._rows.get(event, [{}])[0]}
        return event, {name: argument for name, argument in shown.items() if argument in given}

    def _reset(self) -> None:
        for command, message in message_types().items():
            if not message.event:
                event, takes = self._setting(command)
                if takes:
                    self.refresh(event, **self._first[event][0])

    def _replay(self, *, settings: bool) -> None:
        for event in self._rows:
            parts = event.split(".")
            if (len(parts) == 3 and parts[1].endswith(_SETTINGS)) is settings:
                self._send(event)

    def _send(self, event: str) -> None:
        for row in self._rows[event]:
            self.notify(event, **row)


@cache
def _content() -> Mapping[str, Any]:
    path = resources.files("sim_bridge.loopback.firmware") / "states.yaml"
    content: Mapping[str, Any] = yaml.safe_load(path.read_text(encoding="utf-8"))
    return content


def _within(row: Values, name: str, value: Any) -> Any:
    """Return a value limited to the bounds of its event; NaN keeps the present value."""
    if isinstance(value, float) and math.isnan(value):
        return row[name]
    axis = name.removeprefix("current_")
    for low, top in (
        ("min", "max"),
        (f"{name}_min", f"{name}_max"),
        (f"min_bound_{axis}", f"max_bound_{axis}"),
    ):
        if low in row:
            return max(row[low], min(row[top], value))
    return value
