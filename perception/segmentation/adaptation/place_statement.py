"""What an adapted network was made for: a place, a camera, a height; checked before it is trusted.

The file `learned.yaml` lies beside the network. Mean and spread of the features show whether later
frames look as those that the network was adapted to.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
import yaml
from pydantic import Field

from perception.segmentation.adaptation.role_network import RoleView
from uav_bt.files import write_whole
from uav_bt.types import CameraModel
from uav_bt.types.arrays import Floats
from uav_bt.yaml_file import read_yaml

STATEMENT_FILE: Final = "learned.yaml"
"""Name of the statement in the folder of a learned lab."""

# Shift of the features, standard deviations; chosen on rooms of the validation set. It is up to
# 0.30 in later turns in the own room, and above 0.33 in 16 of 30 turns in other rooms.
_MOST_FAR: Final = 0.33
_LENS: Final = 0.03  # relative difference of the focal lengths; chosen
_HIGHER_M: Final = 0.6  # difference in height; chosen

_Finite = Annotated[float, Field(allow_inf_nan=False)]
_Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
_Spread = Annotated[float, Field(ge=0, allow_inf_nan=False)]
_Share = Annotated[float, Field(ge=0, le=1)]


@dataclass(frozen=True, kw_only=True)
class PlaceStatement:
    """Place and camera that a network was adapted to.

    Attributes:
        version: Of the file's form.
        made: Date and time, ISO 8601; empty for a simulated flight.
        base: Hash of the network that was adapted.
        width_px: Of the camera's images.
        height_px: The same.
        focal_px: Focal lengths along columns and rows.
        height_m: Mean height of the lens above the ground.
        frames: Number of labelled frames.
        known_share: Share of their pixels with a label.
        agreement: Share of the labelled pixels to which the network gives the label.
        feature_means: Of each labelled frame, the mean of each channel.
        feature_spread: Standard deviation of each channel within a frame.
    """

    version: Annotated[int, Field(ge=1, le=1)] = 1
    made: str = ""
    base: str
    width_px: Annotated[int, Field(ge=16, le=16384)]
    height_px: Annotated[int, Field(ge=16, le=16384)]
    focal_px: tuple[_Positive, _Positive]
    height_m: Annotated[float, Field(gt=0, le=100)]
    frames: Annotated[int, Field(ge=1)]
    known_share: _Share
    agreement: _Share
    feature_means: Annotated[tuple[tuple[_Finite, ...], ...], Field(min_length=1)]
    feature_spread: tuple[_Spread, ...]

    def write(self, folder: Path) -> None:
        """Write the statement into the folder of a lab."""
        plain = {name: _listed(value) for name, value in asdict(self).items()}
        text = yaml.safe_dump(plain, sort_keys=False, default_flow_style=None, width=100)
        write_whole(folder / STATEMENT_FILE, text)

    @staticmethod
    def read(folder: Path) -> PlaceStatement:
        """Read the statement of a lab's folder.

        Raises:
            FileError: it is absent or malformed.
        """
        remedy = "it is written when a place is learned; learn the place again"
        file = read_yaml(folder / STATEMENT_FILE, PlaceStatement, "statement", remedy=remedy)
        channels = len(file.value.feature_spread)
        for at, each in enumerate(file.value.feature_means):
            if len(each) != channels:
                raise file.error(
                    f"expected {channels} numbers as in feature_spread, got {len(each)}",
                    "feature_means",
                    at,
                )
        return file.value

    def foreign_camera(self, camera: CameraModel) -> str | None:
        """Return why the network does not fit a camera; None if it does.

        Args:
            camera: of the flight, at any size. Another aspect changes one of the two angles.
        """
        lens = camera.resized(self.width_px, self.height_px)
        now_px, then_px = (lens.fx_px, lens.fy_px), self.focal_px
        pairs = zip(now_px, then_px, strict=True)
        if all(abs(now / then - 1.0) <= _LENS for now, then in pairs):
            return None
        now, then = self._angles(now_px), self._angles(then_px)
        return f"it was learned with a camera that sees {then} degrees, and this one sees {now}"

    def _angles(self, focal_px: tuple[float, float]) -> str:
        """Return the angles of view along columns and rows, in words."""
        sides = zip((self.width_px, self.height_px), focal_px, strict=True)
        return " x ".join(
            f"{math.degrees(2.0 * math.atan(side / (2.0 * focal))):.0f}" for side, focal in sides
        )

    def foreign(self, height_m: float, views: Sequence[RoleView]) -> str | None:
        """Return why the network does not fit a flight; None if it does.

        Args:
            height_m: of the lens above the ground.
            views: outputs of the network for some frames, best all around.
        """
        if not abs(height_m - self.height_m) <= _HIGHER_M:
            return f"it was learned {self.height_m:.1f} m above the ground, not {height_m:.1f} m"
        far = self.distance(views)
        if not far <= _MOST_FAR:
            return f"the images differ from those of the learned place ({far:.2f} > {_MOST_FAR:g})"
        return None

    def distance(self, views: Sequence[RoleView]) -> float:
        """Return how far the features' means are from those of the most similar learned frame.

        It is the median over the views of the root mean square in standard deviations.
        """
        if not views:
            return math.nan
        means, _ = feature_statistics(views)
        if means.shape[1] != len(self.feature_spread):
            return math.inf
        learned = np.array(self.feature_means)
        shift = (means[:, None] - learned[None]) / np.maximum(self.feature_spread, 1e-6)
        return float(np.median(np.sqrt(np.mean(shift**2, axis=2)).min(axis=1)))


def feature_statistics(views: Sequence[RoleView]) -> tuple[Floats, Floats]:
    """Return the features' means by view, (N, C), and standard deviation within a view, (C,)."""
    flat = np.stack([view.features.reshape(len(view.features), -1) for view in views])
    flat = flat.astype(np.float64)
    return flat.mean(axis=2), np.sqrt(flat.var(axis=2).mean(axis=0))


def _listed(value: Any) -> Any:
    """Return a value with lists in place of tuples, which YAML does not have."""
    return [_listed(each) for each in value] if isinstance(value, tuple) else value
