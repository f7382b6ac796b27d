"""Training data of the control student: labelled views of flights, compressed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.control.ego_state import ControlNetConfig, EgoState, state_vector
from uav_bt.answers import Advance, Answer, Blocked
from uav_bt.errors import FileError, ShapeError, ValueRangeError
from uav_bt.files import whole_file
from uav_bt.protocols import Advice
from uav_bt.types.dead_reckoning import OdometryPose

# Shrinking has already removed noise; a JPEG has a sixth of a PNG's bytes.
_JPEG: Final = [cv2.IMWRITE_JPEG_QUALITY, 95]


@dataclass(frozen=True, kw_only=True, eq=False)
class ControlFlight:
    """One flight: N labelled views in the order of time."""

    size_px: NDArray[np.int64]  # (2,) width and height of the images
    images: NDArray[np.uint8]  # (B,) concatenated JPEG files
    ends: NDArray[np.int64]  # (N,) end of each file in `images`
    poses: NDArray[np.float64]  # (N, 4) time, x, y, yaw: `OdometryPose`
    ego: NDArray[np.float64]  # (N, 4) `EgoState`'s fields
    # (N, 2, 4) forward_m, yaw_rad, ground_ends, free_m of the rule's answer with the turn under
    # way, and without it; free_m NaN if unknown.
    labels: NDArray[np.float32]

    def __len__(self) -> int:
        """How many views there are."""
        return len(self.ends)

    def image(self, place: int) -> NDArray[np.uint8]:
        """Return a view's image, (H, W, 3) RGB."""
        begin = int(self.ends[place - 1]) if place else 0
        bgr = cv2.imdecode(self.images[begin : int(self.ends[place])], cv2.IMREAD_COLOR)
        if bgr is None:
            raise ValueRangeError(f"image {place} of a flight's samples is damaged")
        return np.asarray(bgr[..., ::-1], dtype=np.uint8)

    def pose(self, place: int) -> OdometryPose:
        """Return the body's pose at the capture of a view."""
        time_s, x_m, y_m, yaw_rad = (float(number) for number in self.poses[place])
        return OdometryPose(time_s=time_s, x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)


class FlightBuilder:
    """Collects a flight's labelled views.

    Args:
        size_px: width and height of stored images.
    """

    def __init__(self, size_px: tuple[int, int]) -> None:
        self._size_px = size_px
        self._images: list[NDArray[np.uint8]] = []
        self._poses: list[tuple[float, ...]] = []
        self._ego: list[tuple[float, ...]] = []
        self._labels: list[list[tuple[float, ...]]] = []

    def add(self, image: NDArray[np.uint8], advice: Advice) -> None:
        """Add a view.

        Args:
            image: (H, W, 3) RGB, of the builder's size.
            advice: the rule's answer to it.

        Raises:
            ShapeError: the image is of another size.
            ValueRangeError: the rule answered with a class that the student cannot learn.
        """
        width, height = self._size_px
        if image.shape != (height, width, 3):
            raise ShapeError("image", expected=f"{height}x{width}x3", actual=image.shape)
        _, data = cv2.imencode(".jpg", np.ascontiguousarray(image[..., ::-1]), _JPEG)
        self._images.append(np.asarray(data, dtype=np.uint8).reshape(-1))
        self._poses.append((advice.captured_s, advice.x_m, advice.y_m, advice.yaw_rad))
        self._ego.append(
            (
                advice.height_above_ground_m,
                advice.gimbal_pitch_rad,
                float(advice.turning),
                float(advice.full_turns),
            )
        )
        self._labels.append([_label(advice.answer), _label(advice.fresh)])

    def __len__(self) -> int:
        """How many views there are."""
        return len(self._images)

    def flight(self) -> ControlFlight:
        """Return the flight.

        Raises:
            ValueRangeError: the flight has no views.
        """
        if not self._images:
            raise ValueRangeError("a flight without labelled views cannot be learned from")
        return ControlFlight(
            size_px=np.array(self._size_px),
            images=np.concatenate(self._images),
            ends=np.cumsum([len(data) for data in self._images]),
            poses=np.array(self._poses),
            ego=np.array(self._ego),
            labels=np.array(self._labels, dtype=np.float32),
        )


def _label(answer: Answer) -> tuple[float, ...]:
    match answer:
        case Advance(forward_m=forward_m, yaw_rad=yaw_rad, free_m=free_m):
            ends = 0.0
        case Blocked(yaw_rad=yaw_rad, ground_ends=ground_ends, free_m=free_m):
            forward_m, ends = 0.0, float(ground_ends)
        case _:
            raise ValueRangeError(
                "the student learns from answers that are Advance or Blocked, got "
                f'{answer!r:.80}: fly with <Advise policy="corridor"/>'
            )
    return forward_m, yaw_rad, ends, np.nan if free_m is None else free_m


def write_flight(path: Path, flight: ControlFlight) -> None:
    """Write a flight's views; the file is replaced in one step."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as partial, partial.open("wb") as file:
        np.savez(file, **{item.name: getattr(flight, item.name) for item in fields(ControlFlight)})


def read_flight(path: Path) -> ControlFlight:
    """Read a flight's views.

    Raises:
        FileError: the file is absent or damaged.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as content:
            return ControlFlight(
                **{item.name: content[item.name] for item in fields(ControlFlight)}
            )
    except Exception as error:  # numpy raises various errors of zip, zlib and its parser
        raise FileError(path, f"is not a file of labelled views ({error}); delete it") from error


