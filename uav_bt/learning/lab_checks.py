"""Checks of a lab's training files, before hours of work on them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from perception.camera.image_files import read_image
from perception.networks.mapping import class_id_of, read_mapping
from perception.segmentation.training.pick_images import check_picks, placed_picks
from perception.segmentation.training.picks import Pick
from uav_bt.errors import FileError, InputError
from uav_bt.lab.classes import GROUND
from uav_bt.lab.lab_file import lab_error
from uav_bt.learning.lab_material import LabMaterial, Use
from uav_bt.learning.masks import MaskSource

_LEAST_IMAGES: Final = 4
_FEW_IMAGES: Final = 100  # with fewer the network knows few views; chosen


@dataclass(frozen=True, kw_only=True)
class LabData:
    """Checked training files of a lab."""

    material: LabMaterial  # where they are
    uses: Mapping[str, Use]  # use of every image, by file name
    picks: Sequence[Pick]  # picks on all images; may be empty if another network makes the masks
    # network of the lab file that makes the masks; None: a teacher learns from picks
    source: MaskSource | None
    warnings: Sequence[str]  # allowed things that may be mistakes

    def images(self, use: Use) -> list[Path]:
        """Return the images of a use, in the order of names."""
        return [self.material.frames / name for name, its in self.uses.items() if its == use]

    def picks_on(self, use: Use) -> list[Pick]:
        """Return the picks on the images of a use."""
        return [pick for pick in self.picks if self.uses[pick.image] == use]


def checked_data(material: LabMaterial) -> LabData:
    """Check everything that training needs."""
    uses, unreadable = material.uses(), []
    for name in list(uses):
        try:
            read_image(material.frames / name, colour=True, as_stored=False)
        except FileError as error:
            unreadable.append(f"{error}; it is left out")
            del uses[name]
    source = teacher_of_lab(material)
    count = sum(use == "train" for use in uses.values())
    if count < _LEAST_IMAGES:
        raise InputError(
            f"{material.frames}: expected at least {_LEAST_IMAGES} images for training, got "
            f"{count}; `uav-bt lab frames` takes them from videos"
        )
    warnings = unreadable
    if count < _FEW_IMAGES:
        warnings.append(f"only {count} images for training")
    needed = source is None or material.picks.exists()
    picks = picks_of_lab(material, uses) if needed else []
    if source is None:
        warnings += check_picks(material.picks, material.frames, material.lab.classes, uses)
    return LabData(material=material, uses=uses, picks=picks, source=source, warnings=warnings)


def picks_of_lab(material: LabMaterial, uses: Mapping[str, Use]) -> list[Pick]:
    """Return the picks of a lab, each of which lies inside its image."""
    if not material.picks.exists():
        raise FileError(material.picks, "there are no picks; `uav-bt lab pick` makes them")
    return placed_picks(material.picks, material.frames, material.lab.classes, uses)


def teacher_of_lab(material: LabMaterial) -> MaskSource | None:
    """Return the network that the lab file names for masks; None without one."""
    lab = material.lab
    if lab.teacher is None:
        return None
    model, mapping = lab.teacher["model"], lab.teacher.get("classes")
    source = MaskSource(file=model, classes=lab.classes, mapping=mapping)
    try:
        source.load()
    except InputError as error:
        raise lab_error(lab.file, str(error), "teacher", "model") from error
    if mapping is not None:
        meant = read_mapping(mapping, lab.classes)
        ids = {class_id_of(name, lab.classes) for name in (*meant.classes.values(), meant.default)}
        if not ids.intersection(lab.classes.of_role(GROUND)):
            raise lab_error(
                lab.file, f"{mapping} maps no class to the ground", "teacher", "classes"
            )
    return source
