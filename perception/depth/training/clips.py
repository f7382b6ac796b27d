"""Training examples: three frames of a flight, the camera's motion, and labels if there are any."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.depth.training.clip import Clip, mirrored, recoloured, turned
from perception.depth.training.footage import CameraTrack, Footage, camera_track, measured_motion
from uav_bt.errors import ShapeError, ValueRangeError


@dataclass(frozen=True, kw_only=True)
class ClipConfig:
    """Which frames form a clip, and how clips are augmented."""

    # Between a target and a reference: less movement shows no depth, more leaves no overlap.
    min_move_m: float = 0.04
    max_move_m: float = 0.5
    max_turn_rad: float = 0.35
    max_apart_s: float = 2.0  # integrated velocity drifts
    min_height_m: float = 0.8  # above the ground; frames before take-off are left out
    # Single frames are sampled from every third frame: neighbours look alike, and `labelling`
    # labels only these.
    single_every: int = 3
    odometry: bool = True  # measure motions on the ground; otherwise from telemetry
    # Limits of random rotations. Flights keep one gimbal angle, and a network would learn depth
    # from the row.
    pitch_rad: float = 0.07
    roll_rad: float = 0.02  # roll that a gimbal leaves
    flip: float = 0.5  # share of mirrored clips
    brightness: float = 0.2  # relative, in both directions; one sample for all frames of a clip
    tint: float = 0.05  # relative, in both directions, each colour independently

    def __post_init__(self) -> None:
        if self.single_every < 1:
            raise ValueRangeError(f"single_every must be positive, got {self.single_every}")
        if not 0.0 <= self.min_move_m < self.max_move_m:
            raise ValueRangeError(
                "min_move_m must be less than max_move_m, got "
                f"{self.min_move_m} and {self.max_move_m}"
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class DepthLabels:
    """Depth labels of a flight's frames, estimated or exact."""

    depth_m: NDArray[np.float16]  # (N, h, w) along the optical axis; NaN where unknown
    at_most_m: NDArray[np.float16] | None = None  # (N, h, w); inf without a bound

    def __post_init__(self) -> None:
        if self.depth_m.ndim != 3:
            raise ShapeError("depth labels", expected="NxHxW", actual=self.depth_m.shape)
        if self.at_most_m is not None and self.at_most_m.shape != self.depth_m.shape:
            expected = "x".join(map(str, self.depth_m.shape))
            raise ShapeError("depth bounds", expected=expected, actual=self.at_most_m.shape)


@dataclass(frozen=True, kw_only=True, eq=False)
class Flight:
    """One flight of the training data."""

    footage: Footage
    labels: DepthLabels | None = None

    def __post_init__(self) -> None:
        if self.labels is not None and len(self.labels.depth_m) != len(self.footage):
            raise ShapeError(
                "depth labels",
                expected=f"{len(self.footage)}xHxW, one a frame",
                actual=self.labels.depth_m.shape,
            )


