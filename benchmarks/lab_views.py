"""Write a copy of a lab with drawn images and simulated picks, for `uav-bt lab train`.

    python -m benchmarks.lab_views paper --views 1200 --out labs/paper_drawn
    uav-bt lab train labs/paper_drawn --steps 9500 --batch 24

The twin draws the images; points of its exact class ids stand for a person's picks. Images of the
training scenes are for training, those of the validation scenes for checks. `--out` must not exist.
"""

from __future__ import annotations

import argparse
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from benchmarks.segmentation import scenes_of
from perception.segmentation.teacher import TeacherConfig
from perception.segmentation.training.picks import Pick, draw_picks, write_picks
from sim_bridge.twin.views import View
from uav_bt.errors import FileError
from uav_bt.files import writing
from uav_bt.lab.lab import NETWORK_FILE, SCENES_FOLDER, Lab
from uav_bt.lab.shipped import DEFAULT_LAB, load_lab
from uav_bt.learning.lab_material import LabFrame, LabMaterial, Use
from uav_bt.learning.views import ViewPlan, twin_views
from uav_bt.types import Frame

PICKS: Final = 6500  # on the images for training; the paper's were 6,484
CHECK_VIEWS: Final = 30  # images of a scene for checks


def frame_of(view: View, index: int = 0) -> Frame:
    """Return a rendered view as a frame of the drone; one follows another after 0.1 s."""
    return Frame(
        image=view.image,
        index=index,
        captured_s=0.1 * index,
        gimbal_pitch_rad=view.pose.pitch_rad,
        height_above_ground_m=view.pose.z_m,
    )


def draw_twin_picks(plan: ViewPlan, config: TeacherConfig, total: int) -> list[Pick]:
    """Sample points of the exact ids, evenly over the scenes, in pixels of the teacher's size."""
    picks: list[Pick] = []
    size, share = (config.width_px, config.height_px), total // len(plan.scenes)
    for number, scene in enumerate(plan.scenes, start=1):
        views = twin_views(replace(plan, scenes=(scene,), size_px=size, truth_size_px=size))
        samples = ((name, ids) for name, _, ids in views)
        rng = np.random.default_rng((plan.seed, number))
        picks += draw_picks(samples, rng, patch_px=config.patch_px, total=share)
    return picks


def copy_lab(lab: Lab, folder: Path) -> LabMaterial:
    """Copy a lab without its training files into a new folder."""
    if folder.exists():
        raise FileError(folder, "exists: give --out a new folder")
    training = shutil.ignore_patterns("frames", "training", "picks.csv", NETWORK_FILE)
    with writing(folder):
        shutil.copytree(lab.folder, folder, ignore=training)
        for scene in (folder / SCENES_FOLDER).glob("*.yaml"):
            lines = scene.read_text(encoding="utf-8").splitlines(keepends=True)
            # Without this key a scene belongs to the lab in whose folder it lies.
            scene.write_text("".join(line for line in lines if not line.startswith("lab:")))
    return LabMaterial(lab=load_lab(folder / lab.file.name))


def write_views(
    material: LabMaterial, plans: dict[Use, ViewPlan], config: TeacherConfig, total: int = PICKS
) -> None:
    """Draw the images of a lab and picks on them; those for checks get a fifth of the picks."""
    material.frames.mkdir()
    frames, picks = [], []
    size = (config.width_px, config.height_px)
    for use, plan in plans.items():
        for name, rgb, _ in twin_views(replace(plan, size_px=size, truth_size_px=(32, 18))):
            image = f"{Path(name).stem}.jpg"
            quality = [cv2.IMWRITE_JPEG_QUALITY, 95]
            cv2.imwrite(str(material.frames / image), rgb[..., ::-1], quality)
            frames.append(LabFrame(image=image, source="twin", time_s=0.0, sharpness=0.0, use=use))
        drawn = draw_twin_picks(plan, config, total if use == "train" else total // 5)
        picks += [replace(pick, image=f"{Path(pick.image).stem}.jpg") for pick in drawn]
    material.write_frames(frames)
    write_picks(material.picks, picks, material.lab.classes)


def main() -> None:
    """Write the lab."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("lab", nargs="?", default=DEFAULT_LAB)
    parser.add_argument("--views", type=int, default=1200, help="images of a scene for training")
    parser.add_argument("--out", type=Path, required=True, help="folder of the copy")
    given = parser.parse_args()
    lab = load_lab(given.lab)
    scenes = scenes_of(lab, "*train-*")
    plan = ViewPlan(scenes=scenes, views=given.views, lowered=0.25, seed=1)
    check = replace(plan, scenes=scenes_of(lab, "*val-*"), views=CHECK_VIEWS)
    material = copy_lab(lab, given.out)
    write_views(material, {"train": plan, "check": check}, TeacherConfig())
    print(f"{material.lab.folder}: next uav-bt lab train {material.lab.folder}")


if __name__ == "__main__":
    main()
