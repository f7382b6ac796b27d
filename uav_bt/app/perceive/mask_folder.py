"""Class maps of frames as PNG files, for OpenCV and programs of training."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final

from perception.camera.image_files import IMAGE_SUFFIXES
from uav_bt.app.sources.streams import TimedImage
from uav_bt.errors import FileError
from uav_bt.files import check_empty_folder, write_whole, writing
from uav_bt.lab.classes import LabClasses
from uav_bt.record.images import encode_bytes
from uav_bt.types import ClassMap

CLASSES_FILE: Final = "classes.json"


class MaskFolder:
    """A folder with the class map of each frame, and the classes. The first frame makes it.

    A class map is a grey PNG of 8 bits, (h, w), whose values are class ids, at the size of the map.
    `IMG_1.jpg` of a folder becomes `IMG_1.png`, frame 12 of a video `000012.png`.

    Args:
        folder: New, or empty.

    Raises:
        FileError: The folder has files already, or it cannot be written to.
    """

    def __init__(self, folder: Path) -> None:
        check_empty_folder(folder, "net perceive --masks")
        self.folder = folder
        self._begun = False

    def write(self, image: TimedImage, class_map: ClassMap) -> None:
        """Write the class map of an image.

        Raises:
            FileError: The file exists already, or it cannot be written.
        """
        if not self._begun:
            with writing(self.folder):
                self.folder.mkdir(parents=True, exist_ok=True)
            write_whole(self.folder / CLASSES_FILE, _classes_json(class_map.classes))
            self._begun = True
        path = self._path(image)
        with writing(path):
            if path.exists() or path.is_symlink():
                raise FileError(path, "exists already, and is not replaced")
        write_whole(path, encode_bytes(class_map.ids))

    def _path(self, image: TimedImage) -> Path:
        name = Path(image.name)
        if name.suffix.lower() not in IMAGE_SUFFIXES:
            return self.folder / f"{image.index:06d}.png"
        path = self.folder / f"{name.stem}.png"
        # IMG_1.jpg and IMG_1.png of one folder have two masks.
        return self.folder / f"{name.name}.png" if path.exists() else path


def _classes_json(classes: LabClasses) -> str:
    """Return the classes in the order of their ids; roles and colours are those of the lab."""
    rows = [
        {
            "id": number,
            "name": each.name,
            "role": each.role,
            "rgb": list(each.colour),
        }
        for number, each in enumerate(classes)
    ]
    return json.dumps({"classes": rows}, indent=2) + "\n"
