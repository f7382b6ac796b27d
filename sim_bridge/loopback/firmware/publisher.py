"""Publisher of events: sends each to the client and stores states for later clients."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final

from sim_bridge.loopback.codec import encode
from sim_bridge.loopback.messages import Memory, MessageTable, MessageType
from sim_bridge.loopback.world import WorldState

Values = Mapping[str, Any]
Handler = Callable[[Values, WorldState], None]  # executes one command
Sink = Callable[[MessageType, bytes], None]

_SETTINGS: Final = "SettingsState"  # suffix of the classes whose states are settings
_FLAGS: Final = "list_flags"


class Publisher:
    """Encodes events, sends them to a connected client, and stores the states.

    Args:
        table: the known messages.
    """

    def __init__(self, table: MessageTable) -> None:
        self._table = table
        self._memory: dict[tuple[str, Any], bytes] = {}
        self.sink: Sink | None = None  # None while no client is connected

    def state(self, name: str, /, **values: Any) -> None:
        """Publish a state if it has changed.

        Args:
            name: name of the event.
            values: all arguments, by name.
        """
        message = self._table.named(name)
        payload, key = encode(message, values), _key(message, values)
        if self._memory.get(key) != payload:
            self._memory[key] = payload
            self._send(message, payload)

    def refresh(self, name: str, /, **values: Any) -> None:
        """Publish a state even if it has not changed: periodically, or as an answer to a command.

        Args:
            name: name of the event.
            values: all arguments, by name.
        """
        message = self._table.named(name)
        payload = encode(message, values)
        self._memory[_key(message, values)] = payload
        self._send(message, payload)

    def notify(self, name: str, /, **values: Any) -> None:
        """Publish a notification, which is not stored for later clients.

        Args:
            name: name of the event.
            values: all arguments, by name.
        """
        message = self._table.named(name)
        self._send(message, encode(message, values))

    def entries(self, name: str, entries: Iterable[Values]) -> None:
        """Publish all entries of a list or a map; they replace earlier ones.

        Args:
            name: name of the event.
            entries: arguments of each entry, without the flags of the first and the last.
        """
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
        """Send a new client all settings, or all other states."""
        for (name, _), payload in self._memory.items():
            parts = name.split(".")
            if (len(parts) == 3 and parts[1].endswith(_SETTINGS)) is settings:
                self._send(self._table.named(name), payload)

    def _send(self, message: MessageType, payload: bytes) -> None:
        if self.sink is not None:
            self.sink(message, payload)


def _key(message: MessageType, values: Values) -> tuple[str, Any]:
    if message.memory is Memory.MAP and message.key is not None:
        return message.name, values[message.key]
    return message.name, None
