"""Lists of places from files: `file:rounds.csv` in a tree file becomes the places of that file.

The file is found relative to the tree file that names it. Its text is kept with those of the tree
files, so that checksums, records and replays have it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Final

from uav_bt.errors import FileError, InputError
from uav_bt.files import did_you_mean_file, read_bounded
from uav_bt.tree.conditions import CONDITION_ATTRIBUTES
from uav_bt.tree.loading.elements import node_attributes, node_id_of
from uav_bt.tree.loading.findings import WHOLE_FILE, Findings, Position, Rule
from uav_bt.tree.loading.lookup import Inclusion
from uav_bt.tree.loading.parameters import VAR, Parameters
from uav_bt.tree.loading.places_file import MAX_BYTES, read_places
from uav_bt.tree.loading.source import Element
from uav_bt.tree.mission_tree import Place
from uav_bt.tree.node import NodeKind
from uav_bt.tree.registry import NodeRegistry
from uav_bt.types.place import FILE_PREFIX, FILE_SUFFIXES, SEPARATOR

MAX_FILES: Final = 50  # of a mission, as of included files
# Stands for the places of a file with faults, so that no port adds a second finding. An area has
# three corners.
_STAND_IN: Final = "start:-1,-1;start:2,-1;start:-1,2"
_NAMED: Final = re.compile(
    rf"\s*{FILE_PREFIX}\s*(?P<name>[^;{{}}]*(?:{'|'.join(map(re.escape, FILE_SUFFIXES))}))\s*",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class _Use:
    """Where a file of places is named."""

    home: Path  # the tree file whose folder has the file
    place: Place
    what: str  # attribute or variable, with its name
    node: str = ""


class PlaceLists:
    """Replaces files of places by their content; each is read once.

    Args:
        known: Files that stand elsewhere, from an earlier reading.
        sources: Takes the texts of the files, by path.
        found: Takes which file each name stands for.
        findings: Collects the findings.
    """

    def __init__(
        self,
        known: Mapping[Inclusion, Path],
        sources: dict[Path, bytes],
        found: dict[Inclusion, Path],
        findings: Findings,
    ) -> None:
        self._known = known
        self._sources = sources
        self._found = found
        self._findings = findings
        self._texts: dict[Path, str] = {}

    def in_tree(self, element: Element, registry: NodeRegistry) -> Element:
        """Return a tree with the places of the files that it names.

        Elements are shared by the readings of a file, so those that change are copied.

        Args:
            element: Of a tree file.
            registry: The nodes that may occur.
        """
        children = [self.in_tree(child, registry) for child in element.children]
        changed = {}
        for name, text in node_attributes(element).items():
            if FILE_PREFIX in text and takes_places(element, name, registry):
                place = Place(element.path, element.at(name))
                use = _Use(element.path, place, f"attribute '{name}'", element.label)
                changed[name] = self._expanded(text, use)
        if not changed and all(map(_is_same, children, element.children)):
            return element
        return replace(element, attributes={**element.attributes, **changed}, children=children)

    def in_default(self, port: Element, text: str) -> str:
        """Return the default of a described SubTree's port with the places of files.

        Args:
            port: The element that describes it.
            text: The default.
        """
        place = Place(port.path, port.at("default"))
        return self._expanded(text, _Use(port.path, place, "attribute 'default'", port.label))

    def in_override(self, text: str, port: str, home: Path, place: Place) -> str:
        """Return the value of a port from outside with the places of files.

        Args:
            text: The value.
            port: Name of the port in messages.
            home: The mission's tree file.
            place: Of the value.
        """
        return self._expanded(text, _Use(home, place, f"port '{port}'"))

    def in_parameters(self, parameters: Parameters, home: Path) -> Parameters:
        """Return parameters whose variables have the places of files.

        Args:
            parameters: From outside.
            home: The mission's tree file.
        """
        beside = Place(home, Position(1, 1))
        variables = {
            name: self._expanded(
                value,
                _Use(home, parameters.places.get((VAR, name), beside), f"variable '{name}'"),
            )
            if isinstance(value, str)
            else value
            for name, value in parameters.variables.items()
        }
        return replace(parameters, variables=variables)

    def _expanded(self, text: str, use: _Use) -> str:
        if FILE_PREFIX not in text:
            return text
        parts = [(part, _NAMED.fullmatch(part)) for part in text.split(SEPARATOR)]
        return SEPARATOR.join(
            part if named is None else self._places(named["name"].strip(), use)
            for part, named in parts
        )

    def _places(self, name: str, use: _Use) -> str:
        """Return the places of a file, or others that stand for them when it has faults."""
        inclusion = Inclusion(use.home.resolve(), None, name)
        try:
            target = self._known.get(inclusion) or _target(inclusion)
            if target not in self._texts:
                self._texts[target] = self._read(target, name, use)
        except InputError as error:
            at = use.place
            message = f"{use.what}: {error}"
            self._findings.add(at.path, at.position, message, use.node, rule=Rule.PLACES)
            return _STAND_IN
        self._found[inclusion] = target
        return self._texts[target]

    def _read(self, target: Path, name: str, use: _Use) -> str:
        """Read a file; add its faults to the findings.

        Raises:
            InputError: It cannot be read, is too large, or there are too many.
        """
        if len(self._texts) >= MAX_FILES:
            raise InputError(f"more than {MAX_FILES} files of places are named")
        data = read_bounded(target, MAX_BYTES, FileError)
        self._sources[target] = data
        read = read_places(data, target.suffix.lower())
        beside = use.home.parent / name
        who = f"{use.node}, {use.what}," if use.node else f"{use.what}"
        for line, message in read.faults:
            self._findings.add(
                beside,
                Position(line, 1) if line else WHOLE_FILE,
                f"{message}; {who} at {use.place.path}:{use.place.position} names the file",
                rule=Rule.PLACES,
            )
        return read.text or _STAND_IN


def takes_places(element: Element, name: str, registry: NodeRegistry) -> bool:
    """Return whether an attribute can be a list of places: a declared port, or a SubTree's entry.

    Args:
        element: A node of a tree file.
        name: Of the attribute.
        registry: The nodes that may occur.
    """
    if name in CONDITION_ATTRIBUTES:
        return False
    if element.tag == NodeKind.SUBTREE.value:
        return True
    node = registry.get(node_id_of(element))
    return node is not None and any(port.places and port.name == name for port in node.ports)


def _is_same(one: Element, other: Element) -> bool:
    return one is other


def _target(named: Inclusion) -> Path:
    """Return the file that a tree file names.

    Raises:
        InputError: The file is absent, or lies neither in the folder of the tree file nor below.
    """
    home, name = named.path, named.name
    folder = home.parent
    if not home.is_file():
        raise InputError(f"'{name}': only a tree that is loaded from a file can name one of places")
    pure = PurePosixPath(name)
    try:
        target = (folder / name).resolve()
        outside = pure.is_absolute() or ".." in pure.parts or not target.is_relative_to(folder)
        there = target.exists()
    except (OSError, ValueError) as error:  # too long for the system, or with a zero byte
        raise InputError(f"'{name:.40}' is no name of a file: {error}") from error
    if outside:
        raise InputError(
            f"'{name}' lies outside the folder {folder}: expected a file of places beside the tree "
            "file or below"
        )
    if not there:
        raise InputError(
            f"no such file of places '{name}' in {folder}{did_you_mean_file(folder / name)}"
        )
    return target
