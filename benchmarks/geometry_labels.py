"""Measure the labels of ground by geometry alone against the twin's exact class ids.

    python -m benchmarks.geometry_labels                              # training and validation
    python -m benchmarks.geometry_labels --lab depot --scenes "depot-val-*" --pictures out

Each flight takes off and turns once around (`SwayAround`), with the errors of the twin's
profile `lab`. No network runs. "coplanar" counts as ground also what lies in the plane of the
ground beyond its edge, such as the bare floor beside a carpet: geometry cannot distinguish them.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.segmentation import scenes_of
from perception.camera.ground_plane import CameraView, ground_depth
from perception.odometry.flown_footage import FootageBuilder
from perception.segmentation.geometry.labels import GROUND, NOT_GROUND, UNKNOWN, GroundLabels
from perception.segmentation.geometry.learn_labels import LABELLED_SIZE_PX, ground_labels
from sim_bridge.twin.scene_file import load_scene
from uav_bt import app
from uav_bt.errors import InputError
from uav_bt.lab.roles import GROUND as GROUND_ROLE
from uav_bt.lab.shipped import load_lab
from uav_bt.mission.tick import TickRecord
from uav_bt.protocols import Drone
from uav_bt.types import Frame

TREE: Final = Path(__file__).parent / "missions" / "sway_around.xml"
FOOTAGE_PX: Final = (448, 224)
SCENES: Final = ["train-*", "val-*", "depot-train-*", "depot-val-*"]
COPLANAR: Final = 0.04  # relative difference of depth from the ground plane


@dataclass
class Truth:
    """Exact roles, (H, W), and depth, (H, W) m, of the frames of a flight, by their index."""

    roles: dict[int, NDArray[np.uint8]] = field(default_factory=dict)
    depth_m: dict[int, NDArray[np.float32]] = field(default_factory=dict)
    frames: dict[int, Frame] = field(default_factory=dict)


class Gatherer:
    """Gathers the footage of the turn, and the truth of its frames."""

    def __init__(self) -> None:
        self._flight: app.Flight[Drone] | None = None
        self.builder: FootageBuilder | None = None
        self.truth = Truth()

    def follow(self, flight: app.Flight[Drone]) -> Sequence[Gatherer]:
        """Become a listener of a flight."""
        self._flight = flight
        self.builder = FootageBuilder(flight.drone.camera, FOOTAGE_PX)
        return (self,)

    def on_tick(self, record: TickRecord) -> None:
        """Keep telemetry, and the frames of the turn with their truth."""
        if self._flight is None or self.builder is None:
            return
        self.builder.add_state(record.observation.state)
        frame, referee = record.observation.frame, self._flight.drone.referee
        turning = any("SwayAround" in name for name in record.active)
        if not turning or frame is None or referee is None or not self.builder.add_frame(frame):
            return
        ids = referee.class_ids(frame, *LABELLED_SIZE_PX)
        self.truth.roles[frame.index] = self._flight.context.classes.roles(ids)
        self.truth.depth_m[frame.index] = referee.depth(frame, *LABELLED_SIZE_PX)
        self.truth.frames[frame.index] = frame


@dataclass
class Counts:
    """Numbers of pixels."""

    total: int = 0
    known: int = 0
    ground: int = 0  # labelled as ground
    right_ground: int = 0
    coplanar: int = 0  # labelled as ground, not ground by role, in its plane
    true_ground: int = 0
    other: int = 0  # labelled as not ground
    right_other: int = 0

    def add(
        self,
        labels: NDArray[np.uint8],
        roles: NDArray[np.uint8],
        off_plane: NDArray[np.float32],
    ) -> None:
        """Count the pixels of a frame.

        Args:
            labels: (H, W) of `perception.segmentation.geometry.labels`.
            roles: (H, W), the exact ones.
            off_plane: (H, W), relative difference of the depth from the ground plane's.
        """
        ground, true = labels == GROUND, roles == GROUND_ROLE
        self.total += labels.size
        self.known += int(np.count_nonzero(labels != UNKNOWN))
        self.ground += int(ground.sum())
        self.right_ground += int((ground & true).sum())
        self.coplanar += int((ground & ~true & (off_plane < COPLANAR)).sum())
        self.true_ground += int(true.sum())
        self.other += int((labels == NOT_GROUND).sum())
        self.right_other += int(((labels == NOT_GROUND) & ~true).sum())

    def to_json(self) -> dict[str, float]:
        """Return the shares."""
        ground, other = max(self.ground, 1), max(self.other, 1)
        return {
            "ground_precision": round(self.right_ground / ground, 4),
            "ground_precision_coplanar": round((self.right_ground + self.coplanar) / ground, 4),
            "ground_recall": round(self.right_ground / max(self.true_ground, 1), 4),
            "other_precision": round(self.right_other / other, 4),
            "other_recall": round(self.right_other / max(self.total - self.true_ground, 1), 4),
            "known_share": round(self.known / max(self.total, 1), 4),
        }


def fly_around(lab: str, scene: str, seed: int) -> Gatherer:
    """Fly the turn in a scene of a lab."""
    gathered = Gatherer()
    options = app.FlightOptions(lab=lab, scene=scene, seed=seed)
    app.fly(str(TREE), options, listeners=[gathered.follow])
    return gathered


def draw(labels: GroundLabels, truth: Truth, index: int) -> NDArray[np.uint8]:
    """Return a frame beside its labels: green and blue right, red and magenta wrong; BGR."""
    image = cv2.resize(truth.frames[index].image, LABELLED_SIZE_PX)[:, :, ::-1]
    true = truth.roles[index] == GROUND_ROLE
    drawn = (image * 0.5).astype(np.uint8)
    for label, right, colour in (
        (GROUND, True, (0, 200, 0)),
        (GROUND, False, (0, 0, 255)),
        (NOT_GROUND, False, (255, 0, 255)),
        (NOT_GROUND, True, (200, 120, 0)),
    ):
        drawn[(labels.labels == label) & ((true == (label == GROUND)) == right)] = colour
    return np.hstack([image, drawn])


def measure(lab: str, scene: str, seed: int, pictures: Path | None) -> Counts:
    """Fly in a scene, label its frames, and count."""
    gathered = fly_around(lab, scene, seed)
    if gathered.builder is None:
        raise SystemExit(f"the flight in {scene} gathered nothing")
    footage = gathered.builder.footage()
    began_s = time.process_time()
    found = ground_labels(footage)
    took_s = time.process_time() - began_s
    counts = Counts()
    camera = footage.camera.resized(*LABELLED_SIZE_PX)
    for each in found:
        index = int(footage.index[each.frame])
        frame = gathered.truth.frames[index]
        plane_m = ground_depth(
            CameraView(
                camera=camera,
                pitch_rad=frame.gimbal_pitch_rad,
                height_m=frame.height_above_ground_m,
            )
        )
        off = np.abs(plane_m / gathered.truth.depth_m[index] - 1.0)
        counts.add(each.labels, gathered.truth.roles[index], np.nan_to_num(off, nan=1.0))
    print(f"{lab} {scene} seed {seed}: {len(found)} frames, {took_s:.1f} s, {counts.to_json()}")
    if pictures is not None:
        pictures.mkdir(parents=True, exist_ok=True)
        shown = [draw(each, gathered.truth, int(footage.index[each.frame])) for each in found[::3]]
        cv2.imwrite(str(pictures / f"{Path(scene).stem}-{seed}.png"), np.vstack(shown))
    return counts


def _matching(lab: str, pattern: str) -> tuple[str, ...]:
    """Return the scenes of a lab that match a pattern; none is no mistake here."""
    try:
        found = scenes_of(load_lab(lab), pattern)
    except InputError:
        return ()
    # The shipped scenes are those of all labs.
    return tuple(scene for scene in found if load_lab(load_scene(scene).lab).name == lab)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the shares by scene, and of all scenes of a lab."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--lab", nargs="+", default=["paper", "depot"])
    parser.add_argument("--scenes", nargs="+", default=SCENES, help="patterns")
    parser.add_argument("--seed", nargs="+", type=int, default=[1])
    parser.add_argument("--pictures", type=Path, help="folder for pictures of the labels")
    parser.add_argument("--out", type=Path, help="JSON file")
    given = parser.parse_args(arguments)
    result = {}
    for lab in given.lab:
        total = Counts()
        scenes = [scene for each in given.scenes for scene in _matching(lab, each)]
        for scene in scenes:
            for seed in given.seed:
                counts = measure(lab, scene, seed, given.pictures)
                for name, value in vars(counts).items():
                    setattr(total, name, getattr(total, name) + value)
        result[lab] = total.to_json()
        print(f"{lab}, all: {result[lab]}")
    if given.out is not None:
        given.out.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
