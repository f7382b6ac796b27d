"""Training data from records, and whole training of the control student."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from perception.control.ego_state import ControlNetConfig
from perception.control.runtime import OnnxControlStudent
from perception.control.training import samples
from perception.depth.training.footage import shrink
from perception.networks.weights_file import SHIPPED_WEIGHTS
from sim_bridge.anafi import anafi_camera
from tests.worlds.cli import assert_refused, run
from tests.worlds.footage import SeesGround, frame, state, write_record
from tests.worlds.trees import tree_file
from uav_bt import app
from uav_bt.errors import FileError
from uav_bt.learning.dataset import evaluate_student, footage_of, read_advised_flights, records_of
from uav_bt.learning.lab_material import fingerprint
from uav_bt.testing import ScriptedDrone
from uav_bt.types import Frame

CAMERA = anafi_camera(64, 36)


def frames(times_s: list[float], *, indices: list[int] | None = None) -> list[Frame]:
    rng = np.random.default_rng(0)
    places = range(len(times_s)) if indices is None else indices
    return [
        frame(rng.integers(0, 256, (36, 64, 3), np.uint8), index, time_s, yaw_rad=0.1 * index)
        for index, time_s in zip(places, times_s, strict=True)
    ]


def test_frames_and_telemetry_are_kept_with_their_own_times(tmp_path: Path) -> None:
    flown = frames([0.05, 0.15, 0.25])
    states = [state(0.1 * tick, 0.4) for tick in range(4)]
    found = footage_of(write_record(tmp_path / "a.mcap", CAMERA, flown, states))
    assert [frame.index for frame in found.frames] == [0, 1, 2]
    assert [frame.captured_s for frame in found.frames] == pytest.approx([0.05, 0.15, 0.25])
    assert found.frames[2].attitude == flown[2].attitude
    np.testing.assert_array_equal(found.frames[1].image, shrink(flown[1].image))
    assert list(found.states) == states
    assert found.camera == CAMERA.resized(320, 256)


def test_early_and_repeated_frames_and_repeated_states_are_left_out(tmp_path: Path) -> None:
    flown = frames([0.05 * at for at in range(9)])
    found = footage_of(write_record(tmp_path / "a.mcap", CAMERA, flown, [state(0.0)]))
    assert [frame.index for frame in found.frames] == [0, 2, 4, 6, 8]
    flown = frames([0.1, 0.3, 0.5], indices=[7, 7, 8])
    states = [state(0.1), state(0.1), state(0.2)]
    found = footage_of(write_record(tmp_path / "b.mcap", CAMERA, flown, states))
    assert [frame.index for frame in found.frames] == [7, 8]
    assert [state.captured_s for state in found.states] == [0.1, 0.2]


def test_what_is_no_whole_flight_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"absent\.mcap"):
        footage_of(tmp_path / "absent.mcap")
    with pytest.raises(FileError, match="no frame with an image"):
        footage_of(write_record(tmp_path / "blind.mcap", CAMERA, [], [state(0.0)]))
    path = write_record(tmp_path / "cut.mcap", CAMERA, frames([0.0]), [], finished=False)
    with pytest.raises(FileError, match="never finished; `mcap recover`"):
        footage_of(path)
    path = write_record(tmp_path / "a.mcap", CAMERA, frames([0.0, 0.1]), [state(0.0)])
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(content)
    with pytest.raises(FileError, match=r"a\.mcap.*damaged"):
        footage_of(path)


def test_a_folder_stands_for_all_records_below_it(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    record = write_record(tmp_path / "a" / "flight.mcap", CAMERA, [], [])
    assert records_of([tmp_path, record]) == [record]
    (tmp_path / "b").mkdir()
    with pytest.raises(FileError, match="no flight record in this folder"):
        records_of([tmp_path / "b"])


def test_a_copy_has_the_same_fingerprint(tmp_path: Path) -> None:
    path = write_record(tmp_path / "a.mcap", CAMERA, [], [state(0.0)])
    assert fingerprint(Path(shutil.copy(path, tmp_path / "b.mcap"))) == fingerprint(path)
    other = write_record(tmp_path / "c.mcap", CAMERA, [], [state(1.0)])
    assert fingerprint(other) != fingerprint(path)


# --- the control student: from records to weights -------------------------------------------------

NET = ControlNetConfig(
    width_px=32, height_px=16, channels=(4, 8), bottleneck=4, embedding=8, hidden=8
)

# In a class map of noise the path is blocked, so the rule of the first level gives advice.
MISSION = """
<ReactiveSequence>
  <Segment/>
  <RememberViews/>
  {adviser}
  <Sequence>
    <TakeOff height_m="1.5" gimbal_deg="-30"/>
    <HoverFor seconds="2"/>
    <Land/>
  </Sequence>
