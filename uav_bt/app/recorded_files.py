"""Files that travel with a flight's record, written and read: tree, scene, lab."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

from sim_bridge.twin.scene import Scene
from sim_bridge.twin.scene_file import scene_text
from uav_bt.errors import FileError
from uav_bt.files import reading
from uav_bt.lab.lab import Lab
from uav_bt.record.reader import RecordReader
from uav_bt.record.record_file import Attachment
from uav_bt.tree import MissionTree

_TREE_FOLDER: Final = "tree/"
_SCENE_FILE: Final = "scene.yaml"
_LAB_FILE: Final = "lab.yaml"


def attachments_of(mission: MissionTree, scene: object, lab: object) -> Iterator[Attachment]:
    """Yield the files of a flight: one tree file with all trees and places, scene and lab."""
    if mission.sources:
        name = f"{_TREE_FOLDER}{mission.path.name}"
        yield Attachment(name=name, media_type="application/xml", data=mission.whole())
    if isinstance(scene, Scene):
        data = scene_text(scene).encode()
        yield Attachment(name=_SCENE_FILE, media_type="application/yaml", data=data)
    if isinstance(lab, Lab):
        with reading(lab.file):
            data = lab.file.read_bytes()
        yield Attachment(name=_LAB_FILE, media_type="application/yaml", data=data)


class RecordedFiles(NamedTuple):
    """Files of a record, written into a folder; None for those that it does not have."""

    tree: Path | None = None
    scene: Path | None = None


def recorded_files(reader: RecordReader, folder: Path) -> RecordedFiles:
    """Write a record's attachments into an empty folder."""
    root = folder.resolve()
    files = {name: _written(reader, root, name) for name in reader.attachments}
    tree = files.get(f"{_TREE_FOLDER}{reader.metadata.get('tree', '')}")
    return RecordedFiles(tree=tree, scene=files.get(_SCENE_FILE))


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
