"""Nodes of the server: those that are installed, and those of a palette."""

from __future__ import annotations

from pathlib import Path

from uav_bt.errors import InputError
from uav_bt.tree.loading.findings import Finding, Findings
from uav_bt.tree.loading.loader import findings_of
from uav_bt.tree.loading.palette import read_palette, with_palette
from uav_bt.tree.registry import NodeRegistry


class Nodes:
    """Nodes, with those of a palette, which may have errors or change while an editor runs.

    Args:
        installed: the nodes without the palette.
        path: the palette; None for none.
    """

    def __init__(self, installed: NodeRegistry, path: Path | None = None) -> None:
        self.path = path
        self.registry = installed
        self.findings: tuple[Finding, ...] = ()  # of the palette
        self._installed = installed
        self.read()

    def read(self) -> None:
        """Read the palette again; a refused palette adds no nodes."""
        if self.path is None:
            return
        odd = Findings()
        self.registry = self._installed
        try:
            self.registry = with_palette(self._installed, read_palette(self.path.resolve(), odd))
            self.findings = tuple(odd)
        except InputError as error:
            self.findings = (*odd, *findings_of(error, self.path.resolve()))
