"""Whole training of the control student, from records to weights and curves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from perception.control.ego_state import ControlNetConfig
from perception.control.runtime import OnnxControlStudent
from perception.control.training import samples
from perception.control.training.network import STUDENT_FILES
from perception.control.training.run import ControlTrainingConfig
from perception.networks.weights_file import SHIPPED_WEIGHTS
from perception.segmentation.training.unet import UNET_FILES, UNet, UNetConfig
from tests.worlds.cli import assert_refused, run
from tests.worlds.footage import SeesGround
from tests.worlds.trees import tree_file
from uav_bt import app
from uav_bt.errors import FileError
from uav_bt.learning.dataset import evaluate_student, read_advised_flights
from uav_bt.learning.training import first_weights, train_student
from uav_bt.record.reader import RecordReader
from uav_bt.testing import ScriptedDrone

NET = ControlNetConfig(
    width_px=32, height_px=16, channels=(4, 8), bottleneck=4, embedding=8, hidden=8
)
QUICK = ControlTrainingConfig(steps=4, batch=8, warm_up_steps=2, checkpoint_every=2)

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


def test_a_small_record_has_small_pictures_and_the_rules_word_but_no_maps(record: Path) -> None:
    topics = {topic for topic, _, _ in RecordReader(record).messages()}
    assert {"/mission/advice", "/camera/image"} <= topics
    assert not topics & {"/perception/class_map", "/perception/metric_depth"}


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


def test_flights_without_advice_and_of_two_cameras_are_refused(
    record: Path, tmp_path: Path
) -> None:
    with pytest.raises(FileError, match=r"this flight contains no advice.*put <Advise/>"):
        read_advised_flights([flown(tmp_path, adviser="")], NET, tmp_path)
    other = ScriptedDrone()
    other.camera = replace(other.camera, forward_offset_m=0.3)
    odd = flown(tmp_path / "other", drone=other)
    with pytest.raises(FileError, match="was flown with another camera than"):
        read_advised_flights([record, odd], NET, tmp_path)


def test_training_leaves_weights_that_fly_and_goes_on_from_its_checkpoint(
    record: Path, tmp_path: Path
) -> None:
    flights = read_advised_flights([record], NET, tmp_path / "views")
    out, told = tmp_path / "student.safetensors", list[tuple[str, int, int]]()
    for _ in range(2):
        train_student(
            flights,
            out,
            config=QUICK,
            net_config=NET,
            checkpoint=tmp_path / "checkpoint.safetensors",
            advance=lambda stage, done, total: told.append((stage.split(",")[0], done, total)),
        )
    assert told == [("training", done, 4) for done in (1, 2, 3, 4)]
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
    path = tmp_path / "unet.safetensors"
    config = UNetConfig(width_px=32, height_px=16, channels=(4, 8), outputs=1)
    UNET_FILES.save(path, UNet(config, ["box"]), notes={})
    start = first_weights(path)
    assert "down.0.0.weight" in start
    assert not any(name.startswith(("up.", "head")) for name in start)
