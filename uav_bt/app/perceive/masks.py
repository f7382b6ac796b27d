"""Class maps of frames as PNG files, for OpenCV and programs of training."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final

from perception.camera.image_files import IMAGE_SUFFIXES
from uav_bt.app.sources.shots import Shot
from uav_bt.errors import FileError
from uav_bt.files import check_empty_folder, write_whole, writing
from uav_bt.record.images import encode_bytes
from uav_bt.types import ClassMap

CLASSES_FILE: Final = "classes.json"


class MaskFolder:
    """A new or empty folder with the class map of each frame, and the classes.

    A class map is a grey PNG of 8 bits, (h, w), whose values are class ids, at the size of the map.
    `IMG_1.jpg` of a folder becomes `IMG_1.png`, frame 12 of a video `000012.png`.
    """

    def __init__(self, folder: Path) -> None:
        check_empty_folder(folder, "net perceive --masks")
        self._folder = folder

    def write(self, image: Shot, class_map: ClassMap) -> None:
        """Write the class map of an image; the first one makes the folder."""
        classes = self._folder / CLASSES_FILE
        if not classes.exists():
            with writing(self._folder):
                self._folder.mkdir(parents=True, exist_ok=True)
            rows = [
                {"id": number, "name": each.name, "role": each.role, "rgb": list(each.colour)}
                for number, each in enumerate(class_map.classes)
            ]
            write_whole(classes, json.dumps({"classes": rows}, indent=2) + "\n")
        path = self._path(image)
        with writing(path):
            if path.exists() or path.is_symlink():
                raise FileError(path, "exists already, and is not replaced")
        write_whole(path, encode_bytes(class_map.ids))

    def _path(self, image: Shot) -> Path:
        name = Path(image.name)
        if name.suffix.lower() not in IMAGE_SUFFIXES:
            return self._folder / f"{image.index:06d}.png"
        path = self._folder / f"{name.stem}.png"
        # IMG_1.jpg and IMG_1.png of one folder have two masks.
        return self._folder / f"{name.name}.png" if path.exists() else path
