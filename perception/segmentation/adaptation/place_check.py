"""Whether a flight takes place where its adapted network was learned."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final

import numpy as np

from perception.networks.onnx_runtime import read_model
from perception.segmentation.adaptation.place_statement import STATEMENT_FILE, PlaceStatement
from perception.segmentation.adaptation.role_network import (
    ADAPTED_FROM,
    FEATURES,
    RoleNetwork,
    RoleView,
)
from uav_bt.errors import FileError
from uav_bt.types import Frame

_VIEWS: Final = 12  # that the decision needs; chosen
_STEADY_M: Final = 0.12  # difference in height of two frames at flight height; chosen
_LOW_M: Final = 0.5  # below this height the drone takes off or lands; chosen
_APART_RAD: Final = math.radians(20.0)  # turn between two views; chosen
_APART_S: Final = (0.5, 2.0)  # least time between two views, and time without a turn; chosen


def statement_of(path: Path) -> PlaceStatement | None:
    """Return the statement of an adapted network; None for a network that was not adapted.

    Args:
        path: the ONNX file; the statement lies beside it.

    Raises:
        WeightsError: the network cannot be read.
        FileError: the statement is absent, malformed, or that of another network.
    """
    model = read_model(path, "`uav-bt lab train`")
    key = ["framework", ADAPTED_FROM]  # where OpenVINO keeps an ONNX file's metadata
    if not model.has_rt_info(key):
        return None
    statement = PlaceStatement.read(path.parent)
    channels = next(
        port.get_partial_shape()[1].get_length()
        for port in model.outputs
        if FEATURES in port.get_names()
    )
    base = model.get_rt_info(key).astype(str)
    if statement.base != base or len(statement.feature_spread) != channels:
        raise FileError(
            path.parent / STATEMENT_FILE,
            f"expected the statement of {path.name}, which was adapted from {base:.12} and has "
            f"{channels} features, got one from {statement.base:.12} with "
            f"{len(statement.feature_spread)}: copy both files of one learned lab",
        )
    return statement


class PlaceCheck:
    """Compares the first views at flight height with the statement of an adapted network.

    Args:
        statement: the statement.
        network: the adapted network.
    """

    def __init__(self, statement: PlaceStatement, network: RoleNetwork) -> None:
        self._statement, self._network = statement, network
        self._views: list[RoleView] = []
        self._heights_m: list[float] = []
        self._before: Frame | None = None
        self._kept: Frame | None = None

    @property
    def is_complete(self) -> bool:
        """Whether there are enough views to decide."""
        return len(self._views) >= _VIEWS

    def add(self, frame: Frame) -> None:
        """Take in a frame, if it is at flight height and apart from the ones before.

        Args:
            frame: newer than the ones before.
        """
        before, kept = self._before, self._kept
        if before is not None and frame.captured_s - before.captured_s < _APART_S[0]:
            return
        self._before = frame
        height_m = frame.height_above_ground_m
        if before is None or not height_m > _LOW_M:
            return
        if not abs(height_m - before.height_above_ground_m) < _STEADY_M:
            return
        if kept is not None:
            turn = math.remainder(frame.attitude.yaw_rad - kept.attitude.yaw_rad, math.tau)
            if abs(turn) < _APART_RAD and frame.captured_s - kept.captured_s < _APART_S[1]:
                return
        self._kept = frame
        self._views.append(self._network.infer(frame.image))
        self._heights_m.append(height_m)

    def foreign(self) -> str | None:
        """Return why the network does not fit the flight; None if it does."""
        return self._statement.foreign(float(np.median(self._heights_m)), self._views)
