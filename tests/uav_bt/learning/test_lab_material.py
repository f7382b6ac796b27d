"""The list of a lab's images, and what each image is used for."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from perception.segmentation.training.picks import read_picks
from uav_bt.errors import FileError
from uav_bt.lab.lab_file import read_lab
from uav_bt.lab.shipped import write_lab
from uav_bt.learning.lab_material import LabMaterial


@pytest.fixture
def material(tmp_path: Path) -> LabMaterial:
    return LabMaterial(lab=read_lab(write_lab("hall", tmp_path).parent))


def _add_images(material: LabMaterial, count: int) -> None:
    material.frames.mkdir(exist_ok=True)
    for number in range(count):
        cv2.imwrite(str(material.frames / f"{number:02d}.png"), np.zeros((4, 6, 3), np.uint8))


def test_images_that_were_copied_keep_their_use(material: LabMaterial) -> None:
    _add_images(material, 10)
    first = material.uses()
    assert [name for name, use in first.items() if use == "check"] == ["04.png", "09.png"]
    material.keep_uses(first)  # as training does
    for name in ("A_extra.png", "._00.png"):
        cv2.imwrite(str(material.frames / name), np.zeros((4, 6, 3), np.uint8))
    (material.frames / "02.png").unlink()
    kept = {name: use for name, use in first.items() if name != "02.png"}
    assert material.uses() == {"A_extra.png": "train", **kept}


def test_a_byte_order_mark_and_empty_lines_are_no_fault(material: LabMaterial) -> None:
    _add_images(material, 1)
    text = "\ufeffimage,source,time_s,sharpness,use\n00.png,a.mp4,0.0,1.0,check\n\n\n"
    material.list_file.write_text(text, encoding="utf-8")
    assert material.uses() == {"00.png": "check"}
    text = "\ufeffimage,x,y,class,origin\n00.png,1,2,FLOOR,hand\n\n\n"
    floor = material.lab.classes.names[material.lab.classes.ground]
    material.picks.write_text(text.replace("FLOOR", floor), encoding="utf-8")
    (pick,) = read_picks(material.picks, material.lab.classes)
    assert (pick.x, pick.y) == (1, 2)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("a.png,v.mp4,0.0,1.0", "column use: Field required"),
        ("../a.png,v.mp4,0.0,1.0,train", "column image: .*, got '../a.png'"),
        ("a.png,v.mp4,0.0,1.0,test", "column use: .* 'train' or 'check', got 'test'"),
        ("a.png,v.mp4,zero,1.0,train", "column time_s: .* number.*, got 'zero'"),
        ("a.png,v.mp4,nan,1.0,train", "column time_s: .* finite number, got 'nan'"),
    ],
)
def test_a_malformed_list_names_the_line(material: LabMaterial, line: str, words: str) -> None:
    _add_images(material, 1)
    material.list_file.write_text(f"image,source,time_s,sharpness,use\n{line}\n")

    with pytest.raises(FileError, match=words) as caught:
        material.uses()

    assert str(caught.value).startswith(f"{material.list_file}:2")
