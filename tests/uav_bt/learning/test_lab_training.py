"""Training of a lab's network: masks, checkpoint, files and refusals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from safetensors.numpy import load_file

from perception.segmentation.runtime import OnnxSegmenter
from perception.segmentation.teacher import TeacherConfig, load_teacher
from tests.uav_bt.learning.lab_world import FLOOR, WALL, draw_lab, exact_ids, write_colour_network
from uav_bt.errors import FileError, InputError
from uav_bt.lab.shipped import load_lab
from uav_bt.learning.lab_data import LabData, MaskSource, checked_data, make_masks
from uav_bt.learning.lab_material import LabMaterial


def stated(material: LabMaterial, keys: str) -> LabData:
    """Add keys to a lab file, and check its training files."""
    file = material.lab.file
    file.write_text(f"{file.read_text()}{keys}\n")
    return checked_data(LabMaterial(lab=load_lab(file)))


def mask_source(data: LabData) -> MaskSource:
    from uav_bt.learning.lab_training import mask_source  # it imports torch

    return mask_source(data)


def with_foreign_teacher(folder: Path) -> tuple[LabData, MaskSource]:
    """Return a lab whose masks a network makes, which takes less time than a teacher."""
    material = draw_lab(folder)
    write_colour_network(folder / "colours.onnx")
    data = stated(material, "teacher: {model: colours.onnx}")
    return data, mask_source(data)


def test_a_teacher_of_the_picks_makes_the_masks(tmp_path: Path) -> None:
    data = checked_data(draw_lab(tmp_path / "hall", train=4))
    source = mask_source(data)
    assert source.file == tmp_path / "hall" / "training" / "teacher.safetensors"
    assert load_teacher(source.file, source.classes).config == TeacherConfig()
    _, ids = make_masks(source, data.images("train")[:1], tmp_path / "masks")
    exact = cv2.resize(exact_ids(40), (224, 112), interpolation=cv2.INTER_NEAREST_EXACT)
    assert ids.shape == (1, 112, 224)
    assert (ids[0] == exact).mean() > 0.97


def test_kept_masks_are_not_made_again_and_a_changed_image_is(tmp_path: Path) -> None:
    data, source = with_foreign_teacher(tmp_path / "hall")
    images, folder = data.images("train"), tmp_path / "masks"
    calls: list[tuple[str, int, int]] = []

    def make() -> tuple[np.ndarray, np.ndarray]:
        calls.clear()
        return make_masks(source, images, folder, advance=lambda *now: calls.append(now))

    rgb, ids = make()
    assert calls == [("masks", 0, 6), ("masks", 6, 6)]
    again = make()
    assert calls == [("masks", 6, 6)]
    np.testing.assert_array_equal(again[0], rgb)
    np.testing.assert_array_equal(again[1], ids)
    cv2.imwrite(str(images[2]), np.full((144, 256, 3), (0, 200, 0), dtype=np.uint8))
    _, changed = make()
    assert calls == [("masks", 5, 6), ("masks", 6, 6)]
    assert (changed[2] == FLOOR).all()
    first = min(folder.iterdir())
    first.write_bytes(b"half")
    with pytest.raises(FileError, match=f"{first.name}: is damaged .* made again"):
        make()


def test_an_interrupted_training_continues_and_gives_the_same_network(tmp_path: Path) -> None:
    from uav_bt.learning.lab_training import lab_training_config, train_lab

    config = replace(lab_training_config(steps=3, batch=2), checkpoint_every=1)
    whole, source = with_foreign_teacher(tmp_path / "whole")
    train_lab(whole, source, config)
    broken, source = with_foreign_teacher(tmp_path / "broken")
    network = broken.material.network
    network.write_bytes(b"the old one")

    def interrupt(stage: str, done: int, _total: int) -> None:
        if stage.startswith("training") and done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_lab(broken, source, config, advance=interrupt)
    assert network.read_bytes() == b"the old one"
    steps: list[int] = []
    train_lab(broken, source, config, advance=lambda _s, done, _t: steps.append(done))
    assert steps[-3:] == [3, 0, 1]  # the last step only, then the 8-bit integers
    ours = load_file(broken.material.training / "unet.safetensors")
    for name, tensor in load_file(whole.material.training / "unet.safetensors").items():
        np.testing.assert_array_equal(ours[name], tensor, err_msg=name)
    ids = OnnxSegmenter(network, broken.material.lab.classes).ids(np.zeros((9, 16, 3), np.uint8))
    assert ids.shape == (112, 224)
    before, kept = network.read_bytes(), sorted(broken.material.training.glob("checkpoint-*"))
    train_lab(broken, source, replace(config, seed=1))
    assert network.read_bytes() != before
    (checkpoint,) = broken.material.training.glob("checkpoint-*")
    assert checkpoint not in kept


def test_bad_and_missing_picks_and_too_few_images_are_refused(tmp_path: Path) -> None:
    material = draw_lab(tmp_path / "hall")
    good = material.picks.read_text()
    for old, new, message in (
        ("hall-001.png,20,20", "hall-001.png,256,20", r"picks.csv:8: .*256x144 .*\(256, 20\)"),
        (",floor,", ",wall,", r"picks.csv: expected picks of the ground \('floor'\)"),
    ):
        assert old in good
        material.picks.write_text(good.replace(old, new))
        with pytest.raises(FileError, match=message):
            checked_data(material)
    material.picks.unlink()
    with pytest.raises(FileError, match="there are no picks; `uav-bt lab pick`"):
        checked_data(material)
    few = draw_lab(tmp_path / "few", train=3)
    with pytest.raises(InputError, match="at least 4 images for training, got 3; `uav-bt lab fra"):
        checked_data(few)


def test_few_or_unreadable_images_are_a_warning(tmp_path: Path) -> None:
    material = draw_lab(tmp_path / "hall")
    (material.frames / "broken.jpg").write_bytes(b"no image")
    data = checked_data(material)
    assert "broken.jpg: is not a readable image; it is left out" in data.warnings[0]
    assert "broken.jpg" not in data.uses
    assert "only 6 images for training" in data.warnings
    assert any("class 'cart' has no picks" in warning for warning in data.warnings)


@pytest.mark.parametrize(
    ("teacher", "message"),
    [
        ("model: gone.onnx", r"lab.yaml:7: teacher.model: there is no file .*gone"),
        ("model: two.onnx", "lab.yaml:7: .*scores of the 4 classes of the lab.*gives 2"),
        ("model: two.onnx, classes: no.yaml", "lab.yaml:7: .*maps no class to the gro"),
    ],
)
def test_a_foreign_teacher_that_does_not_fit_is_refused_with_the_line(
    teacher: str, message: str, tmp_path: Path
) -> None:
    material = draw_lab(tmp_path / "hall")
    folder = material.lab.folder
    write_colour_network(folder / "two.onnx", order=(0, 1))
    (folder / "no.yaml").write_text("classes: {0: obstacle}\n")
    with pytest.raises(FileError, match=message):
        stated(material, f"teacher: {{{teacher}}}")


def test_a_foreign_teacher_with_a_mapping_needs_no_picks(tmp_path: Path) -> None:
    material = draw_lab(tmp_path / "hall")
    material.picks.unlink()
    write_colour_network(material.lab.folder / "two.onnx", order=(2, 1))
    mapping = material.lab.folder / "two.yaml"
    mapping.write_text("classes: {0: outside, 1: ground}\n")
    data = stated(material, "teacher: {model: two.onnx, classes: two.yaml}")
    _, ids = make_masks(mask_source(data), data.images("train")[:1], tmp_path / "masks")
    assert (ids[0, 5, 5], ids[0, 108, 5]) == (WALL, FLOOR)
