"""Flight footage: frames at the depth network's size with the telemetry of their flight.

One file holds one flight: what the camera saw and what the drone reported, and nothing of the
truth. Where a simulator knows the truth, it goes into a file of its own, so that nobody trains on
it by accident.
"""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import FileError, ShapeError, ValueRangeError
from uav_bt.types import CameraModel

__all__ = [
    "FOOTAGE_SIZE_PX",
    "Footage",
    "FootageTruth",
    "read_arrays",
    "read_footage",
    "read_truth",
    "shrink",
    "write_arrays",
    "write_footage",
    "write_truth",
]

FOOTAGE_SIZE_PX: Final = (320, 256)  # width, height: SC-Depth's size for indoor video
_KIND: Final = "uav-bt-footage-1"
_TRUTH_KIND: Final = "uav-bt-footage-truth-1"
_FLY: Final = "`uav-bt fly ... --footage FILE` makes one"

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Footage:
    """One flight's video and telemetry; all times are of the flight's clock."""

    frames: NDArray[np.uint8]  # (N, H, W, 3) RGB, resized, never cropped
    index: NDArray[np.int64]  # (N,), the drone's frame numbers, rising
    captured_s: Floats  # (N,), rising
    gimbal_pitch_rad: Floats  # (N,), relative to the horizon
    attitude_rad: Floats  # (N, 3): roll, pitch, yaw (clockwise) at capture
    altitude_m: Floats  # (N,), above the take-off point
    height_m: Floats  # (N,), above the surface below
    height_above_carpet_m: Floats  # (N,), of the body's centre
    # Telemetry of every tick: it comes sooner than the pictures and must be put in order by time.
    state_s: Floats  # (M,), rising
    state_attitude_rad: Floats  # (M, 3)
    velocity_mps: Floats  # (M, 3): forward, right, down in the heading-aligned body frame
    camera: CameraModel  # at the frames' size

    def __post_init__(self) -> None:
        count, ticks = len(self.captured_s), len(self.state_s)
        if self.frames.ndim != 4 or self.frames.shape[3] != 3 or self.frames.dtype != np.uint8:
            raise ShapeError("footage frames", expected="NxHxWx3 uint8", actual=self.frames.shape)
        wanted = {
            "frames": (count, self.camera.height_px, self.camera.width_px, 3),
            "attitude_rad": (count, 3),
            "state_attitude_rad": (ticks, 3),
            "velocity_mps": (ticks, 3),
            **dict.fromkeys(_PER_FRAME, (count,)),
            "state_s": (ticks,),
        }
        for name, shape in wanted.items():
            array = getattr(self, name)
            if array.shape != shape:
                expected = "x".join(map(str, shape))
                raise ShapeError(f"footage {name}", expected=expected, actual=array.shape)
            if not np.isfinite(array).all():
                raise ValueRangeError(f"footage {name} holds NaN or infinity")
        for name in ("index", "captured_s", "state_s"):
            if (np.diff(getattr(self, name)) <= 0).any():
                raise ValueRangeError(f"footage {name} must rise from entry to entry")

    def __len__(self) -> int:
        return len(self.frames)


_PER_FRAME: Final = (
    *("index", "captured_s", "gimbal_pitch_rad", "altitude_m", "height_m"),
    "height_above_carpet_m",
)


@dataclass(frozen=True, kw_only=True, eq=False)
class FootageTruth:
    """What a simulator knows about the frames of a footage file."""

    index: NDArray[np.int64]  # (N,), the frame numbers it is about
    depth_m: NDArray[np.float16]  # (N, H, W) along the optical axis; 2 mm fine at 4 m
    ids: NDArray[np.uint8]  # (N, H, W) exact class ids

    def __post_init__(self) -> None:
        if self.depth_m.ndim != 3 or len(self.depth_m) != len(self.index):
            expected = f"{len(self.index)}xHxW"
            raise ShapeError("true depth", expected=expected, actual=self.depth_m.shape)
        if self.ids.shape != self.depth_m.shape:
            expected = "x".join(map(str, self.depth_m.shape))
            raise ShapeError("true ids", expected=expected, actual=self.ids.shape)


