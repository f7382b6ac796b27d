"""Footage files: whole, without pickle, and refused when they are anything else."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from perception.footage import file
from uav_bt.errors import FileError, ShapeError, ValueRangeError
from uav_bt.types import CameraModel

CAMERA = CameraModel(
    width_px=32, height_px=24, fx_px=25.0, fy_px=20.0, cx_px=15.5, cy_px=11.5, distortion=(0.1, 0.0)
)


def _footage(count: int = 3) -> file.Footage:
    rng = np.random.default_rng(0)
    line = np.linspace(0.0, 1.0, count)
    return file.Footage(
        frames=rng.integers(0, 255, (count, 24, 32, 3), dtype=np.uint8),
        index=np.arange(count, dtype=np.int64),
        captured_s=line,
        gimbal_pitch_rad=-line,
        attitude_rad=rng.random((count, 3)),
        altitude_m=line,
        height_m=line,
        height_above_carpet_m=line,
        state_s=np.arange(5.0),
        state_attitude_rad=rng.random((5, 3)),
        velocity_mps=rng.random((5, 3)),
        camera=CAMERA,
    )


def test_footage_comes_back_as_it_was_written(tmp_path: Path) -> None:
    written = _footage()
    file.write_footage(tmp_path / "flight.npz", written)
    read = file.read_footage(tmp_path / "flight.npz")
    assert read.camera == CAMERA
    for name in ("frames", "index", "captured_s", "attitude_rad", "velocity_mps", "state_s"):
        np.testing.assert_array_equal(getattr(read, name), getattr(written, name))
    assert [path.name for path in tmp_path.iterdir()] == ["flight.npz"]


def test_the_truth_comes_back_as_it_was_written(tmp_path: Path) -> None:
    truth = file.FootageTruth(
        index=np.array([3, 6]),
        depth_m=np.full((2, 4, 5), 1.5, np.float16),
        ids=np.full((2, 4, 5), 7, np.uint8),
    )
    file.write_truth(tmp_path / "truth.npz", truth)
    read = file.read_truth(tmp_path / "truth.npz")
    np.testing.assert_array_equal(read.depth_m, truth.depth_m)
    np.testing.assert_array_equal(read.ids, truth.ids)


def test_the_truth_is_not_taken_for_footage(tmp_path: Path) -> None:
    truth = file.FootageTruth(
        index=np.array([3]),
        depth_m=np.ones((1, 4, 5), np.float16),
        ids=np.ones((1, 4, 5), np.uint8),
    )
    file.write_truth(tmp_path / "truth.npz", truth)
    with pytest.raises(FileError, match="expected a file of kind 'uav-bt-footage-1'"):
        file.read_footage(tmp_path / "truth.npz")


def test_an_absent_file_says_what_makes_one(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"uav-bt fly .* --footage FILE"):
        file.read_footage(tmp_path / "none.npz")


def test_a_truncated_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "flight.npz"
    file.write_footage(path, _footage())
    path.write_bytes(path.read_bytes()[:-400])
    with pytest.raises(FileError, match="damaged or no npz file"):
        file.read_footage(path)


def test_a_text_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "flight.npz"
    path.write_text("no film")
    with pytest.raises(FileError, match="damaged or no npz file"):
        file.read_footage(path)


def test_objects_in_a_file_are_never_unpickled(tmp_path: Path) -> None:
    path = tmp_path / "flight.npz"
    np.savez(path, kind=np.array([{"a": 1}], dtype=object))
    with pytest.raises(FileError, match="damaged or no npz file"):
        file.read_footage(path)


def test_a_file_that_lacks_an_array_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "flight.npz"
    file.write_footage(path, _footage())
    with np.load(path, allow_pickle=False) as whole:
        kept = {name: whole[name] for name in whole.files if name != "velocity_mps"}
    np.savez(path, **kept)
    with pytest.raises(FileError, match=r"no whole footage file.*velocity_mps"):
        file.read_footage(path)


def test_arrays_of_another_length_are_refused() -> None:
    with pytest.raises(ShapeError, match="footage velocity_mps must be 5x3, got 4x3"):
        replace(_footage(), velocity_mps=np.zeros((4, 3)))


def test_frames_of_another_size_than_the_cameras_are_refused() -> None:
    with pytest.raises(ShapeError, match="footage frames must be 3x24x32x3, got 3x24x30x3"):
        replace(_footage(), frames=np.zeros((3, 24, 30, 3), np.uint8))


def test_times_that_do_not_rise_are_refused() -> None:
    with pytest.raises(ValueRangeError, match="captured_s must rise"):
        replace(_footage(), captured_s=np.array([0.0, 0.2, 0.2]))


def test_numbers_that_are_none_are_refused() -> None:
    with pytest.raises(ValueRangeError, match="altitude_m holds NaN"):
        replace(_footage(), altitude_m=np.array([0.0, np.nan, 1.0]))


def test_a_picture_is_resized_and_never_cropped() -> None:
    picture = np.zeros((360, 640, 3), np.uint8)
    picture[:, 320:] = 200
    small = file.shrink(picture)
    assert small.shape == (256, 320, 3)
    assert (small[:, :160] == 0).all()
    assert (small[:, 160:] == 200).all()


def test_nothing_is_left_where_the_file_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="cannot be written"):
        file.write_footage(tmp_path / "no" / "flight.npz", _footage())
