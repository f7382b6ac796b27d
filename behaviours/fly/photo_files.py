"""The files of a photograph: image, class map, and a JSON file with pose and label."""

from __future__ import annotations

import json
import re
from dataclasses import asdict
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.board.context import FlightFolder
from uav_bt.record.images import encode_bytes, encode_image
from uav_bt.types.flight_results import FRAME_OF_RESULTS, Photo

_LABEL_LENGTH: Final = 40  # characters of a label in a file's name


def photo_name(number: int, label: str) -> str:
    """Return the name of a photograph's files, without suffix.

    Args:
        number: Number of the photograph in its flight, from 1.
        label: Its label; characters that names of files lack become `-`.
    """
    plain = re.sub(r"[^A-Za-z0-9_]+", "-", label)[:_LABEL_LENGTH].strip("-")
    return f"photo-{number:03d}-{plain}" if plain else f"photo-{number:03d}"


def store_photo(
    folder: FlightFolder,
    name: str,
    photo: Photo,
    image: NDArray[np.uint8] | None,
    ids: NDArray[np.uint8] | None,
) -> None:
    """Write the files of a photograph: `NAME.jpg`, `NAME-classes.png` and `NAME.json`.

    Args:
        folder: Output folder of the flight.
        name: Name of the files, without suffix.
        photo: Facts of the JSON file; its names are those of the files.
        image: (H, W, 3) RGB. None: the drone has no images.
        ids: (H, W) class ids. None: no class map.

    Raises:
        FileError: A file cannot be written.
    """
    if image is not None and photo.file is not None:
        folder.write(photo.file, encode_image(image, "high")[0])
    if ids is not None and photo.class_map is not None:
        folder.write(photo.class_map, encode_bytes(ids))
    content = {"frame": FRAME_OF_RESULTS, **asdict(photo)}
    folder.write(f"{name}.json", json.dumps(content, indent=2) + "\n")