class ClipSource:
    """All clips of some flights; equal generators give equal clips."""

    def __init__(self, flights: Sequence[Flight], config: ClipConfig | None = None) -> None:
        """Find the frames that form clips.

        Args:
            flights: training data, all with labels or all without.
            config: which frames form a clip.

        Raises:
            ValueRangeError: no frame was taken in flight, frames differ in size, or only some
                flights have labels.
        """
        self._config = config or ClipConfig()
        self._flights = tuple(flights)
        if len({flight.labels is None for flight in flights}) > 1:
            raise ValueRangeError("some flights have depth labels and others none: label all")
        sizes = {flight.footage.frames.shape[2:0:-1] for flight in flights}
        if len(sizes) != 1:
            raise ValueRangeError(f"flights must have frames of one size, got {sorted(sizes)}")
        (self._size_px,) = sizes
        self._tracks = [camera_track(flight.footage) for flight in flights]
        # (flight, target) and the frames that may stand beside it.
        self._targets: list[tuple[int, int, NDArray[np.intp]]] = []
        self._aloft: list[NDArray[np.intp]] = []
        for number, (flight, track) in enumerate(zip(flights, self._tracks, strict=True)):
            height_m = flight.footage.height_above_ground_m
            aloft = np.flatnonzero(height_m >= self._config.min_height_m)
            self._aloft.append(aloft[aloft % self._config.single_every == 0])
            for target in aloft:
                beside = self._beside(flight.footage, track, int(target))
                if len(beside) >= 2:
                    self._targets.append((number, int(target), beside))
        if not self.frame_count:
            raise ValueRangeError(
                f"no frame of {len(self._flights)} flights was taken from "
                f"{self._config.min_height_m} m or more above the ground; fly higher"
            )

    def __len__(self) -> int:
        """Return the number of targets with references."""
        return len(self._targets)

    @property
    def frame_count(self) -> int:
        """How many frames are drawn for themselves."""
        return sum(map(len, self._aloft))

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the frames."""
        return self._size_px

    @property
    def labelled(self) -> bool:
        """Whether the flights come with labels."""
        return self._flights[0].labels is not None

    def _beside(self, footage: Footage, track: CameraTrack, target: int) -> NDArray[np.intp]:
        config = self._config
        moved_m = np.linalg.norm(track.position_m - track.position_m[target], axis=1)
        # The angle between two optical axes: pitch and heading together.
        axes = track.rotation[:, :, 2]
        turned_rad = np.arccos(np.clip(axes @ axes[target], -1.0, 1.0))
        apart_s = np.abs(footage.captured_s - footage.captured_s[target])
        return np.flatnonzero(
            (moved_m >= config.min_move_m)
            & (moved_m <= config.max_move_m)
            & (turned_rad <= config.max_turn_rad)
            & (apart_s <= config.max_apart_s)
            & (footage.height_above_ground_m >= config.min_height_m)
        )

    def draw(self, rng: np.random.Generator) -> Clip:
        """Return a clip.

        Raises:
            ValueRangeError: the camera does not move in these flights.
        """
        number, target, (first, second) = self._draw_places(rng)
        motions = np.stack(
            [self._motion(number, target, first), self._motion(number, target, second)]
        )
        return self._clip(number, (target, first, second), motions, rng)

    def _draw_places(self, rng: np.random.Generator) -> tuple[int, int, tuple[int, int]]:
        """Return a flight's number and the indices of a target and two references in it."""
        if not self._targets:
            config = self._config
            raise ValueRangeError(
                f"no frame of {len(self._flights)} flights has two others that were taken from "
                f"{config.min_move_m} to {config.max_move_m} m away; fly further"
            )
        number, target, beside = self._targets[int(rng.integers(len(self._targets)))]
        first, second = rng.choice(beside, size=2, replace=False)
        return number, target, (int(first), int(second))

    def _motion(self, number: int, origin: int, target: int) -> NDArray[np.float64]:
        track = self._tracks[number]
        measured = None
        if self._config.odometry:
            footage = self._flights[number].footage
            measured = measured_motion(footage, track, origin, target)
        return track.motion(origin, target) if measured is None else measured

    def draw_frames(self, rng: np.random.Generator) -> Clip:
        """Return three independent frames, for training on labels alone."""
        share = np.array([len(frames) for frames in self._aloft]) / self.frame_count
        number = int(rng.choice(len(share), p=share))
        chosen = tuple(int(frame) for frame in rng.choice(self._aloft[number], size=3))
        return self._clip(number, chosen, np.zeros((2, 3, 4)), rng)

    def _clip(
        self,
        number: int,
        frames: tuple[int, ...],
        motions: NDArray[np.float64],
        rng: np.random.Generator,
    ) -> Clip:
        flight = self._flights[number]
        camera = flight.footage.camera
        chosen = list(frames)
        images = flight.footage.frames[chosen].transpose(0, 3, 1, 2).astype(np.float32) / 255.0
        labels = bounds = None
        if flight.labels is not None:
            labels = flight.labels.depth_m[chosen].astype(np.float32)
            if flight.labels.at_most_m is not None:
                bounds = flight.labels.at_most_m[chosen].astype(np.float32)
        clip = Clip(
            images=images,
            motions=motions.astype(np.float32),
            intrinsics=np.array(
                [camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px], dtype=np.float32
            ),
            labels=labels,
            at_most=bounds,
        )
        config = self._config
        if config.pitch_rad > 0.0 or config.roll_rad > 0.0:
            pitch_rad = rng.uniform(-config.pitch_rad, config.pitch_rad)
            clip = turned(clip, pitch_rad, rng.uniform(-config.roll_rad, config.roll_rad))
        if rng.random() < config.flip:
            clip = mirrored(clip)
        gain = 1.0 + rng.uniform(-config.brightness, config.brightness)
        tint = 1.0 + rng.uniform(-config.tint, config.tint, size=3)
        return recoloured(clip, gain * tint)