def shrink(
    image: NDArray[np.uint8], size_px: tuple[int, int] = FOOTAGE_SIZE_PX
) -> NDArray[np.uint8]:
    """Return a picture, (H, W, 3), resized by area to a width and height, never cropped."""
    if image.shape[1::-1] == size_px:
        return image
    return np.asarray(cv2.resize(image, size_px, interpolation=cv2.INTER_AREA), dtype=np.uint8)


# --- files ----------------------------------------------------------------------------------------


def write_footage(path: Path, footage: Footage) -> None:
    """Write one flight's footage; the file appears whole or not at all.

    Args:
        path: the npz file; noisy video hardly shrinks, so it is not compressed.
        footage: what to write.
    """
    arrays = {
        item.name: getattr(footage, item.name) for item in fields(Footage) if item.name != "camera"
    }
    camera = footage.camera
    write_arrays(
        path,
        _KIND,
        {
            **arrays,
            "camera_fx_fy_cx_cy_px": np.array(
                [camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px]
            ),
            "camera_distortion": np.array(camera.distortion, dtype=np.float64),
            "camera_forward_offset_m": np.array(camera.forward_offset_m),
        },
    )


def read_footage(path: Path) -> Footage:
    """Read one flight's footage.

    Raises:
        FileError: the file is absent, damaged or something else.
    """
    arrays = read_arrays(path, _KIND)
    try:
        fx, fy, cx, cy = (float(value) for value in arrays["camera_fx_fy_cx_cy_px"])
        frames = arrays["frames"]
        camera = CameraModel(
            width_px=frames.shape[2],
            height_px=frames.shape[1],
            fx_px=fx,
            fy_px=fy,
            cx_px=cx,
            cy_px=cy,
            distortion=tuple(float(value) for value in arrays["camera_distortion"]),
            forward_offset_m=float(arrays["camera_forward_offset_m"]),
        )
        named = {item.name: arrays[item.name] for item in fields(Footage) if item.name != "camera"}
        return Footage(camera=camera, **named)
    except (KeyError, IndexError, ValueError, TypeError) as error:
        raise FileError(path, f"is no whole footage file ({error}); fly it again") from error
    except (ShapeError, ValueRangeError) as error:
        raise FileError(path, f"{error}; fly it again") from error


def write_truth(path: Path, truth: FootageTruth) -> None:
    """Write what a simulator knows about one flight's frames, compressed."""
    arrays = {item.name: getattr(truth, item.name) for item in fields(FootageTruth)}
    write_arrays(path, _TRUTH_KIND, arrays, compressed=True)


def read_truth(path: Path) -> FootageTruth:
    """Read what a simulator knew about one flight's frames.

    Raises:
        FileError: the file is absent, damaged or something else.
    """
    arrays = read_arrays(path, _TRUTH_KIND)
    try:
        return FootageTruth(**{item.name: arrays[item.name] for item in fields(FootageTruth)})
    except (KeyError, ShapeError) as error:
        raise FileError(path, f"is no whole truth file ({error}); fly it again") from error


def write_arrays(
    path: Path, kind: str, arrays: Mapping[str, NDArray[Any]], *, compressed: bool = False
) -> None:
    """Write an npz file of a kind; it appears whole or not at all.

    Raises:
        FileError: it cannot be written.
    """
    partial = path.with_name(path.name + ".part")
    save = np.savez_compressed if compressed else np.savez
    try:
        with partial.open("wb") as file:
            save(file, kind=np.array(kind), **arrays)  # type: ignore[arg-type]  # numpy's stub
        partial.replace(path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise FileError(path, f"cannot be written ({error.strerror})") from error


def read_arrays(path: Path, kind: str, *, cure: str = _FLY) -> dict[str, NDArray[Any]]:
    """Read an npz file of a kind, without pickle.

    Args:
        path: the file.
        kind: what it must be.
        cure: what to do when it is not there.

    Raises:
        FileError: it is absent, damaged or something else.
    """
    if not path.is_file():
        raise FileError(path, f"there is no such file; {cure}")
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as content:
            # Opened by ourselves: numpy leaves a damaged file open.
            found = str(content["kind"]) if "kind" in content else "something else"
            if found != kind:
                raise FileError(path, f"expected a file of kind '{kind}', got '{found}'")
            return {name: content[name] for name in content.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, AttributeError) as error:
        raise FileError(path, f"is damaged or no npz file ({error})") from error
