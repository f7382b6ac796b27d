"""What the drone has told: each event goes to the client, and states are kept for the next one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final

from sim_bridge.loopback.codec import encode
from sim_bridge.loopback.messages import Memory, MessageTable, MessageType

__all__ = ["Announcer", "Sink"]

Sink = Callable[[MessageType, bytes], None]

_SETTINGS: Final = "SettingsState"  # how classes are named whose states are settings
_FLAGS: Final = "list_flags"


class Announcer:
    """Encodes events, sends them where there is a client, and remembers the states."""

    def __init__(self, table: MessageTable) -> None:
        self._table = table
        self._memory: dict[tuple[str, Any], bytes] = {}
        self.sink: Sink | None = None  # None while no client is connected

    def state(self, name: str, /, **values: Any) -> None:
        """Tell a state where it is news."""
        message = self._table.named(name)
        payload, key = encode(message, values), _key(message, values)
        if self._memory.get(key) != payload:
            self._memory[key] = payload
            self._send(message, payload)

    def repeat(self, name: str, /, **values: Any) -> None:
        """Tell a state, news or not: it comes regularly, or a client has just asked for it."""
        message = self._table.named(name)
        payload = encode(message, values)
        self._memory[_key(message, values)] = payload
        self._send(message, payload)

    def note(self, name: str, /, **values: Any) -> None:
        """Tell what has happened; nobody is told later."""
        message = self._table.named(name)
        self._send(message, encode(message, values))

    def entries(self, name: str, entries: Iterable[Mapping[str, Any]]) -> None:
        """Tell all entries of a list or a map, or that there are none."""
        message = self._table.named(name)
        for old in [key for key in self._memory if key[0] == name]:
            del self._memory[old]
        rows = [dict(entry) for entry in entries]
        flagged = any(argument.name == _FLAGS for argument in message.arguments)
        for index, row in enumerate(rows):
            if flagged:
                ends = {"First": index == 0, "Last": index == len(rows) - 1}
                row[_FLAGS] = {flag for flag, here in ends.items() if here}
            payload = encode(message, row)
            self._memory[name, index] = payload
            self._send(message, payload)

    def replay(self, *, settings: bool) -> None:
        """Tell a newcomer all states that are settings, or all that are not."""
        for (name, _), payload in self._memory.items():
            parts = name.split(".")
            if (len(parts) == 3 and parts[1].endswith(_SETTINGS)) is settings:
                self._send(self._table.named(name), payload)

    def _send(self, message: MessageType, payload: bytes) -> None:
        if self.sink is not None:
            self.sink(message, payload)


def _key(message: MessageType, values: Mapping[str, Any]) -> tuple[str, Any]:
    if message.memory is Memory.MAP and message.key is not None:
        return message.name, values[message.key]
    return message.name, None
