"""Scales of rendered views with right and deliberately wrong inputs, against exact depth.

Each lab is judged with the depth network that it is flown with. Each pose is a sequence of three
frames, so that the second and third have a history. The exact scale of a frame is the median ratio
of exact to predicted depth on the ground in view or, with little ground in view, up to 6 m.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.lab_views import copy_lab
from benchmarks.segmentation import scenes_of
from perception.camera.ground_plane import CameraView, ground_depth
from perception.depth.runtime import load_depth_estimator
from perception.depth.scale import AdaptiveScale, sample_ground
from perception.networks.weights_file import SHIPPED_DEPTHS, SHIPPED_UNET, segmentation_file
from perception.segmentation.runtime import load_segmenter
from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import View, render_views
from uav_bt.app.lab_network import network_of
from uav_bt.lab.classes import GROUND, MARK
from uav_bt.lab.lab import LAB_FILE, Lab
from uav_bt.lab.shipped import DEFAULT_LAB, load_lab
from uav_bt.learning.views import DepthViewPlan, scene_seed
from uav_bt.types import Frame
from uav_bt.types.arrays import Flags, Floats32, Image
from uav_bt.yaml_file import read_yaml, yaml_text

OTHER_LAB: Final = "depot"
ROOM: Final = "room"
RIGHT: Final = ("own network", "pitch wrong", "height wrong")
"""Conditions with the class map of the lab's own network."""

_MAP_PX: Final = (224, 112)  # width and height of class maps, and so of the depth in flight
_STEPS: Final = 3  # frames of a sequence
_APART_S: Final = 0.1
_TURN_RAD: Final = math.radians(4)  # from frame to frame
_ADVANCE_M: Final = 0.06
_NEAR_M: Final = (0.3, 6.0)
_ENOUGH_PX: Final = 200  # of exact depth, for an exact scale
_PAINTED: Final = {"train": (0, 1, 2), "val": (3, 4), "test": (5, 6)}  # seeds of the colours
_CHANNELS: Final = ((2, 0, 1), (1, 2, 0), (0, 2, 1))  # other orders of red, green and blue


@dataclass(frozen=True, kw_only=True)
class JudgedScale:
    """The scale of one frame, and its error."""

    lab: str
    condition: str
    over_exact: float  # the scale's factor over the exact one
    confidence: float
    # Measures of the frame's ground by name, 0 to 1; empty where the scale is of earlier frames.
    measures: dict[str, float]

    @property
    def right(self) -> bool:
        """Whether the scale is within a fifth of the exact one."""
        return abs(math.log(self.over_exact)) <= math.log(1.2)


