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
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Literal, cast, get_args

from perception.camera.image_files import image_files
from uav_bt.errors import FileError
from uav_bt.files import read_bounded, reading, write_whole
from uav_bt.lab.lab import NETWORK_FILE, Lab

Use = Literal["train", "check"]
"""`train`: the network learns from the image. `check`: the image only scores the network."""

_COLUMNS: Final = ("image", "source", "time_s", "sharpness", "use")
_CONTENT: Final = "content"  # a further column, which older lists lack
_MAX_BYTES: Final = 10_000_000  # a line takes about 70
_IMAGES_A_CHECK: Final = 5  # of images without an entry, every fifth by name is for checks
_END_BYTES: Final = 64 * 1024  # hashed bytes of both ends, where a record has its index


@dataclass(frozen=True, kw_only=True)
class LabFrame:
    """An image of a lab's folder `frames/`."""

    image: str  # file name, without a folder
    source: str  # name of the video or photograph; empty for an image that was copied there
    time_s: float  # time in the video, seconds; 0 for a photograph
    sharpness: float  # variance of the image's Laplacian at a width of 320 pixels
    use: Use  # whether the network learns from the image
    content: str = ""  # `fingerprint` of the source; empty where it is unknown


class LabMaterial:
    """Where a lab's training files are."""

    def __init__(self, lab: Lab) -> None:
        self.lab = lab
        self.frames = lab.folder / "frames"  # folder of the images
        self.list_file = self.frames / "frames.csv"
        self.picks = lab.folder / "picks.csv"
        self.training = lab.folder / "training"  # folder of what training keeps
        self.teacher = self.training / "teacher.safetensors"  # of the picks
        self.network = lab.folder / NETWORK_FILE  # that training writes; see also `Lab.network`

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
            listed[name] = "check" if number % _IMAGES_A_CHECK == 0 else "train"
        return {name: listed[name] for name in names}

    def keep_uses(self, uses: Mapping[str, Use]) -> None:
        """Add images without an entry to the list, so that a further image changes no use."""
        frames = self.read_frames()
        missing = uses.keys() - {frame.image for frame in frames}
        if missing:
            blank = LabFrame(image="", source="", time_s=0.0, sharpness=0.0, use="train")
            added = [replace(blank, image=one, use=uses[one]) for one in sorted(missing)]
            self.write_frames([*frames, *added])

    def read_frames(self) -> list[LabFrame]:
        """Return the entries of the list; FileError, which names the line, if it is malformed."""
        if not self.list_file.exists():
            return []
        with reading(self.list_file):
            text = read_bounded(self.list_file, _MAX_BYTES).decode("utf-8-sig")
        reader = csv.reader(io.StringIO(text))
        try:
            return [
                _parsed(row, self.list_file, reader.line_num)
                for row in reader
                if row and tuple(row[: len(_COLUMNS)]) != _COLUMNS
            ]
        except csv.Error as error:
            raise FileError(self.list_file, f"no CSV: {error}", line=reader.line_num) from error

    def write_frames(self, frames: Iterable[LabFrame]) -> None:
        """Write the list; the file is replaced in one step."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow((*_COLUMNS, _CONTENT))
        for frame in frames:
            measured = (f"{frame.time_s:.3f}", f"{frame.sharpness:.1f}")
            writer.writerow([frame.image, frame.source, *measured, frame.use, frame.content])
        write_whole(self.list_file, text.getvalue())


def _parsed(row: list[str], file: Path, line: int) -> LabFrame:
    if len(row) not in (len(_COLUMNS), len(_COLUMNS) + 1):
        expected = ",".join(_COLUMNS)
        raise FileError(file, f"expected the columns {expected}, got {','.join(row)}", line=line)
    image, source, time_s, sharpness, use, content = (*row, "")[: len(_COLUMNS) + 1]
    if not image or Path(image).name != image:
        raise FileError(file, f"expected a file name without a folder, got '{image}'", line=line)
    if use not in get_args(Use):
        raise FileError(file, f"expected the use train or check, got '{use}'", line=line)
    try:
        numbers = float(time_s), float(sharpness)
    except ValueError:
        numbers = math.nan, math.nan
    if not all(math.isfinite(number) for number in numbers):
        raise FileError(
            file,
            f"expected numbers for time_s and sharpness, got '{time_s}', '{sharpness}'",
            line=line,
        )
    return LabFrame(
        image=image,
        source=source,
        time_s=numbers[0],
        sharpness=numbers[1],
        use=cast("Use", use),
        content=content,
    )


def fingerprint(path: Path, *, dated: bool) -> str:
    """Return a hash of a file's size and both ends, and of its change time if `dated`."""
    with reading(path), path.open("rb") as file:
        status = path.stat()
        digest = hashlib.sha256(file.read(_END_BYTES))
        file.seek(max(0, status.st_size - _END_BYTES))
        digest.update(file.read())
    digest.update(f"{status.st_size} {status.st_mtime_ns if dated else ''}".encode())
    return digest.hexdigest()[:12]
