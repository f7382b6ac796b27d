"""Inputs of perception: the source, its camera and telemetry, the networks."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from annotated_types import Ge, Gt, Le
from numpy.typing import NDArray

from perception.camera.camera_file import load_camera
from perception.depth.runtime import load_depth_estimator
from perception.networks import weights_file
from perception.networks.mapping import read_mapping
from perception.segmentation import runtime
from perception.segmentation.runtime import RoomSegmenter
from sim_bridge.anafi import anafi_camera
from uav_bt.app.option_values import Threads
from uav_bt.app.perceive.pipeline import Pipeline
from uav_bt.app.sources.by_name import FolderSource, open_source
from uav_bt.app.sources.shots import Shot, Shots
from uav_bt.errors import FileError, InputError, ValueRangeError
from uav_bt.lab.classes import LabClasses
from uav_bt.lab.shipped import load_lab
from uav_bt.option import Option
from uav_bt.protocols import DepthEstimator, Segmenter
from uav_bt.record.moment import StoredFrame
from uav_bt.record.reader import RECORD_SUFFIX, RecordReader, flight_record, footage
from uav_bt.settings import check_numbers
from uav_bt.types import Attitude, CameraModel, DroneState, Frame
from uav_bt.types.camera import FrameNote

_SQUARE_SLACK: Final = 0.01  # of the ratio of focal lengths
_SLACK_S: Final = 0.25  # by which an image may lie beyond the flight's ends
_NUMBERS: Final = ("gimbal_pitch_rad", "altitude_m", "height_m", "height_above_ground_m")
_ANGLES: Final = ("roll_rad", "pitch_rad", "yaw_rad")


@dataclass(frozen=True, kw_only=True)
class PerceiveOptions:
    """Facts about the images, and the networks that perceive them.

    Options:
        camera: Camera file of `uav-bt lab calibrate`; without it, the ANAFI's video is assumed.
        height_m: Height of the camera above the ground, for all frames.
        gimbal_deg: Pitch of the camera, for all frames: 0 level, negative down.
        telemetry: Record of the same flight, from `uav-bt fly --record`: height and gimbal by
            frame.
        model: Depth network: 'any', 'depth', an ONNX file, or 'contact' (masks and geometry, no
            network); by default the one that belongs to the segmentation.
        segmentation: Segmentation: 'any', 'unet', 'teacher', or an ONNX file; by default 'unet' for
            flights and 'any' for all else.
        classes: Class-mapping file of a foreign segmentation network.
        sequence: The images of the folder follow one another; without it each stands for itself.
        every: Process only one in this many frames.
        longest_s: Stop after this much of the source.
    """

    camera: Annotated[Path | None, Option(path="read")] = None
    height_m: Annotated[float, Gt(0), Le(100)] = 1.5
    gimbal_deg: Annotated[float, Ge(-90), Le(90)] = -30.0
    telemetry: Annotated[Path | None, Option(path="read")] = None
    model: str | None = None
    segmentation: str | None = None
    classes: Annotated[Path | None, Option(path="read")] = None
    sequence: bool = False
    every: Annotated[int, Ge(1)] = 1
    longest_s: Annotated[float | None, Gt(0), Option(form="--seconds")] = None
    threads: Threads = 1

    def __post_init__(self) -> None:
        check_numbers(self, {"gimbal_deg": -90.0}, {"gimbal_deg": 90.0})
        if self.classes is not None and not (self.segmentation or "").lower().endswith(".onnx"):
            raise InputError("a class-mapping file belongs to an ONNX segmentation network")


class Telemetry:
    """Poses of frames, interpolated; times are of the video, which begins at 0."""

    def __init__(
        self, notes: Sequence[FrameNote], states: Sequence[DroneState], slack_s: float = _SLACK_S
    ) -> None:
        begin_s = notes[0].captured_s
        self._states = deque(state.dated(state.captured_s - begin_s) for state in states)
        self._slack_s = slack_s
        self.times_s = np.array([note.captured_s - begin_s for note in notes])  # from the first one
        self._numbers = {name: [getattr(note, name) for note in notes] for name in _NUMBERS}
        angles = {name: [getattr(note.attitude, name) for note in notes] for name in _ANGLES}
        self._angles = {name: np.unwrap(column) for name, column in angles.items()}

    @classmethod
    def fixed(cls, height_m: float, gimbal_pitch_rad: float) -> Telemetry:
        """Return that of a camera with a fixed height above the ground and pitch."""
        numbers = {**dict.fromkeys(_NUMBERS, height_m), "gimbal_pitch_rad": gimbal_pitch_rad}
        note = FrameNote(index=0, captured_s=0.0, attitude=Attitude(), **numbers)
        return cls([note], [], math.inf)

    @classmethod
    def of_flight(cls, reader: RecordReader) -> Telemetry:
        """Return that of a record; FileError if it is damaged or has no frame."""
        notes: list[FrameNote] = []
        states: list[DroneState] = []
        for item in footage(reader):
            if isinstance(item, StoredFrame):
                notes.append(item.note)  # without the image
            elif isinstance(item, DroneState):
                states.append(item)
        if not notes:
            raise FileError(reader.path, "the record has no frame with an image")
        return cls(notes, states)

    def frame(self, image: NDArray[np.uint8], index: int, time_s: float) -> Frame:
        """Return an image, (H, W, 3) RGB, as a frame; heights beyond the flight's ends are NaN."""
        known = self.times_s[0] - self._slack_s <= time_s <= self.times_s[-1] + self._slack_s

        def at(columns: Mapping[str, Any]) -> dict[str, float]:
            return {
                name: float(np.interp(time_s, self.times_s, column)) if known else math.nan
                for name, column in columns.items()
            }

        attitude = Attitude(**at(self._angles))
        return Frame(
            image=image, index=index, captured_s=time_s, attitude=attitude, **at(self._numbers)
        )

    def states(self, until_s: float) -> list[DroneState]:
        """Return the drone's states since the last call, up to a time of the video."""
        past = []
        # With a tolerance: the video's times are differences.
        while self._states and self._states[0].captured_s <= until_s + 1e-9:
            past.append(self._states.popleft())
        return past


