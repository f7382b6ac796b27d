"""A drone with a calibrated camera: frames are undistorted, intrinsics come from a file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from perception.camera.camera_file import Undistorter, load_camera
from uav_bt.errors import DroneError
from uav_bt.mission.drone_wrapper import DroneWrapper
from uav_bt.protocols import Drone
from uav_bt.types import CameraModel, Frame, Observation


class CalibratedDrone(DroneWrapper):
    """Flies another drone, with a camera file in place of the intrinsics that it reports."""

    def __init__(self, drone: Drone, camera_file: Path) -> None:
        """Keep both. The file is read when the size of the frames is known.

        Args:
            drone: Drone that flies; not connected yet.
            camera_file: made by `uav-bt lab calibrate`, at any size of the frames' aspect.
        """
        super().__init__(drone)
        self._file = camera_file
        self._undistorter: Undistorter | None = None
        self._last: tuple[Frame, Frame] | None = None  # as sent, and undistorted

    @property
    def camera(self) -> CameraModel:
        """The calibrated intrinsics at the frames' size, of undistorted frames.

        Raises:
            DroneError: the drone is not connected.
        """
        return self._ready().camera

    def connect(self) -> None:
        """Connect the drone and read the camera file.

        Raises:
            DroneError: the drone cannot be reached.
            FileError: the camera file is absent or malformed.
            ValueRangeError: the camera was calibrated at another aspect than the frames'.
        """
        self._drone.connect()
        try:
            reported = self._drone.camera
            calibrated = load_camera(
                self._file,
                size_px=(reported.width_px, reported.height_px),
                # A calibration board does not show where on the drone the lens sits.
                forward_offset_m=reported.forward_offset_m,
            )
        except Exception:
            self._drone.disconnect()
            raise
        self._undistorter = Undistorter(calibrated)

    def observe(self) -> Observation:
        """Return the newest state, and the newest frame undistorted.

        Raises:
            DroneError: the drone is not connected.
            ShapeError: the frame has another size than the drone reports.
        """
        undistorter = self._ready()
        seen = self._drone.observe()
        if seen.frame is None:
            return seen
        if self._last is None or self._last[0] is not seen.frame:
            straight = replace(seen.frame, image=undistorter.undistort(seen.frame.image))
            self._last = seen.frame, straight
        return replace(seen, frame=self._last[1])

    def _ready(self) -> Undistorter:
        if self._undistorter is None:
            raise DroneError("the calibrated drone is not connected: call connect() first")
        return self._undistorter