</ReactiveSequence>
"""
ADVISER = '<Advise policy="segmentation"/>'


def flown(folder: Path, *, adviser: str = ADVISER, drone: ScriptedDrone | None = None) -> Path:
    """Fly a scripted drone under the rule's advice and return the record."""
    folder.mkdir(parents=True, exist_ok=True)
    tree = tree_file(folder, MISSION.format(adviser=adviser))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("uav_bt.app.assembly.make_drone", lambda _: drone or ScriptedDrone())
        # No network: only its place in the tree matters.
        patch.setattr("behaviours.perceive.class_map.Segment._load", lambda *_: SeesGround())
        app.fly(tree, app.FlightOptions(record=folder / "flight.mcap", record_quality="small"))
    return folder / "flight.mcap"


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return flown(tmp_path_factory.mktemp("advised"))


def test_every_advised_view_is_read_and_kept(
    record: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (flight,) = read_advised_flights([record], NET, tmp_path)
    assert len(flight.ends) > 20
    assert flight.image(0).shape == (16, 32, 3)
    assert (flight.labels[:, 0, 0] > 0.0).all()  # only ground: the rule advances
    assert np.isnan(flight.labels[:, :, 3]).all()  # without a distance
    assert (np.diff(flight.poses[:, 0]) > 0.0).all()
    monkeypatch.setattr(samples, "advised_flight", None)  # it must not be read again
    (again,) = read_advised_flights([record], NET, tmp_path)
    np.testing.assert_array_equal(again.labels, flight.labels)
    np.testing.assert_array_equal(again.images, flight.images)
    monkeypatch.undo()
    read_advised_flights([record], replace(NET, width_px=64, height_px=32), tmp_path)
    assert len(list(tmp_path.glob("*.npz"))) == 2  # the network's size decides


def test_flights_without_advice_or_of_two_cameras_are_refused(record: Path, tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"this flight contains no advice.*put <Advise/>"):
        read_advised_flights([flown(tmp_path, adviser="")], NET, tmp_path)
    other = ScriptedDrone()
    other.camera = replace(other.camera, forward_offset_m=0.3)
    odd = flown(tmp_path / "other", drone=other)
    with pytest.raises(FileError, match="was flown with another camera than"):
        read_advised_flights([record, odd], NET, tmp_path)


def test_training_leaves_weights_that_fly_and_goes_on(record: Path, tmp_path: Path) -> None:
    from perception.control.training.network import STUDENT_FILES
    from perception.control.training.run import ControlTrainingConfig, train_control
    from uav_bt.learning.training import save_trained, shown

    quick = ControlTrainingConfig(steps=4, batch=8, warm_up_steps=2, checkpoint_every=2)
    flights = read_advised_flights([record], NET, tmp_path / "views")
    windows = samples.ControlSamples(flights, NET, quick.near_weight)
    out, told = tmp_path / "student.safetensors", list[tuple[str, int, int]]()
    for _ in range(2):
        net = train_control(
            windows,
            quick,
            NET,
            checkpoint=tmp_path / "checkpoint.safetensors",
            progress=shown(lambda *now: told.append(now)),
        )
        save_trained(STUDENT_FILES, net, out, quick, {"flights": 1})
    assert [now[1:] for now in told] == [(done, 4) for done in (1, 2, 3, 4)]
    notes = STUDENT_FILES.load(out)[1]
    assert (notes["flights"], notes["training"]["steps"]) == (1, 4)
    student = OnnxControlStudent(out.with_suffix(".onnx"))
    assert student.config == NET
    score = evaluate_student(flights, student)
    result = run("net", "evaluate", "student", record, "--model", out.with_suffix(".onnx"))
    assert result.exit_code == 0, result.output
    assert f"flights: 1, views scored: {score.windows}" in result.output
    unet = SHIPPED_WEIGHTS / "unet.onnx"
    refused = run("net", "evaluate", "student", record, "--model", unet)
    assert_refused(refused, "is not a control student")


def test_training_may_begin_with_a_segmentation_networks_encoder(tmp_path: Path) -> None:
    from perception.segmentation.training.unet import UNET_FILES, UNet, UNetConfig
    from uav_bt.learning.training import first_weights

    path = tmp_path / "unet.safetensors"
    config = UNetConfig(width_px=32, height_px=16, channels=(4, 8), outputs=1)
    UNET_FILES.save(path, UNet(config, ["box"]), notes={})
    start = first_weights(path)
    assert "down.0.0.weight" in start
    assert not any(name.startswith(("up.", "head")) for name in start)
