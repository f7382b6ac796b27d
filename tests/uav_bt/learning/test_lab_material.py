"""The list of a lab's images, and what each image is used for."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from uav_bt.errors import FileError
from uav_bt.lab.lab_file import read_lab
from uav_bt.lab.shipped import write_lab
from uav_bt.learning.lab_material import LabFrame, LabMaterial


@pytest.fixture
def material(tmp_path: Path) -> LabMaterial:
    return LabMaterial(lab=read_lab(write_lab("hall", tmp_path).parent))


def _add_images(material: LabMaterial, count: int) -> None:
    material.frames.mkdir(exist_ok=True)
    for number in range(count):
        cv2.imwrite(str(material.frames / f"{number:02d}.png"), np.zeros((4, 6, 3), np.uint8))


def test_images_without_a_list_are_split(material: LabMaterial) -> None:
    _add_images(material, 10)

    assert [n for n, use in material.uses().items() if use == "check"] == ["04.png", "09.png"]


def test_the_list_states_the_use(material: LabMaterial) -> None:
    _add_images(material, 2)
    frames = [
        LabFrame(image="00.png", source="a.mp4", time_s=1.25, sharpness=80.5, use="check"),
        LabFrame(image="01.png", source="a.mp4", time_s=2.5, sharpness=81.5, use="train"),
    ]

    material.write_frames(frames)

    assert material.read_frames() == frames
    assert material.uses() == {"00.png": "check", "01.png": "train"}


def test_a_lab_without_images_names_the_command(material: LabMaterial) -> None:
    with pytest.raises(FileError, match="uav-bt lab frames"):
        material.uses()


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("a.png,v.mp4,0.0,1.0", "expected the columns image,source,time_s,sharpness,use"),
        ("../a.png,v.mp4,0.0,1.0,train", "a file name without a folder, got '../a.png'"),
        ("a.png,v.mp4,0.0,1.0,test", "expected the use train or check, got 'test'"),
        ("a.png,v.mp4,zero,1.0,train", "expected numbers"),
        ("a.png,v.mp4,nan,1.0,train", "expected numbers"),
    ],
)
def test_a_malformed_list_names_the_line(material: LabMaterial, line: str, words: str) -> None:
    _add_images(material, 1)
    material.list_file.write_text(f"image,source,time_s,sharpness,use\n{line}\n")

    with pytest.raises(FileError, match=words) as caught:
        material.uses()

    assert str(caught.value).startswith(f"{material.list_file}:2")