class PerceiveInput:
    """One source with its camera, telemetry and pipeline.

    `text` is a video file, a folder of images, an image, `camera:N`, or a flight record.
    """

    def __init__(self, text: str, options: PerceiveOptions) -> None:
        self._options = options
        recorded = Path(text).suffix.lower() == RECORD_SUFFIX
        if recorded and (options.camera is not None or options.telemetry is not None):
            raise InputError(
                f"{text} knows its own camera and telemetry; leave others out, or give the video"
            )
        flown = text if recorded else options.telemetry
        self._flight = None if flown is None else flight_record(Path(flown))
        usual = weights_file.ANY if flown is None else weights_file.SHIPPED_UNET
        self._segmentation = options.segmentation or usual
        self.camera_words = ""  # whose intrinsics; known once it has begun
        if self._flight is None:
            self.telemetry = Telemetry.fixed(options.height_m, math.radians(options.gimbal_deg))
            self.telemetry_words = (
                f"{options.height_m:g} m above the ground, camera at "
                f"{options.gimbal_deg:g} deg, assumed for all frames"
            )
        else:
            self.telemetry = Telemetry.of_flight(self._flight)
            self.telemetry_words = f"of {flown}"
        # Images of a folder are the flight's frames, one by one.
        times_s = None if flown is None else list(self.telemetry.times_s)
        self.source = open_source(text, times_s=times_s)
        # Images of a folder without order in time stand for themselves.
        apart = options.telemetry is None and not options.sequence
        self.unrelated = apart and isinstance(self.source, FolderSource)

    def images(self) -> Shots:
        """Yield the images of the time asked for, of the size of the first one."""
        longest_s, size_px = self._options.longest_s, None
        with closing(self.source.images(self._options.every)) as images:
            for image in images:
                if longest_s is not None and image.time_s >= longest_s:
                    return
                size_px = size_px or image.size_px
                if image.size_px == size_px:
                    yield image
                    continue
                shown, first = (f"{width}x{height}" for width, height in (image.size_px, size_px))
                self.source.skipped.append(f"{image.name}: is {shown}, the first image is {first}")

    def begin(self, images: Shots) -> tuple[Pipeline, Iterator[Shot]]:
        """Return the perception for the images' size, and all images."""
        first = next(images, None)
        if first is None:
            why = f": {'; '.join(self.source.skipped[:3])}" if self.source.skipped else ""
            raise InputError(f"{self.source.name} holds no image that can be read{why}")
        camera, self.camera_words = self._camera(first)
        options, name = self._options, self._segmentation
        segmenter = _segmenter(name, options)
        by_roles = name == weights_file.ANY
        model = options.model or (weights_file.ANY if by_roles else weights_file.SHIPPED_DEPTHS[0])
        network = _network(model, segmenter, options)
        return Pipeline(segmenter, network, camera), chain([first], images)

    def _camera(self, first: Shot) -> tuple[CameraModel, str]:
        """Return the camera of the images, and whose it is."""
        options, (width_px, height_px) = self._options, first.size_px
        if options.camera is not None:
            file, turned = Path(options.camera), first.orientation
            return load_camera(file, size_px=first.size_px, orientation=turned), f"of {file}"
        if self._flight is not None:
            camera = self._flight.camera.resized(width_px, height_px)
            # Only square pixels show that the aspect is the flight's.
            if abs(camera.fx_px / camera.fy_px - 1.0) > _SQUARE_SLACK:
                raise ValueRangeError(
                    f"{options.telemetry} was filmed with a camera of another aspect than "
                    f"{width_px}x{height_px}; the images must be whole, not cropped"
                )
            return camera, f"of {self._flight.path}"
        try:
            camera = anafi_camera(width_px, height_px)
        except ValueRangeError as error:
            raise ValueRangeError(
                f"the images are {width_px}x{height_px} (aspect {width_px / height_px:.3f}); "
                "without a camera file only 16:9 is known, as of the ANAFI's video: calibrate the "
                "camera with `uav-bt lab calibrate` and name its file with --camera"
            ) from error
        return camera, "the ANAFI's video, 69 deg wide (none given)"


def _segmenter(name: str, options: PerceiveOptions) -> Segmenter:
    path = weights_file.segmentation_file(name)
    classes = LabClasses.by_role() if name == weights_file.ANY else load_lab().classes
    if path is None:
        return runtime.shipped_teacher(classes)
    mapping = None if options.classes is None else read_mapping(Path(options.classes), classes)
    return runtime.load_segmenter(path, classes, mapping, threads=options.threads)


def _network(model: str, segmenter: Segmenter, options: PerceiveOptions) -> DepthEstimator | None:
    if model == weights_file.CONTACT:
        return None
    if model == weights_file.ANY and isinstance(segmenter, RoomSegmenter):
        return segmenter
    return load_depth_estimator(model, threads=options.threads)
