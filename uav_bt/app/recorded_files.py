"""Files that travel with a flight's record, written and read: tree files, places, scene, lab."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from sim_bridge.twin.scene import Scene
from sim_bridge.twin.scene_file import scene_text
from uav_bt.app.options import FlightOptions
from uav_bt.errors import FileError, InputError
from uav_bt.files import reading
from uav_bt.json_text import parse_json
from uav_bt.lab.lab import Lab
from uav_bt.record.reader import RecordReader
from uav_bt.record.record_file import Attachment
from uav_bt.tree import MissionTree
from uav_bt.tree.loading.lookup import Inclusion, Library, Lookup

_TREE_FOLDER: Final = "tree/"  # attachments below lie as they do beside the tree file
_OTHER_FOLDER: Final = "elsewhere/"  # tree files of other folders, each in a numbered one
_MEDIA_TYPES: Final = {".csv": "text/csv", ".txt": "text/plain"}  # of files of places
_SCENE_FILE: Final = "scene.yaml"
_LAB_FILE: Final = "lab.yaml"
_INCLUSIONS: Final = "tree_includes"  # metadata: which attachment an `<include>` stands for


def tree_files(mission: MissionTree) -> Iterator[Attachment]:
    """Yield a tree file and all files that it takes trees and places from."""
    for path, name in _names(mission).items():
        media_type = _MEDIA_TYPES.get(path.suffix.lower(), "application/xml")
        yield Attachment(name=name, media_type=media_type, data=mission.sources[path])


def tree_facts(mission: MissionTree) -> dict[str, str]:
    """Return the metadata entries of these files."""
    names = _names(mission)
    inclusions = [
        [names[one.path], one.package, one.name, names[target]]
        for one, target in mission.inclusions.items()
    ]
    return {_INCLUSIONS: json.dumps(inclusions)}


def _names(mission: MissionTree) -> dict[Path, str]:
    """Return the names of a tree's files in a record."""
    folder, names = mission.path.parent, {}
    for number, path in enumerate(mission.sources):
        if path.is_relative_to(folder):
            names[path] = f"{_TREE_FOLDER}{path.relative_to(folder).as_posix()}"
        else:
            names[path] = f"{_OTHER_FOLDER}{number}/{path.name}"
    return names


def scene_files(scene: object) -> Iterator[Attachment]:
    """Yield the file of a simulated drone's scene; nothing for anything else."""
    if isinstance(scene, Scene):
        data = scene_text(scene).encode()
        yield Attachment(name=_SCENE_FILE, media_type="application/yaml", data=data)


def lab_files(options: FlightOptions) -> Iterator[Attachment]:
    """Yield the lab file of the options; nothing without a lab."""
    if isinstance(options.lab, Lab):
        with reading(options.lab.file):
            data = options.lab.file.read_bytes()
        yield Attachment(name=_LAB_FILE, media_type="application/yaml", data=data)


@dataclass(frozen=True, kw_only=True)
class RecordedFiles:
    """A record's files, written into a folder."""

    tree: Path | None = None  # the tree file; None: the record has none
    scene: Path | None = None  # the scene file; None: the record has none
    lookup: Lookup = field(default_factory=Lookup)  # the tree's other files


def recorded_files(reader: RecordReader, folder: Path) -> RecordedFiles:
    """Write a record's attachments into a folder.

    Args:
        reader: of the record.
        folder: exists and is empty.

    Raises:
        FileError: an attachment's name leads out of the folder or is no file's, or the metadata is
            damaged.
    """
    root = folder.resolve()
    files = {name: _written(reader, root, name) for name in reader.attachments}
    tree = files.get(f"{_TREE_FOLDER}{reader.metadata.get('tree', '')}")
    folders = (_TREE_FOLDER, _OTHER_FOLDER)
    others = [
        file
        for name, file in files.items()
        if name.startswith(folders) and file.suffix.lower() not in _MEDIA_TYPES
    ]
    return RecordedFiles(
        tree=tree,
        scene=files.get(_SCENE_FILE),
        # A record holds only the used files of the library, so no tree is in two of them.
        lookup=Lookup(Library(others), included=_inclusions(reader, files)),
    )


def _written(reader: RecordReader, root: Path, name: str) -> Path:
    try:
        file = (root / name).resolve()
        if not file.is_relative_to(root):
            raise FileError(reader.path, f"its attachment '{name:.80}' lies outside its folder")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(reader.attachments[name].data)
    except (OSError, ValueError) as error:  # no name of a file, or the disk is full
        reason = getattr(error, "strerror", None) or error
        raise FileError(
            reader.path, f"its attachment '{name:.80}' cannot be written out: {reason}"
        ) from error
    return file


def _inclusions(reader: RecordReader, files: dict[str, Path]) -> dict[Inclusion, Path]:
    """Return which file each `<include>` stands for."""
    text = reader.metadata.get(_INCLUSIONS, "")
    try:
        rows: Any = parse_json(text)
        return {
            Inclusion(files[path], package, name): files[target]
            for path, package, name, target in rows
        }
    except (InputError, KeyError, TypeError, ValueError) as error:
        message = f"the record's metadata is damaged: {_INCLUSIONS}: got '{text:.80}'"
        raise FileError(reader.path, message) from error
