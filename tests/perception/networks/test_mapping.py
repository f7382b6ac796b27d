"""Mappings from a foreign network's classes to ours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from perception.networks.mapping import (
    ClassMapping,
    CountedAsGround,
    InputFormat,
    read_depth_mapping,
    read_mapping,
)
from tests.paper_lab import BACKGROUND, CARPET, CLASSES, HELIPAD_H, paper_map
from uav_bt.errors import FileError, UnknownNameError, ValueRangeError
from uav_bt.types import ClassMap, Frame


def _read(tmp_path: Path, text: str) -> ClassMapping:
    path = tmp_path / "foreign.yaml"
    path.write_text(text, encoding="utf-8")
    return read_mapping(path, CLASSES)


@pytest.mark.parametrize(
    ("text", "table"),
    [
        (
            "classes: {0: background, 3: obstacle, 4: roof_2, 7: mark}",
            [0, 0, 0, 4, 13, 0, 0, 3, 0],
        ),
        ("default: obstacle\nclasses: {1: carpet}", [4, 1, 4]),
    ],
)
def test_names_of_classes_and_roles_become_ids(tmp_path: Path, text: str, table: list[int]) -> None:
    assert _read(tmp_path, text).table(len(table), CLASSES).tolist() == table


def test_json_is_as_good_as_yaml(tmp_path: Path) -> None:
    mapping = _read(
        tmp_path,
        '{"classes": {"2": "carpet"}, "input": {"mean": [1, 2, 3], "scale": [4, 5, 6.5],'
        ' "colours": "bgr", "layout": "nhwc"}}',
    )
    assert mapping.table(3, CLASSES)[2] == 1
    assert mapping.input == InputFormat(
        mean=(1.0, 2.0, 3.0), scale=(4.0, 5.0, 6.5), colours="bgr", layout="nhwc"
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("classes: {0: carpte}", r"1: classes\[0\]: unknown class or role .* mean 'carpet'"),
        ("default: x\nclasses: {0: carpet}", "foreign.yaml:1: default: unknown class or role 'x'"),
        ("clases: {0: carpet}", "clases: unknown key; did you mean 'classes'"),
        ("classes: [carpet]", "foreign.yaml:1: classes: expected a mapping, got a list of 1"),
        ("classes: {}", "at least one class"),
        ("classes: {a: carpet}", "classes.a: expected a whole number as key, got 'a'"),
        ("classes: {-1: carpet}", "within 0 and 65535, got -1"),
        ("classes: {0: carpet}\nthreshold: 0.5", "threshold: unknown key"),
        ("classes: {0: carpet}\ninput: {mean: 3}", "2: input.mean: expected a list, got '3'"),
        ("classes: {0: carpet}\ninput: {mean: [1, 2]}", "2: input.mean"),
        ("classes: {0: carpet}\ninput: {scale: [1, 0, 1]}", "none of them zero"),
        ("classes: {0: carpet}\ninput: {layout: chw}", "expected 'nchw' or 'nhwc', got 'chw'"),
        ("classes: {0: carpet}\ninput: {size: [224, 0]}", "size must be a width and a height"),
        ("classes: {0: carpet}\noutput: chw", "output: expected 'nchw' or 'nhwc'"),
        ("- 1", "foreign.yaml:1: expected a mapping with classes, default, .*, got a list"),
    ],
)
def test_a_bad_mapping_is_refused_with_the_reason(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(FileError, match=message):
        _read(tmp_path, text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("output: disparit", "n.yaml:1: output: expected 'depth' or 'disparity', got 'disparit'"),
        ("input: {}", "n.yaml:1: lacks the key 'output'"),
    ],
)
def test_a_bad_mapping_of_depth_is_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "n.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(FileError, match=message):
        read_depth_mapping(tmp_path / "n.onnx")


def test_a_class_the_network_does_not_have_is_refused() -> None:
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
