"""Files from which a lab's network is trained: frames, picks, and what training keeps.

All lie in the folder of the lab:

    frames/             images of the place, of `uav-bt lab frames`
    frames/frames.csv   source, time, sharpness and use of each image
    picks.csv           picks on the images, of `uav-bt lab pick`
    training/           teacher, masks, checkpoint and reports; it may be deleted
    segmentation.onnx   the network, of `uav-bt lab train`
"""

from __future__ import annotations

import csv
import hashlib
import io
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import Field, FiniteFloat, TypeAdapter, ValidationError

from perception.camera.image_files import image_files
from uav_bt.errors import FileError
from uav_bt.files import read_bounded, reading, write_whole
from uav_bt.lab.lab import NETWORK_FILE, Lab

Use = Literal["train", "check"]
"""`train`: the network learns from the image. `check`: the image only scores the network."""

_COLUMNS: Final = ("image", "source", "time_s", "sharpness", "use", "content")
_MAX_BYTES: Final = 10_000_000  # a line takes about 70
_IMAGES_A_CHECK: Final = 5  # every fifth is for checks
_END_BYTES: Final = 64 * 1024  # hashed bytes of both ends, where a record has its index


@dataclass(frozen=True, kw_only=True)
class LabFrame:
    """An image of a lab's folder `frames/`."""

    image: Annotated[str, Field(pattern=r"^[^/\\]+$")]  # file name, without a folder
    source: str = ""  # file name of the video or photograph; empty if copied
    time_s: FiniteFloat = 0.0  # time in the video, seconds; 0 for a photograph
    sharpness: FiniteFloat = 0.0  # variance of the Laplacian at a width of 320 pixels
    use: Use  # whether the network learns from the image
    content: str = ""  # `fingerprint` of the source; empty where it is unknown


_FRAME: Final = TypeAdapter(LabFrame)


def nth_use(number: int) -> Use:
    """Return the use of the n-th image or part of a video, counted from 1."""
    return "check" if number % _IMAGES_A_CHECK == 0 else "train"


class LabMaterial:
    """Where a lab's training files are."""

    def __init__(self, lab: Lab) -> None:
        self.lab = lab
        self.frames = lab.folder / "frames"  # folder of the images
        self.list_file = self.frames / "frames.csv"
        self.picks = lab.folder / "picks.csv"
        self.training = lab.folder / "training"  # folder of what training keeps
        self.teacher = self.training / "teacher.safetensors"  # of the picks
        self.network = lab.folder / NETWORK_FILE  # that training writes

    def uses(self) -> dict[str, Use]:
        """Return the use of every image in the folder, by file name in the order of names.

        Of images without an entry in the list, such as copied ones, every fifth is for checks.
        FileError if there is no image, or the list is malformed.
        """
        if not self.frames.is_dir():
            raise FileError(
                self.frames,
                f"there are no images of '{self.lab.name}': `uav-bt lab frames` takes them from "
                "videos",
            )
        frames = self.read_frames()
        listed = {frame.image: frame.use for frame in frames}
        # macOS puts ._NAME beside each file of a memory card.
        files = image_files(self.frames)[0]
        names = [path.name for path in files if not path.name.startswith("._")]
        copied = sum(not frame.source for frame in frames)
        for number, name in enumerate((one for one in names if one not in listed), copied + 1):
            listed[name] = nth_use(number)
        return {name: listed[name] for name in names}

    def keep_uses(self, uses: Mapping[str, Use]) -> None:
        """Add images without an entry to the list, so that they keep their use."""
        frames = self.read_frames()
        missing = uses.keys() - {frame.image for frame in frames}
        if missing:
            added = [LabFrame(image=name, use=uses[name]) for name in sorted(missing)]
            self.write_frames([*frames, *added])

    def read_frames(self) -> list[LabFrame]:
        """Return the entries of the list; FileError with the line if it is malformed."""
        if not self.list_file.exists():
            return []
        with reading(self.list_file):
            text = read_bounded(self.list_file, _MAX_BYTES).decode("utf-8-sig")
        reader = csv.reader(io.StringIO(text))
        frames = []
        try:
            for row in reader:
                if row and row[0] != _COLUMNS[0]:
                    values = dict(zip(_COLUMNS, row, strict=False))
                    frames.append(_FRAME.validate_python(values))
        except csv.Error as error:
            raise FileError(self.list_file, f"no CSV: {error}", line=reader.line_num) from error
        except ValidationError as error:
            wrong = error.errors()[0]
            what = f"column {wrong['loc'][0]}: {wrong['msg']}, got {wrong['input']!r}"
            raise FileError(self.list_file, what, line=reader.line_num) from error
        return frames

    def write_frames(self, frames: Iterable[LabFrame]) -> None:
        """Write the list; the file is replaced in one step."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(_COLUMNS)
        for frame in frames:
            measured = (f"{frame.time_s:.3f}", f"{frame.sharpness:.1f}")
            writer.writerow([frame.image, frame.source, *measured, frame.use, frame.content])
        # File names may be no UTF-8.
        write_whole(self.list_file, text.getvalue().encode("utf-8", "replace"))


def fingerprint(path: Path) -> str:
    """Return a hash of a file's size and both ends."""
    with reading(path), path.open("rb") as file:
        size = path.stat().st_size
        begin = file.read(_END_BYTES)
        file.seek(max(0, size - _END_BYTES))
        ends = begin + file.read()
    return hashlib.sha256(ends + f"{size} ".encode()).hexdigest()[:12]
