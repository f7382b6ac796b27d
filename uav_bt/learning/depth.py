"""Training and evaluation of the depth network: footage in, weights out, measured on the twin."""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.ground_plane import CameraView, ground_depth
from perception.depth.evaluation.scores import DepthSample, DepthScore, score_depth
from perception.depth.training.clips import ClipSource, DepthLabels, Flight
from perception.depth.training.labelling import (
    LABEL_SIZE_PX,
    add_parallax,
    footing_labels,
    read_labels,
    write_labels,
)
from perception.networks.weights_file import SHIPPED_WEIGHTS
from perception.odometry.footage import Footage, shrink
from uav_bt.errors import FileError
from uav_bt.learning.dataset import footage_of
from uav_bt.learning.scenes import VALIDATION_SCENES
from uav_bt.progress import Advance, silent
from uav_bt.protocols import Segmenter
from uav_bt.types import CameraModel

__all__ = [
    "SHIPPED_DEPTH",
    "DepthViewPlan",
    "DepthViews",
    "Diary",
    "depth_strip",
    "depth_views",
    "read_flights",
    "score_depth_on",
    "train_depth",
]

SHIPPED_DEPTH: Final = SHIPPED_WEIGHTS / "depth.safetensors"

Image = NDArray[np.uint8]


# --- labels ---------------------------------------------------------------------------------------


def read_flights(
    paths: Sequence[Path],
    segmenter: Segmenter | None,
    folder: Path,
    *,
    advance: Advance = silent,
) -> list[Flight]:
    """Read records and, where there is a segmenter, label it; labels already made are kept.

    Args:
        paths: of the records.
        segmenter: gives the masks that labels are made from; None for no labels.
        folder: where labels are kept, so that a broken-off run goes on.
        advance: told of every frame that is labelled, and when a flight is done.
    """
    flights = []
    for done, path in enumerate(paths, start=1):
        footage = footage_of(path)
        labels = None
        if segmenter is not None:
            labels = _kept_labels(path, footage, segmenter, folder, advance)
        flights.append(Flight(footage=footage, labels=labels))
        advance("flights", done, len(paths))
    return flights


def _kept_labels(
    path: Path, footage: Footage, segmenter: Segmenter, folder: Path, advance: Advance
) -> DepthLabels:
    about = zlib.crc32(footage.captured_s.tobytes() + footage.frames[-1].tobytes())
    file = folder / f"labels-{path.stem}-{about:08x}.npz"
    if file.is_file():
        return read_labels(file)

    def tell(stage: str) -> Callable[[int, int], None]:
        return lambda done, total: advance(f"{stage}, {path.stem}", done, total)

    standing = footing_labels(footage, segmenter, advance=tell("footing"))
    made = add_parallax(footage, standing, advance=tell("parallax"))
    folder.mkdir(parents=True, exist_ok=True)
    write_labels(file, made)
    return made


# --- validation -----------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class DepthViewPlan:
    """Which pictures of the twin depth is measured on."""

    scenes: tuple[str, ...] = VALIDATION_SCENES
    views: int = 40  # pictures a scene
    profile: str = "lab"  # whose noise, blur and exposure error the pictures get
    least_pitch_rad: float = -0.8  # steeper pictures, of landings, are left out: no depth is used
    seed: int = 11


@dataclass(frozen=True, kw_only=True, eq=False)
class DepthViews:
    """Pictures with exact depth and ids, and exact ground plane, at the network's output size."""

    rgb: Image  # (N, 256, 320, 3)
    depth_m: NDArray[np.float32]  # (N, 128, 160)
    ids: Image  # (N, 128, 160)
    ground_m: NDArray[np.float32]  # (N, 128, 160)


def depth_views(plan: DepthViewPlan) -> DepthViews:
    """Take the pictures of a plan; the same plan gives the same pictures.

    Raises:
        SceneError: a scene is missing or malformed.
        MissingDependencyError: OpenGL does not work here.
    """
    # Imported here: training on real flights needs no simulator.
    from sim_bridge.anafi import anafi_camera  # noqa: PLC0415
    from sim_bridge.twin.profile import Profile  # noqa: PLC0415
    from sim_bridge.twin.scene_file import load_scene  # noqa: PLC0415
    from sim_bridge.twin.views import render_views, sample_flight_poses  # noqa: PLC0415

    camera: CameraModel = anafi_camera(640, 360).resized(*LABEL_SIZE_PX)
    pictures, depths, ids, grounds = [], [], [], []
    for name in plan.scenes:
        scene = load_scene(name)
        seed = (plan.seed << 32) + zlib.crc32(scene.name.encode())
        poses = [
            pose
            for pose in sample_flight_poses(scene, np.random.default_rng(seed), 2 * plan.views)
            if pose.pitch_rad >= plan.least_pitch_rad
        ][: plan.views]
        for view in render_views(
            scene,
            poses,
            truth_size_px=LABEL_SIZE_PX,
            profile=Profile.named(plan.profile),
            seed=seed,
        ):
            pictures.append(shrink(view.image))
            depths.append(view.depth)
            ids.append(view.ids)
            level = CameraView(camera=camera, pitch_rad=view.pose.pitch_rad, height_m=view.pose.z_m)
            grounds.append(ground_depth(level))
    return DepthViews(
        rgb=np.stack(pictures),
        depth_m=np.stack(depths),
        ids=np.stack(ids),
        ground_m=np.stack(grounds).astype(np.float32),
    )


