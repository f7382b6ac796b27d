"""Training data of the control student, without torch: labelled views of flights, and scores."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.control.ego_state import ControlNetConfig, state_vector
from perception.control.runtime import ControlEstimate
from uav_bt.answers import Advance, Answer, Blocked
from uav_bt.errors import FileError, ValueRangeError
from uav_bt.files import whole_file
from uav_bt.protocols import Advice
from uav_bt.types.arrays import Flags, Floats, Floats32, Image, Indices
from uav_bt.types.dead_reckoning import OdometryPose

# Shrinking has already removed noise; a JPEG has a sixth of a PNG's bytes.
_JPEG: Final = [cv2.IMWRITE_JPEG_QUALITY, 95]
# Views of the mission's middle: in flight, looking ahead.
_HEIGHTS_M: Final = (1.0, 2.2)
_PITCHES_RAD: Final = (-0.75, -0.25)
_NEAR_M: Final = 0.7  # views with a shorter free path are near an obstacle
# Share of views with a turn under way that are used without it, with the rule's answer for that
# case. Few views show the beginning of a turn, where its side is chosen.
_FRESH: Final = 0.5
_AT_ONCE: Final = 32  # scored windows


@dataclass(frozen=True, kw_only=True, eq=False)
class ControlFlight:
    """One flight: N labelled views in the order of time."""

    images: Image  # (B,) concatenated JPEG files
    ends: NDArray[np.int64]  # (N,) end of each file in `images`
    poses: Floats  # (N, 4) time, x, y, yaw: `OdometryPose`
    ego: Floats  # (N, 4) height, gimbal pitch, turn under way, full turns
    # (N, 2, 4) forward_m, yaw_rad, ground_ends, free_m of the rule's answer with the turn under
    # way, and without it; free_m NaN if unknown.
    labels: Floats32

    def image(self, place: int) -> Image:
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


def advised_flight(views: Iterable[tuple[Image, Advice]]) -> ControlFlight | None:
    """Return a flight of images, (H, W, 3) RGB, and the rule's answers to them; None if empty."""
    images: list[Image] = []
    rows: list[tuple[float, ...]] = []
    labels: list[tuple[tuple[float, ...], tuple[float, ...]]] = []
    for image, advice in views:
        _, data = cv2.imencode(".jpg", np.ascontiguousarray(image[..., ::-1]), _JPEG)
        images.append(np.asarray(data, dtype=np.uint8).reshape(-1))
        pose = (advice.captured_s, advice.x_m, advice.y_m, advice.yaw_rad)
        ego = (advice.height_above_ground_m, advice.gimbal_pitch_rad)
        rows.append((*pose, *ego, float(advice.turning), float(advice.full_turns)))
        labels.append((_label(advice.answer), _label(advice.fresh)))
    if not images:
        return None
    return ControlFlight(
        images=np.concatenate(images),
        ends=np.cumsum([len(data) for data in images]),
        poses=np.array(rows)[:, :4],
        ego=np.array(rows)[:, 4:],
        labels=np.array(labels, dtype=np.float32),
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
    """Read a flight's views; FileError if the file is absent or damaged."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as content:
            return ControlFlight(
                **{each.name: content[each.name] for each in fields(ControlFlight)}
            )
    except Exception as error:  # numpy raises various errors of zip, zlib and its parser
        raise FileError(path, f"is not a file of labelled views ({error}); delete it") from error


# --- windows --------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class Batch:
    """Windows of views for training."""

    frames: Image  # (N, V, H, W, 3) RGB, the present view first
    state: Floats32  # (N, S) `state_vector`
    labels: Floats32  # (N, 4) as in `ControlFlight`
    turning: Floats32  # (N,) the turn under way


class ControlSamples:
    """All windows of some flights, whose images have the network's size.

    Views near an obstacle are sampled `near_weight` times as often; the paper uses them twice.
    """

    def __init__(
        self, flights: Sequence[ControlFlight], net: ControlNetConfig, near_weight: float = 2.0
    ) -> None:
        self._ages_s = net.ages_s
        self._flights = flights
        self._windows = [(flight, int(at)) for flight in flights for at in _taken(flight)]
        if not self._windows:
            raise ValueRangeError(
                f"{len(flights)} flights hold no view to learn from: none was captured "
                f"{_HEIGHTS_M} m high with the camera at {_PITCHES_RAD} rad"
            )
        near = np.array([flight.labels[at, 1, 3] < _NEAR_M for flight, at in self._windows])
        weights = np.where(near, near_weight, 1.0)
        self._upto = np.cumsum(weights) / weights.sum()
        self.near_share = float(near.mean())

    def __len__(self) -> int:
        """Return the number of windows."""
        return len(self._windows)

    def draw(self, rng: np.random.Generator, count: int) -> Batch:
        """Return random windows, those near obstacles more often."""
        chosen = np.searchsorted(self._upto, rng.random(count), side="right")
        return self._batch(np.minimum(chosen, len(self) - 1), rng.random(count) < _FRESH)

    def window(self, places: Sequence[int]) -> Batch:
        """Return windows by number, without changes."""
        return self._batch(np.asarray(places), np.zeros(len(places), dtype=bool))

    def _batch(self, chosen: NDArray[np.int64], fresh: Flags) -> Batch:
        frames, states, labels, turns = [], [], [], []
        for number, unturned in zip(chosen, fresh, strict=True):
            flight, place = self._windows[number]
            height_m, pitch_rad, turning, full_turns = flight.ego[place]
            if unturned:
                turning = full_turns = 0
            # The places of the views: as `RecentViews.ago` finds them in flight.
            times_s = flight.poses[: place + 1, 0]
            ages_s = np.subtract.outer(self._ages_s, times_s[place] - times_s)
            views = np.abs(ages_s).argmin(axis=1)
            frames.append(np.stack([flight.image(view) for view in views]))
            state = state_vector(
                [flight.pose(view) for view in views],
                height_above_ground_m=height_m,
                gimbal_pitch_rad=pitch_rad,
                turning=int(turning),
                full_turns=int(full_turns),
            )
            states.append(state)
            labels.append(flight.labels[place, int(unturned)])
            turns.append(turning)
        return Batch(
            frames=np.stack(frames),
            state=np.stack(states),
            labels=np.stack(labels),
            turning=np.array(turns, dtype=np.float32),
        )


def _taken(flight: ControlFlight) -> Indices:
    (low_m, high_m), (down_rad, up_rad) = _HEIGHTS_M, _PITCHES_RAD
    height_m, pitch_rad = flight.ego[:, 0], flight.ego[:, 1]
    good = (height_m >= low_m) & (height_m <= high_m)
    return np.flatnonzero(good & (pitch_rad >= down_rad) & (pitch_rad <= up_rad))


# --- scores ---------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class ControlScore:
    """Agreement with the rule; shares are of the windows that they apply to."""

    windows: int
    missed: float  # share of paths blocked for the rule where the student advances
    stopped: float  # share of paths free for the rule where the student turns
    wrong_side: float  # share of beginning turns to the wrong side
    step_error_m: float  # mean absolute error of the step, where both advance
    step_excess_m: float  # mean excess of the step, where both advance
    wrong_end: float  # share of views with a wrong end of the ground
    free_error_m: float  # mean absolute error of the free path
    movement_mse: float  # the paper's mean squared error of forward metres and yaw radians

    def to_json(self) -> dict[str, float | None]:
        """Return the score as plain JSON values; None for measures without windows."""
        return {name: value if np.isfinite(value) else None for name, value in asdict(self).items()}


def score_control(
    predict: Callable[[Batch], Sequence[ControlEstimate]],
    samples: ControlSamples,
    *,
    max_windows: int = 2000,
) -> ControlScore:
    """Score a network on windows without augmentation, evenly spread over all."""
    count = min(max_windows, len(samples))
    chosen = np.unique(np.linspace(0, len(samples) - 1, count).astype(int))
    estimates: list[ControlEstimate] = []
    parts: list[Floats32] = []
    for first in range(0, len(chosen), _AT_ONCE):
        batch = samples.window([int(at) for at in chosen[first : first + _AT_ONCE]])
        estimates += predict(batch)
        parts.append(np.column_stack([batch.labels, batch.turning]))
    forward_m, yaw_rad, ends, free_m, turning = np.concatenate(parts).T.astype(float)
    said = {
        item.name: np.array([getattr(each, item.name) for each in estimates])
        for item in fields(ControlEstimate)
    }
    free, goes, clockwise = forward_m > 0.0, said["advance"] > 0.5, said["clockwise"] > 0.5
    excess = (said["step_m"] - forward_m)[free & goes]
    turn_rad = np.where(goes, 0.0, np.where(clockwise, 1.0, -1.0) * np.pi / 6.0)
    step_m = np.where(goes, said["step_m"], 0.0)
    squared = (step_m - forward_m) ** 2 + (turn_rad - yaw_rad) ** 2
    return ControlScore(
        windows=len(chosen),
        missed=_mean(goes[~free]),
        stopped=_mean(~goes[free]),
        wrong_side=_mean((clockwise != (yaw_rad > 0.0))[~free & (turning == 0.0)]),
        step_error_m=_mean(np.abs(excess)),
        step_excess_m=_mean(np.maximum(excess, 0.0)),
        wrong_end=_mean((said["ground_ends"] > 0.5) != (ends > 0.5)),
        free_error_m=_mean(np.abs(said["free_m"] - free_m)[np.isfinite(free_m)]),
        movement_mse=_mean(squared) / 2.0,
    )


def _mean(values: NDArray[Any]) -> float:
    return float(np.mean(values)) if len(values) else float("nan")
