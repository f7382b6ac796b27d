"""Training of a lab's network: masks, checkpoint, files and refusals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from safetensors.numpy import load_file

from perception.segmentation.runtime import OnnxSegmenter
from tests.uav_bt.learning.lab_world import FLOOR, WALL, draw_lab, exact_ids, write_colour_network
from uav_bt.errors import FileError, InputError
from uav_bt.lab.shipped import load_lab
from uav_bt.learning.lab_data import LabData, MaskSource, checked_data, make_masks
from uav_bt.learning.lab_material import LabMaterial
from uav_bt.learning.lab_training import (
    lab_training_config,
    mask_source,
    train_lab,
)

CONFIG = replace(lab_training_config(steps=3, batch=2), checkpoint_every=1)


def with_foreign_teacher(folder: Path, **drawn: int) -> LabData:
    """Return a lab whose masks a network makes, which takes less time than a teacher."""
    draw_lab(folder, **drawn)
    write_colour_network(folder / "colours.onnx")
    text = (folder / "lab.yaml").read_text() + "teacher: {model: colours.onnx}\n"
    (folder / "lab.yaml").write_text(text)
    return checked_data(LabMaterial(lab=load_lab(folder / "lab.yaml")))


# --- masks ----------------------------------------------------------------------------------------


def test_a_teacher_of_the_picks_makes_the_masks(tmp_path: Path) -> None:
    data = checked_data(draw_lab(tmp_path / "hall", train=4))
    source = mask_source(data)
    assert source.file == tmp_path / "hall" / "training" / "teacher.safetensors"

    _, ids = make_masks(source, data.images("train")[:1], tmp_path / "masks")

    exact = cv2.resize(exact_ids(40), (224, 112), interpolation=cv2.INTER_NEAREST_EXACT)
    assert ids.shape == (1, 112, 224)
    assert (ids[0] == exact).mean() > 0.97


def test_kept_masks_are_not_made_again_and_a_changed_image_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = with_foreign_teacher(tmp_path / "hall")
    assert data.source is not None
    images, folder = data.images("train"), tmp_path / "masks"
    calls: list[tuple[str, int, int]] = []

    rgb, ids = make_masks(data.source, images, folder, advance=lambda *now: calls.append(now))
    assert calls[0] == ("masks", 0, 6)
    assert calls[-1] == ("masks", 6, 6)
    made: list[int] = []
    real = MaskSource.load

    def counted(source: MaskSource) -> object:
        make = real(source)
        return lambda image: made.append(1) or make(image)

    monkeypatch.setattr(MaskSource, "load", counted)
    again = make_masks(data.source, images, folder)
    np.testing.assert_array_equal(again[0], rgb)
    np.testing.assert_array_equal(again[1], ids)
    assert not made
    cv2.imwrite(str(images[2]), np.full((144, 256, 3), (0, 200, 0), dtype=np.uint8))
    _, changed = make_masks(data.source, images, folder)
    assert len(made) == 1
    assert (changed[2] == FLOOR).all()
    first = min(folder.iterdir())
    first.write_bytes(b"half")
    with pytest.raises(FileError, match=f"{first.name}: is damaged .* made again"):
        make_masks(data.source, images, folder)


# --- training -------------------------------------------------------------------------------------


def test_an_interrupted_training_continues_and_gives_the_same_network(tmp_path: Path) -> None:
    whole, broken = (with_foreign_teacher(tmp_path / name) for name in ("whole", "broken"))
    assert whole.source is not None
    assert broken.source is not None
    train_lab(whole, whole.source, CONFIG)
    network = broken.material.network
    network.write_bytes(b"the old one")

    def interrupt(stage: str, done: int, _total: int) -> None:
        if stage.startswith("training") and done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_lab(broken, broken.source, CONFIG, advance=interrupt)
    assert network.read_bytes() == b"the old one"
    steps: list[int] = []
    train_lab(broken, broken.source, CONFIG, advance=lambda _s, done, _t: steps.append(done))

    assert steps[-3:] == [3, 0, 1]  # the last step only, then the 8-bit integers
    ours = load_file(broken.material.training / "unet.safetensors")
    for name, tensor in load_file(whole.material.training / "unet.safetensors").items():
        np.testing.assert_array_equal(ours[name], tensor, err_msg=name)
    assert network.read_bytes() != b"the old one"


def test_the_network_has_the_classes_of_the_lab_and_a_new_training_replaces_it(
    tmp_path: Path,
) -> None:
    data = with_foreign_teacher(tmp_path / "hall")
    assert data.source is not None
    train_lab(data, data.source, CONFIG)
    classes, network = data.material.lab.classes, data.material.network
    ids = OnnxSegmenter(network, classes).ids(np.zeros((144, 256, 3), dtype=np.uint8))
    assert ids.shape == (112, 224)
    before, kept = network.read_bytes(), sorted(data.material.training.glob("checkpoint-*"))
    train_lab(data, data.source, replace(CONFIG, seed=1))
    assert network.read_bytes() != before
    (checkpoint,) = data.material.training.glob("checkpoint-*")
    assert checkpoint not in kept


# --- refusals -------------------------------------------------------------------------------------


def rewritten(material: LabMaterial, old: str, new: str) -> LabMaterial:
    text = material.picks.read_text()
    assert old in text
    material.picks.write_text(text.replace(old, new))
    return material


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("hall-001.png,20,20", "hall-001.png,256,20", r"picks.csv:8: .*256x144 .*\(256, 20\)"),
        ("hall-001.png,20,20", "hall-901.png,20,20", "picks.csv:8: .*got 'hall-901.png'"),
        ("hall-001.png,20,20,wall", "hall-001.png,20,20,wal", "picks.csv:8: .*did you mean 'wall'"),
        (",floor,", ",wall,", r"picks.csv: expected picks of the ground \('floor'\)"),
    ],
)
def test_a_bad_pick_is_refused_with_its_line(
    old: str, new: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(FileError, match=message):
        checked_data(rewritten(draw_lab(tmp_path / "hall"), old, new))


def test_picks_of_one_class_and_missing_ones_are_refused(tmp_path: Path) -> None:
    material = draw_lab(tmp_path / "hall")
    for name in ("wall", "crate"):
        rewritten(material, f",{name},", ",floor,")
    with pytest.raises(FileError, match="two classes at least on images for training, got 1"):
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
    warnings = data.warnings
    assert "broken.jpg: is not a readable image; it is left out" in warnings[0]
    assert "broken.jpg" not in data.uses
    assert "only 6 images for training" in warnings
    assert any("class 'cart' has no picks" in warning for warning in warnings)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("teacher: {model: gone.onnx}", r"lab.yaml:7: teacher.model: there is no file .*gone"),
        ("teacher: {model: lab.yaml}", "lab.yaml:7: teacher.model: expected an ONNX file"),
        ("teacher: {model: two.onnx}", "lab.yaml:7: .*scores of the 4 classes of the lab.*gives 2"),
        ("teacher: {model: two.onnx, classes: many.yaml}", "lab.yaml:7: .*names class 7"),
        ("teacher: {model: two.onnx, classes: no.yaml}", "lab.yaml:7: .*maps no class to the gro"),
    ],
)
def test_a_foreign_teacher_that_does_not_fit_is_refused_with_the_line(
    keys: str, message: str, tmp_path: Path
) -> None:
    material = draw_lab(tmp_path / "hall")
    folder = material.lab.folder
    write_colour_network(folder / "two.onnx", order=(0, 1))
    (folder / "many.yaml").write_text("classes: {7: ground}\n")
    (folder / "no.yaml").write_text("classes: {0: obstacle}\n")
    (folder / "lab.yaml").write_text((folder / "lab.yaml").read_text() + keys + "\n")
    with pytest.raises(FileError, match=message):
        checked_data(LabMaterial(lab=load_lab(folder / "lab.yaml")))


def test_a_foreign_teacher_with_a_mapping_needs_no_picks(tmp_path: Path) -> None:
    material = draw_lab(tmp_path / "hall")
    folder = material.lab.folder
    material.picks.unlink()
    write_colour_network(folder / "two.onnx", order=(2, 1))
    (folder / "two.yaml").write_text("classes: {0: outside, 1: ground}\n")
    keys = "teacher: {model: two.onnx, classes: two.yaml}\n"
    (folder / "lab.yaml").write_text((folder / "lab.yaml").read_text() + keys)
    data = checked_data(LabMaterial(lab=load_lab(folder / "lab.yaml")))
    assert mask_source(data) == data.source
    assert data.source is not None
    _, ids = make_masks(data.source, data.images("train")[:1], tmp_path / "masks")
    assert ids[0, 5, 5] == WALL
    assert ids[0, 108, 5] == FLOOR