def score_depth_on(views: DepthViews, predicted: NDArray[np.float32]) -> DepthScore:
    """Score predictions, (N, 128, 160), on the pictures they were made from."""
    return score_depth(
        DepthSample(predicted=mine, truth_m=truth, ids=ids, ground_m=ground)
        for mine, truth, ids, ground in zip(
            predicted, views.depth_m, views.ids, views.ground_m, strict=True
        )
    )


class Diary:
    """What a run keeps beside its checkpoint: a line of scores for each validation, and pictures.

    Args:
        folder: `scores.jsonl` and `step-*.png` go there.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def note(self, step: int, terms: Mapping[str, float], score: DepthScore) -> None:
        """Add a line."""
        self._folder.mkdir(parents=True, exist_ok=True)
        line = {"step": step, "terms": dict(terms), **asdict(score)}
        with (self._folder / "scores.jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")

    def draw(
        self, step: int, views: DepthViews, predicted: NDArray[np.float32], *, rows: int = 6
    ) -> None:
        """Draw picture, true and predicted depth of some views beside each other."""
        self._folder.mkdir(parents=True, exist_ok=True)
        places = np.linspace(0, len(views.rgb) - 1, rows).astype(int)
        sheet = np.vstack(
            [
                depth_strip(views.rgb[place], views.depth_m[place], predicted[place])
                for place in places
            ]
        )
        path = self._folder / f"step-{step:06d}.png"
        done, content = cv2.imencode(".png", sheet[..., ::-1])
        if not done:
            raise FileError(path, "the picture cannot be written")
        path.write_bytes(content.tobytes())


def depth_strip(rgb: Image, truth_m: NDArray[np.float32], predicted: NDArray[np.float32]) -> Image:
    """Return picture, true depth and median-scaled depth side by side, (128, 480, 3) RGB."""
    scaled = predicted * np.median(truth_m / predicted)
    return np.hstack([shrink(rgb, LABEL_SIZE_PX), _coloured(truth_m), _coloured(scaled)])


def _coloured(depth_m: NDArray[np.float32]) -> Image:
    # By inverse depth, so that what is near, and matters, gets most of the colours.
    share = np.clip((1.0 / depth_m - 1.0 / 8.0) / (1.0 / 0.6 - 1.0 / 8.0), 0.0, 1.0)
    grey = np.rint(255.0 * share).astype(np.uint8)
    bgr = cv2.applyColorMap(grey, cv2.COLORMAP_TURBO)
    return np.asarray(bgr[..., ::-1], dtype=np.uint8)


# --- training -------------------------------------------------------------------------------------


def train_depth(
    flights: Sequence[Flight],
    weights: Path,
    *,
    config: Any = None,
    net_config: Any = None,
    start: Path | None = None,
    checkpoint: Path | None = None,
    views: DepthViews | None = None,
    validate_every: int = 200,
    advance: Advance = silent,
    diary: Diary | None = None,
) -> DepthScore | None:
    """Train the depth network and write its safetensors and, beside them, the ONNX file.

    Args:
        flights: what to learn from.
        weights: the safetensors file; the ONNX file has the same name.
        config: a `perception.depth.training.run.DepthTrainingConfig`; None for its defaults.
        net_config: a `perception.depth.training.network.DepthNetConfig`; None for its defaults.
        start: weights of a depth network to begin with; None for random ones.
        checkpoint: the state of a run to go on from, and to keep.
        views: pictures with the truth to validate on; None where nobody knows it.
        validate_every: steps.
        advance: told after every step, with the loss in the stage's name.
        diary: keeps the terms of the loss, the scores and pictures, when it was validated.

    Returns:
        The score at the end, None without views.
    """
    # Imported here: torch is large and only training needs it.
    from perception.depth.training import network, run  # noqa: PLC0415

    settings = run.DepthTrainingConfig() if config is None else config
    shape = network.DepthNetConfig() if net_config is None else net_config

    def predictions(net: Any, pictures: Image) -> NDArray[np.float32]:
        parts = [
            run.predict_depth(net, pictures[first : first + 8])
            for first in range(0, len(pictures), 8)
        ]
        return np.concatenate(parts)

    def validate(now: Any, net: Any) -> None:
        advance(f"training, loss {now.loss:.3f}", now.step, now.steps)
        due = now.step % validate_every == 0 or now.step == now.steps
        if due and views is not None and diary is not None:
            predicted = predictions(net, views.rgb)
            diary.note(now.step, now.terms, score_depth_on(views, predicted))
            diary.draw(now.step, views, predicted)

    clips = ClipSource(flights, settings.clips)
    net = run.train_depth(
        clips, settings, shape, start=start, checkpoint=checkpoint, progress=validate
    )
    final = score_depth_on(views, predictions(net, views.rgb)) if views is not None else None
    from perception.depth.training import export  # noqa: PLC0415

    notes = {
        "training": asdict(settings),
        "start": start.name if start is not None else None,
        "frames": clips.frame_count,
        "validation": asdict(final) if final is not None else None,
    }
    export.save_depth_net(weights, net, notes=notes)
    export.export_depth_onnx(weights, weights.with_suffix(".onnx"))
    return final
