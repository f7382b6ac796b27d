"""The variables of a tree: one scope per tree, with doors to the tree that contains it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from uav_bt.errors import did_you_mean

__all__ = ["Entry", "Variables"]


@dataclass
class Entry:
    """A variable. `writes` counts how often it was written, so that a change can be noticed."""

    value: Any
    writes: int = 1


class Variables:
    """One tree's scope.

    Args:
        parent: the scope of the tree that contains this one as a `SubTree`.
        remapped: names here that are other names in the parent.
        autoremap: every name that is not private (`_x`) is the parent's of the same name.
    """

    def __init__(
        self,
        parent: Variables | None = None,
        remapped: Mapping[str, str] | None = None,
        *,
        autoremap: bool = False,
    ) -> None:
        self._parent = parent
        self._remapped = dict(remapped or {})
        self._autoremap = autoremap
        self._entries: dict[str, Entry] = {}

    def _place(self, key: str) -> tuple[dict[str, Entry], str]:
        scope: Variables = self
        while scope._parent is not None:
            if key in scope._remapped:
                key = scope._remapped[key]
            elif not (scope._autoremap and not key.startswith("_") and key not in scope._entries):
                break
            scope = scope._parent
        return scope._entries, key  # noqa: SLF001  # of the same class

    def entry(self, key: str) -> Entry | None:
        """Return a variable, or None when it was never written."""
        entries, name = self._place(key)
        return entries.get(name)

    def __getitem__(self, key: str) -> Any:
        """Return a variable's value.

        Raises:
            KeyError: it was never written; the message has a suggestion.
        """
        entry = self.entry(key)
        if entry is None:
            raise KeyError(f"variable '{key}' has no value{did_you_mean(key, self)}")
        return entry.value

    def get(self, key: str, default: Any = None) -> Any:
        """Return a variable's value, or the default when it was never written."""
        entry = self.entry(key)
        return default if entry is None else entry.value

    def __setitem__(self, key: str, value: Any) -> None:
        """Write a variable."""
        entries, name = self._place(key)
        entry = entries.get(name)
        if entry is None:
            entries[name] = Entry(value)
        else:
            entry.value = value
            entry.writes += 1

    def __delitem__(self, key: str) -> None:
        """Remove a variable; one that does not exist is fine."""
        entries, name = self._place(key)
        entries.pop(name, None)

    def __contains__(self, key: str) -> bool:
        """Return whether the variable has a value."""
        return self.entry(key) is not None

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names written in this scope."""
        return iter(tuple(self._entries))

    def snapshot(self) -> dict[str, Any]:
        """Return name and value of everything written in this scope."""
        return {name: entry.value for name, entry in self._entries.items()}
