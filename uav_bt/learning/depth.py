"""Training and evaluation of the depth network: footage in, weights out, measured on the twin."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
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
    contact_labels,
    read_labels,
    write_labels,
)
from perception.odometry.camera_track import Footage, shrink
from uav_bt.errors import FileError
from uav_bt.learning.dataset import footage_of
from uav_bt.learning.diary import Diary
from uav_bt.learning.scenes import VALIDATION_SCENES
from uav_bt.protocols import Advance, Segmenter, silent
from uav_bt.types import CameraModel

CURVES: Final = ("loss", "abs_rel", "obstacle_error_m", "carpet_error_m")
"""What a run's diary draws."""

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
        advance: called for every frame that is labelled, and when a flight is done.
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

    standing = contact_labels(footage, segmenter, advance=tell("contact"))
    made = add_parallax(footage, standing, advance=tell("parallax"))
    folder.mkdir(parents=True, exist_ok=True)
    write_labels(file, made)
    return made


# --- validation -----------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class DepthViewPlan:
    """Which images of the twin depth is measured on."""

    scenes: tuple[str, ...] = VALIDATION_SCENES
    views: int = 40  # images a scene
    profile: str = "lab"  # whose noise, blur and exposure error the images get
    min_pitch_rad: float = -0.8  # steeper images, of landings, are left out: no depth is used
    seed: int = 11


@dataclass(frozen=True, kw_only=True, eq=False)
class DepthViews:
    """Images with exact depth and ids, and exact ground plane, at the network's output size."""

    rgb: Image  # (N, 256, 320, 3)
    depth_m: NDArray[np.float32]  # (N, 128, 160)
    ids: Image  # (N, 128, 160)
    ground_m: NDArray[np.float32]  # (N, 128, 160)


def depth_views(plan: DepthViewPlan) -> DepthViews:
    """Render the images of a plan; the same plan gives the same images.

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
    images, depths, ids, grounds = [], [], [], []
    for name in plan.scenes:
        scene = load_scene(name)
        seed = (plan.seed << 32) + zlib.crc32(scene.name.encode())
        poses = [
            pose
            for pose in sample_flight_poses(scene, np.random.default_rng(seed), 2 * plan.views)
            if pose.pitch_rad >= plan.min_pitch_rad
        ][: plan.views]
        for view in render_views(
            scene,
            poses,
            truth_size_px=LABEL_SIZE_PX,
            profile=Profile.named(plan.profile),
            seed=seed,
        ):
            images.append(shrink(view.image))
            depths.append(view.depth)
            ids.append(view.ids)
            level = CameraView(camera=camera, pitch_rad=view.pose.pitch_rad, height_m=view.pose.z_m)
            grounds.append(ground_depth(level))
    return DepthViews(
        rgb=np.stack(images),
        depth_m=np.stack(depths),
        ids=np.stack(ids),
        ground_m=np.stack(grounds).astype(np.float32),
    )


def score_depth_on(views: DepthViews, predicted: NDArray[np.float32]) -> DepthScore:
    """Score predictions on the images they were made from.

    Args:
        views: the images, with the truth.
        predicted: (N, 128, 160) float32.
    """
    return score_depth(
        DepthSample(predicted=mine, truth_m=truth, ids=ids, ground_m=ground)
        for mine, truth, ids, ground in zip(
            predicted, views.depth_m, views.ids, views.ground_m, strict=True
        )
    )


def write_depth_sheet(
    path: Path, views: DepthViews, predicted: NDArray[np.float32], *, rows: int = 6
) -> None:
    """Draw image, true and predicted depth of some views beside each other.

    Args:
        path: the PNG file.
        views: the images, with the truth.
        predicted: (N, 128, 160), the depth predicted for them.
        rows: how many of them are drawn.

    Raises:
        FileError: the file cannot be written.
    """
    places = np.linspace(0, len(views.rgb) - 1, rows).astype(int)
    strips = [depth_strip(views.rgb[at], views.depth_m[at], predicted[at]) for at in places]
    if not cv2.imwrite(str(path), np.vstack(strips)[..., ::-1]):
        raise FileError(path, "the image cannot be written")


def depth_strip(rgb: Image, truth_m: NDArray[np.float32], predicted: NDArray[np.float32]) -> Image:
    """Return image, true depth and median-scaled depth side by side, (128, 480, 3) RGB."""
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
        views: images with the truth to validate on; None where it is unknown.
        validate_every: steps.
        advance: called after every step, with the loss in the stage's name.
        diary: keeps the terms of the loss, the scores and example images of each validation.

    Returns:
        The score at the end, None without views.
    """
    from perception.depth.training import network, run  # noqa: PLC0415  (torch: training only)

    settings = run.DepthTrainingConfig() if config is None else config
    shape = network.DepthNetConfig() if net_config is None else net_config

    def predictions(net: Any, images: Image) -> NDArray[np.float32]:
        parts = [
            run.predict_depth(net, images[first : first + 8]) for first in range(0, len(images), 8)
        ]
        return np.concatenate(parts)

    def validate(now: Any, net: Any) -> None:
        advance(f"training, loss {now.loss:.3f}", now.step, now.steps)
        due = now.step % validate_every == 0 or now.step == now.steps
        if due and views is not None and diary is not None:
            predicted = predictions(net, views.rgb)
            score = asdict(score_depth_on(views, predicted))
            diary.note(now.step, {"loss": now.loss, "terms": dict(now.terms), **score})
            write_depth_sheet(diary.folder / f"step-{now.step:06d}.png", views, predicted)

    clips = ClipSource(flights, settings.clips)
    net = run.train_depth(
        clips, settings, shape, start=start, checkpoint=checkpoint, progress=validate
    )
    final = score_depth_on(views, predictions(net, views.rgb)) if views is not None else None
    notes = {
        "training": asdict(settings),
        "start": start.name if start is not None else None,
        "frames": clips.frame_count,
        "validation": asdict(final) if final is not None else None,
    }
    network.DEPTH_FILES.save(weights, net, notes=notes)
    network.DEPTH_FILES.export(weights, weights.with_suffix(".onnx"))
    return final