# --- windows --------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class SampleConfig:
    """Which views are used for training, and how often."""

    # Views of the mission's middle: in flight, looking ahead.
    heights_m: tuple[float, float] = (1.0, 2.2)
    pitches_rad: tuple[float, float] = (-0.75, -0.25)
    # Views with a free path shorter than near_m are near an obstacle. They are sampled near_weight
    # times as often; the paper uses them twice.
    near_m: float = 0.7
    near_weight: float = 2.0
    # Share of views with a turn under way that are used without it, with the rule's answer for that
    # case. Few views show the beginning of a turn, where its side is chosen.
    fresh: float = 0.5

    def __post_init__(self) -> None:
        if not (self.near_weight > 0.0 and 0.0 <= self.fresh <= 1.0):
            raise ValueRangeError(
                f"near_weight must be positive and fresh a share, got {self.near_weight} and "
                f"{self.fresh}"
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class Batch:
    """Windows of views for training."""

    frames: NDArray[np.uint8]  # (N, V, H, W, 3) RGB, the present view first
    state: NDArray[np.float32]  # (N, S) `state_vector`
    labels: NDArray[np.float32]  # (N, 4) as in `ControlFlight`
    turning: NDArray[np.float32]  # (N,) the turn under way


class ControlSamples:
    """All windows of some flights.

    Args:
        flights: their views, all of the network's size.
        net: the network, for its size and the ages of its views.
        config: which views are taken, and how often.

    Raises:
        ShapeError: images are of another size.
        ValueRangeError: no view can be learnt from.
    """

    def __init__(
        self,
        flights: Sequence[ControlFlight],
        net: ControlNetConfig,
        config: SampleConfig | None = None,
    ) -> None:
        self.config = config or SampleConfig()
        self._net = net
        self._flights = tuple(flights)
        wanted = (net.width_px, net.height_px)
        for flight in self._flights:
            if tuple(flight.size_px) != wanted:
                raise ShapeError(
                    "a flight's images",
                    expected="x".join(map(str, wanted)),
                    actual=flight.size_px.tolist(),
                )
        taken = [self._taken(flight) for flight in self._flights]
        counts = np.array([len(places) for places in taken], dtype=np.int64)
        self._flight = np.repeat(np.arange(len(taken)), counts)
        if not len(self._flight):
            raise ValueRangeError(
                f"{len(self._flights)} flights hold no view to learn from: none was captured "
                f"{self.config.heights_m} m high with the camera at {self.config.pitches_rad} rad"
            )
        self._place = np.concatenate(taken)
        near = np.array([self._is_near(at) for at in range(len(self))])
        weights = np.where(near, self.config.near_weight, 1.0)
        self._upto = np.cumsum(weights) / weights.sum()
        self.near_share = float(near.mean())

    def __len__(self) -> int:
        """Return the number of windows."""
        return len(self._flight)

    def draw(self, rng: np.random.Generator, count: int) -> Batch:
        """Return random windows, those near obstacles more often."""
        chosen = np.searchsorted(self._upto, rng.random(count), side="right")
        fresh = rng.random(count) < self.config.fresh
        return self._batch(np.minimum(chosen, len(self) - 1), fresh)

    def window(self, places: Sequence[int]) -> Batch:
        """Return windows by number, without changes."""
        return self._batch(np.asarray(places), np.zeros(len(places), dtype=bool))

    def _batch(self, chosen: NDArray[np.int64], fresh: NDArray[np.bool_]) -> Batch:
        frames, states, labels, turning = [], [], [], []
        for at, unturned in zip(chosen, fresh, strict=True):
            flight, place = self._flights[self._flight[at]], int(self._place[at])
            height_m, pitch_rad, turn, full_turns = flight.ego[place]
            ego = EgoState(
                height_above_ground_m=height_m,
                gimbal_pitch_rad=pitch_rad,
                turning=0 if unturned else int(turn),
                full_turns=0 if unturned else int(full_turns),
            )
            views = self._views(flight, place)
            frames.append(np.stack([flight.image(view) for view in views]))
            states.append(state_vector(ego, [flight.pose(view) for view in views]))
            labels.append(flight.labels[place, int(unturned)])
            turning.append(ego.turning)
        return Batch(
            frames=np.stack(frames),
            state=np.stack(states),
            labels=np.stack(labels),
            turning=np.array(turning, dtype=np.float32),
        )

    def _views(self, flight: ControlFlight, place: int) -> list[int]:
        """Return the places of a window's views: as `RecentViews.ago` finds them in flight."""
        times_s = flight.poses[: place + 1, 0]
        return [
            int(np.abs(times_s - (times_s[place] - age_s)).argmin()) for age_s in self._net.ages_s
        ]

    def _taken(self, flight: ControlFlight) -> NDArray[np.int64]:
        (low_m, high_m), (down_rad, up_rad) = self.config.heights_m, self.config.pitches_rad
        height_m, pitch_rad = flight.ego[:, 0], flight.ego[:, 1]
        good = (height_m >= low_m) & (height_m <= high_m)
        return np.flatnonzero(good & (pitch_rad >= down_rad) & (pitch_rad <= up_rad))

    def _is_near(self, at: int) -> bool:
        free_m = self._flights[self._flight[at]].labels[self._place[at], 1, 3]
        return bool(free_m < self.config.near_m)
