"""Recording footage: what is kept of a flight, and that it is written whatever happens."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from perception.footage.file import read_footage, read_truth
from uav_bt.app.footage import FootageConfig, FootageListeners, FootageRecorder, flight_footage
from uav_bt.cli.root import uav_bt
from uav_bt.errors import InputError, ValueRangeError
from uav_bt.mission.runner import TickRecord
from uav_bt.testing import ScriptedDrone
from uav_bt.tree import Status
from uav_bt.types import (
    HOVER,
    Attitude,
    BodyVelocity,
    CameraModel,
    DroneState,
    FlyingState,
    Frame,
    Observation,
)

CAMERA = CameraModel(width_px=64, height_px=36, fx_px=46.0, fy_px=46.0, cx_px=31.5, cy_px=17.5)
SMALL = FootageConfig(size_px=(32, 24))


def _frame(index: int, captured_s: float) -> Frame:
    return Frame(
        image=np.full((36, 64, 3), index, np.uint8),
        index=index,
        captured_s=captured_s,
        gimbal_pitch_rad=-0.5,
        attitude=Attitude(yaw_rad=0.1 * index),
        height_above_carpet_m=1.5,
    )


def _record(time_s: float, frame: Frame | None) -> TickRecord:
    state = DroneState(
        captured_s=time_s,
        flying=FlyingState.FLYING,
        velocity=BodyVelocity(forward_mps=0.4, right_mps=-0.1, down_mps=0.05),
    )
    return TickRecord(
        index=round(10 * time_s),
        time_s=time_s,
        observation=Observation(frame=frame, state=state),
        tree_status=Status.RUNNING,
        phase="explore",
        active=(),
        command=HOVER,
        proposed_by=None,
        override=None,
        compute_s=0.0,
        truth=None,
    )


def test_frames_and_telemetry_are_kept_with_their_own_times() -> None:
    recorder = FootageRecorder(CAMERA, SMALL)
    for tick in range(5):
        recorder.on_tick(_record(0.1 * tick, _frame(3 * tick, 0.1 * tick - 0.15)))
    kept = recorder.footage()
    assert kept.frames.shape == (5, 24, 32, 3)
    assert kept.index.tolist() == [0, 3, 6, 9, 12]
    np.testing.assert_allclose(kept.captured_s, [-0.15, -0.05, 0.05, 0.15, 0.25])
    np.testing.assert_allclose(kept.state_s, [0.0, 0.1, 0.2, 0.3, 0.4])
    np.testing.assert_allclose(kept.velocity_mps, [[0.4, -0.1, 0.05]] * 5)
    np.testing.assert_allclose(kept.attitude_rad[2], [0.0, 0.0, 0.6])
    assert kept.camera == CAMERA.resized(32, 24)
    assert recorder.truth() is None


def test_a_repeated_frame_is_kept_once() -> None:
    recorder = FootageRecorder(CAMERA, SMALL)
    for tick in range(4):
        recorder.on_tick(_record(0.1 * tick, _frame(7, 0.3)))
    assert len(recorder.footage()) == 1


def test_frames_that_come_faster_than_asked_for_are_left_out() -> None:
    recorder = FootageRecorder(CAMERA, replace(SMALL, interval_s=0.2))
    for tick in range(9):
        recorder.on_tick(_record(0.1 * tick, _frame(tick, 0.1 * tick)))
    assert recorder.footage().index.tolist() == [0, 2, 4, 6, 8]


def test_an_endless_flight_does_not_fill_the_memory() -> None:
    recorder = FootageRecorder(CAMERA, replace(SMALL, longest_s=0.35))
    for tick in range(20):
        recorder.on_tick(_record(0.1 * tick, _frame(tick, 0.1 * tick)))
    assert len(recorder.footage()) == 4


def test_a_flight_without_a_frame_leaves_none() -> None:
    recorder = FootageRecorder(CAMERA, SMALL)
    recorder.on_tick(_record(0.0, None))
    with pytest.raises(ValueRangeError, match="no frame came"):
        recorder.footage()


def test_a_twin_flight_leaves_footage_and_its_truth(tmp_path: Path) -> None:
    tree = tmp_path / "hop.xml"
    tree.write_text(
        '<root BTCPP_format="4"><BehaviorTree ID="Main"><Sequence>'
        '<TakeOff height_m="1.0"/><Land/></Sequence></BehaviorTree></root>'
    )
    path, truth = tmp_path / "hop.npz", tmp_path / "hop.truth.npz"
    result = CliRunner().invoke(
        uav_bt,
        [
            *("fly", str(tree), "--scene", "train-a", "--image-size", "320x180"),
            *("--footage", str(path), "--truth", str(truth)),
        ],
    )
    assert f"footage: {path}" in result.output
    footage, known = read_footage(path), read_truth(truth)
    assert footage.frames.shape[1:] == (256, 320, 3)
    assert len(footage) > 20
    assert footage.height_above_carpet_m.max() > 0.9
    np.testing.assert_array_equal(known.index, footage.index)
    assert known.depth_m.shape == footage.frames.shape[:3]
    assert 0.0 < float(known.depth_m.min()) < 1.0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--truth", "t.npz"], "--truth needs --footage"),
        (["--footage", "a.npz", "--truth", "a.npz"], "name the same file"),
        (["--footage", "nowhere/a.npz"], "create it first"),
    ],
)
def test_the_command_refuses_files_that_cannot_be(arguments: list[str], words: str) -> None:
    result = CliRunner().invoke(uav_bt, ["fly", "land_only", *arguments])
    assert result.exit_code == 2
    assert words in result.stderr


def test_footage_is_written_when_the_flight_fails(tmp_path: Path) -> None:
    path = tmp_path / "flight.npz"

    def fly() -> None:
        with flight_footage(path, config=SMALL) as listeners:
            listeners.recorder = FootageRecorder(CAMERA, SMALL)
            listeners.recorder.on_tick(_record(0.0, _frame(1, 0.0)))
            raise RuntimeError("the battery fell out")

    with pytest.raises(RuntimeError, match="fell out"):
        fly()
    assert len(read_footage(path)) == 1


def test_a_flight_that_fails_before_its_first_frame_tells_why(tmp_path: Path) -> None:
    def fly() -> None:
        with flight_footage(tmp_path / "flight.npz", config=SMALL) as listeners:
            listeners.recorder = FootageRecorder(CAMERA, SMALL)
            raise RuntimeError("the battery fell out")

    with pytest.raises(RuntimeError, match="fell out"):
        fly()


def test_a_flight_that_never_began_leaves_its_own_error(tmp_path: Path) -> None:
    path = tmp_path / "flight.npz"

    def fly() -> None:
        with flight_footage(path):
            raise InputError("no such scene")

    with pytest.raises(InputError, match="no such scene"):
        fly()
    assert not path.exists()


def test_the_truth_of_a_real_drone_is_refused() -> None:
    listeners = FootageListeners(SMALL, with_truth=True)
    with pytest.raises(InputError, match="needs a simulated drone"):
        listeners(ScriptedDrone(), None)  # type: ignore[arg-type]  # the context is not looked at


def test_an_interval_beyond_the_longest_flight_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="interval_s < longest_s"):
        FootageConfig(interval_s=500.0)
