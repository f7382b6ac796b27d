"""A lab that was learned from black images, for tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from perception.networks.weights_file import SHIPPED_WEIGHTS
from perception.segmentation.adaptation.head import GroundHead
from perception.segmentation.adaptation.learned_lab import (
    LearnedPlace,
    network_hash,
    write_learned_lab,
)
from perception.segmentation.adaptation.place_statement import (
    PlaceStatement,
    feature_statistics,
)
from perception.segmentation.adaptation.role_network import OnnxRoleNetwork
from uav_bt.lab.lab import Lab
from uav_bt.types import CameraModel

STATEMENT = PlaceStatement(
    base="0",
    width_px=448,
    height_px=224,
    focal_px=(326.0, 289.7),
    height_m=1.5,
    frames=3,
    known_share=0.8,
    agreement=0.9,
    feature_means=((0.0,) * 24,),
    feature_spread=(1.0,) * 24,
)
"""A statement of a place that no flight has learned."""


def write_black_lab(folder: Path, camera: CameraModel) -> Lab:
    """Write a lab whose network was learned from black images, 1.5 m above the ground.

    Args:
        folder: the new folder.
        camera: with which the place was learned.
    """
    network = OnnxRoleNetwork(SHIPPED_WEIGHTS / "any.onnx")
    means, _ = feature_statistics([network.infer(np.zeros((112, 224, 3), np.uint8))])
    lens = camera.resized(448, 224)
    statement = PlaceStatement(
        base=network_hash(network.path),
        width_px=448,
        height_px=224,
        focal_px=(lens.fx_px, lens.fy_px),
        height_m=1.5,
        frames=3,
        known_share=0.8,
        agreement=0.9,
        feature_means=tuple(map(tuple, means.tolist())),
        feature_spread=(1.0,) * means.shape[1],
    )
    place = LearnedPlace(head=GroundHead.unchanged(means.shape[1]), statement=statement, labels=())
    return write_learned_lab(folder, place, network)
