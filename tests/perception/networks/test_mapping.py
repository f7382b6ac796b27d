"""Mappings from a foreign network's classes to ours."""

import json
from pathlib import Path

import numpy as np
import pytest

from perception.networks import mapping as module
from perception.networks.mapping import ClassMapping, CountedAsGround, InputFormat
from tests.paper_lab import BACKGROUND, CARPET, CLASSES, HELIPAD_H, paper_map
from tests.worlds.tables import cases
from uav_bt.errors import FileError, UnknownNameError, ValueRangeError
from uav_bt.types import ClassMap, Frame


def _read(tmp_path: Path, text: str) -> ClassMapping:
    path = tmp_path / "foreign.yaml"
    path.write_text(text, encoding="utf-8")
    return module.read_mapping(path, CLASSES)


def test_names_of_classes_and_roles_become_ids(tmp_path: Path) -> None:
    """JSON is as good as YAML."""
    mapping = _read(tmp_path, "classes: {0: background, 3: obstacle, 4: roof_2, 7: mark}")
    assert mapping.table(9, CLASSES).tolist() == [0, 0, 0, 4, 13, 0, 0, 3, 0]
    mapping = _read(tmp_path, "default: obstacle\nclasses: {1: carpet}")
    assert mapping.table(3, CLASSES).tolist() == [4, 1, 4]
    wanted = {"mean": (1, 2, 3), "scale": (4, 5, 6.5), "colours": "bgr", "layout": "nhwc"}
    mapping = _read(tmp_path, json.dumps({"classes": {"2": "carpet"}, "input": wanted}))
    assert mapping.table(3, CLASSES)[2] == 1
    assert mapping.input == InputFormat(**wanted)


@pytest.mark.parametrize(("text", "message"), cases("perception")["mappings"])
def test_a_bad_mapping_is_refused_with_the_reason(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(FileError, match=message):
        _read(tmp_path, text)


def test_a_bad_mapping_of_depth_and_a_class_that_is_not_there_are_refused(tmp_path: Path) -> None:
    for text, message in (
        ("output: disparit", "1: output: expected 'depth' or 'disparity', got 'disparit'"),
        ("input: {}", "n.yaml:1: lacks the key 'output'"),
    ):
        (tmp_path / "n.yaml").write_text(text, encoding="utf-8")
        with pytest.raises(FileError, match=message):
            module.read_depth_mapping(tmp_path / "n.onnx")
    with pytest.raises(ValueRangeError, match="names class 16, the network has classes 0 to 9"):
        ClassMapping.identity(CLASSES).table(10, CLASSES)


def test_classes_of_ground_become_the_ground_and_others_stay() -> None:
    class Told:
        def segment(self, frame: Frame) -> ClassMap:
            ids = np.array([[BACKGROUND, CARPET, HELIPAD_H, 7]], np.uint8)
            return paper_map(ids=ids, captured_s=frame.captured_s)

    frame = Frame(image=np.zeros((2, 2, 3), np.uint8), index=0, captured_s=3.0, gimbal_pitch_rad=0)
    told = CountedAsGround(Told(), CLASSES, ["background"]).segment(frame)
    assert told.ids.tolist() == [[CARPET, CARPET, HELIPAD_H, 7]]
    assert told.captured_s == 3.0
    with pytest.raises(UnknownNameError, match="did you mean 'carpet'"):
        CountedAsGround(Told(), CLASSES, ["carpets"])