def judged_scales(
    split: str, views: int, seed: int = 31, *, rooms: Path | None = None
) -> Iterator[JudgedScale]:
    """Judge the scales of views of both labs, the second in other colours, too, and of rooms."""
    paper, depot = load_lab(), load_lab(OTHER_LAB)
    masks = {lab.name: _Masks(lab) for lab in (paper, depot)}
    for folder in () if rooms is None else sorted(rooms.iterdir()):
        lab = load_lab(folder)
        scene = str(folder / "scenes" / f"{folder.name}.yaml")
        judge = _Judge(ROOM, lab, (_Masks(lab), masks[OTHER_LAB]))
        for sequence in _sequences(scene, max(1, views // 6), seed):
            yield from judge(sequence, np.random.default_rng((seed, len(folder.name))))
    with TemporaryDirectory() as folder:
        painted = [_painted(depot, Path(folder) / str(each), each) for each in _PAINTED[split]]
        for lab, own, other, count in (
            (paper, DEFAULT_LAB, OTHER_LAB, views),
            (depot, OTHER_LAB, DEFAULT_LAB, views),
            *((each, OTHER_LAB, DEFAULT_LAB, max(1, views // 3)) for each in painted),
        ):
            name = lab.name if lab in (paper, depot) else "painted"
            judge = _Judge(name, lab, (masks[own], masks[other]))
            prefix = "" if own == DEFAULT_LAB else f"{OTHER_LAB}-"
            for scene in scenes_of(lab, f"{prefix}{split}-*"):
                for number, sequence in enumerate(_sequences(scene, count, seed)):
                    yield from judge(sequence, np.random.default_rng((seed, number)))


def _painted(lab: Lab, folder: Path, seed: int) -> Lab:
    """Return a copy of a lab whose ground, walls and objects have other colours."""
    rng = np.random.default_rng(seed)

    def colour() -> str:
        return f"#{bytes(rng.integers(30, 230, 3).tolist()).hex()}"

    file = copy_lab(lab, folder).lab.folder / LAB_FILE
    content = read_yaml(file, dict[str, Any], "lab file").value
    room = content["room"]
    generator = ("concrete", "wood")[seed % 2]
    room["ground"]["surface"] = {"generator": generator, "colour": colour()}
    for part in (room["walls"], *room["objects"].values()):
        part["surface"] = {"colour": colour()}
    file.write_text(yaml_text(content), encoding="utf-8")
    return load_lab(folder)


def _sequences(name: str, views: int, seed: int) -> Iterator[list[View]]:
    """Render sequences of a slowly turning and advancing camera."""
    scene = load_scene(name)
    mixed = scene_seed(seed, scene)
    rng = np.random.default_rng(mixed)
    poses = []
    for pose in DepthViewPlan(scenes=(name,), views=views).poses(scene, mixed):
        turn = _TURN_RAD if rng.random() < 0.5 else -_TURN_RAD
        for step in range(_STEPS):
            ahead = step * _ADVANCE_M
            x_m = pose.x_m + ahead * math.cos(pose.yaw_rad)
            y_m = pose.y_m + ahead * math.sin(pose.yaw_rad)
            poses.append(replace(pose, x_m=x_m, y_m=y_m, yaw_rad=pose.yaw_rad + step * turn))
    profile = Profile.named("lab")
    drawn = render_views(scene, poses, truth_size_px=_MAP_PX, profile=profile, seed=mixed)
    for _ in range(len(poses) // _STEPS):
        yield [next(drawn) for _ in range(_STEPS)]


class _Masks:
    """The ground by the network of a lab."""

    def __init__(self, lab: Lab) -> None:
        path = segmentation_file(network_of(lab).get("model", SHIPPED_UNET))
        if path is None:
            raise SystemExit(f"the lab {lab.name} is flown without a network")
        self._segmenter = load_segmenter(path, lab.classes, threads=2)

    def __call__(self, rgb: Image) -> Flags:
        frame = Frame(image=rgb, index=0, captured_s=0.0, gimbal_pitch_rad=0.0)
        ground = self._segmenter.segment(frame).is_ground.astype(np.uint8)
        resized = cv2.resize(ground, _MAP_PX, interpolation=cv2.INTER_NEAREST)
        return np.asarray(resized, dtype=bool)


class _Judge:
    """Judges sequences of one lab."""

    def __init__(self, name: str, lab: Lab, masks: tuple[_Masks, _Masks]) -> None:
        self._name, self._classes = name, lab.classes
        self._network = load_depth_estimator(network_of(lab).get("depth", SHIPPED_DEPTHS[0]))
        self._own, self._other = masks
        self._camera = anafi_camera(640, 360).resized(*_MAP_PX)

    def __call__(self, views: Sequence[View], rng: np.random.Generator) -> Iterator[JudgedScale]:
        signs, (width_px, height_px) = rng.choice((-1.0, 1.0), 2), _MAP_PX
        top, left = rng.integers(30, height_px - 30), rng.integers(0, width_px - 40)
        rows, columns = rng.integers(12, 40), rng.integers(20, 60)
        patch = (slice(top, top + rows), slice(left, left + columns))
        wrong_rad = float(signs[0]) * math.radians(rng.uniform(2.0, 7.0))
        wrong_height = float(signs[1]) * rng.uniform(0.03, 0.1)  # relative
        for channels in (None, _CHANNELS[rng.integers(len(_CHANNELS))]):
            scales: dict[str, AdaptiveScale] = {}
            for step, view in enumerate(views):
                rgb = view.image
                if channels is not None:
                    rgb = np.ascontiguousarray(rgb[..., list(channels)])
                frame = Frame(image=rgb, index=step, captured_s=0.0, gimbal_pitch_rad=0.0)
                depth = self._network.estimate(frame)
                relative = np.asarray(cv2.resize(depth.depth, _MAP_PX), dtype=np.float32)
                exact = self._exact(view, relative)
                if exact is None:
                    continue
                for name, ground in self._grounds(rgb, view, patch, every=channels is None):
                    condition = name if channels is None else f"{name}, other colours"
                    scale = scales.setdefault(name, AdaptiveScale())
                    pitch = wrong_rad if name == "pitch wrong" else 0.0
                    height = wrong_height if name == "height wrong" else 0.0
                    plane_m = self._plane_m(view, pitch, height)
                    sample = sample_ground(relative, ground, plane_m, rng)
                    height_m = view.pose.z_m * (1.0 + height) if depth.in_heights else None
                    found = scale(sample, step * _APART_S, height_m)
                    if found is None:
                        continue
                    measures = found.confidence.measures.items()
                    yield JudgedScale(
                        lab=self._name,
                        condition=condition,
                        over_exact=found.factor / exact,
                        confidence=found.confidence.value or 0.0,
                        measures={key: value for key, (value, _) in measures},
                    )

    def _plane_m(self, view: View, pitch_rad: float, height: float) -> NDArray[np.float32]:
        pitch_rad = max(-math.pi / 2, view.pose.pitch_rad + pitch_rad)
        height_m = view.pose.z_m * (1.0 + height)
        return ground_depth(CameraView(camera=self._camera, pitch_rad=pitch_rad, height_m=height_m))

    def _exact(self, view: View, relative: Floats32) -> float | None:
        near = (view.depth > _NEAR_M[0]) & (view.depth < _NEAR_M[1])
        for pixels in (near & (self._classes.roles(view.ids) == GROUND), near):
            if np.count_nonzero(pixels) > _ENOUGH_PX:
                return float(np.median(view.depth[pixels] / relative[pixels]))
        return None

    def _grounds(
        self, rgb: Image, view: View, where: tuple[slice, slice], *, every: bool
    ) -> Iterator[tuple[str, Flags]]:
        """Return the ground by condition; not every condition in other colours."""
        own = self._own(rgb)
        yield "own network", own
        yield "other lab's network", self._other(rgb)
        if not every:
            return
        yield "pitch wrong", own
        yield "height wrong", own
        above = self._classes.roles(view.ids) >= MARK
        patch = np.zeros_like(own)
        patch[where] = True
        yield "outside as ground", ~above & (self._classes.roles(view.ids) != GROUND)
        yield "obstacles as ground", above
        yield "a patch as ground", patch
        yield "everything as ground", np.ones_like(own)
