"""The training of a lab's network."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch

from perception.networks.training.loop import Progress
from perception.networks.weights_file import SHIPPED_WEIGHTS
from perception.segmentation.evaluation import score_segmentation
from perception.segmentation.training import run, unet
from perception.segmentation.training.run import AugmentConfig, augmented
from perception.segmentation.training.unet import UNET_FILES
from tests.paper_lab import CLASSES
from tests.perception.segmentation.patterned import PATTERNED, samples
from uav_bt.errors import UnknownNameError, ValueRangeError, WeightsError

NET = unet.UNetConfig(width_px=64, height_px=32, channels=(8, 12, 16), outputs=17)
SHORT = run.TrainingConfig(steps=6, batch=2, checkpoint_every=3, warm_up_steps=2)


@pytest.fixture(scope="module")
def pictures() -> run.LabelledImages:
    made = [(rgb, ids) for _, rgb, ids in samples(16, seed=0, width=64, height=32)]
    rgb, ids = (np.stack(part) for part in zip(*made, strict=True))
    return run.LabelledImages(rgb=rgb, ids=ids, classes=CLASSES.names)


def _state(net: unet.UNet) -> dict[str, np.ndarray]:
    return {name: tensor.numpy().copy() for name, tensor in net.state_dict().items()}


def test_settings_that_cannot_be_are_refused() -> None:
    with pytest.raises(ValueRangeError, match="3 levels need sides divisible by 8, got 60x32"):
        replace(NET, width_px=60)
    with pytest.raises(ValueRangeError, match="must be positive"):
        replace(SHORT, steps=0)
    with pytest.raises(UnknownNameError, match="unknown loss 'dice'"):
        replace(SHORT, loss="dice")  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["cross_entropy", "bce_dice"])
def test_a_loss_is_small_for_the_right_answer_and_ignores_what_nobody_knows(name: str) -> None:
    ids = torch.tensor([[[0, 3], [16, run.IGNORED]]])
    right = torch.full((1, 17, 2, 2), -20.0)
    for row, column, class_id in ((0, 0, 0), (0, 1, 3), (1, 0, 16), (1, 1, 5)):
        right[0, class_id, row, column] = 20.0
    loss = run.LOSSES[name]
    assert loss(right, ids, run.IGNORED).item() < 0.02
    wrong = right.clone()
    wrong[0, :, 1, 1] = right[0, :, 0, 0]  # another answer where nobody knows
    least = loss(right, ids, run.IGNORED).item()
    assert loss(wrong, ids, run.IGNORED).item() == pytest.approx(least, abs=1e-6)
    wrong[0, :, 0, 0] = right[0, :, 0, 1]
    assert loss(wrong, ids, run.IGNORED).item() > 0.1


def test_a_few_steps_teach_the_patterns(pictures: run.LabelledImages) -> None:
    config = run.TrainingConfig(steps=60, batch=4, warm_up_steps=5, learning_rate=1e-2)
    told: list[Progress] = []
    net = run.train_unet(pictures, config, NET, progress=lambda now, _net: told.append(now))
    assert [now.step for now in told] == list(range(1, 61))
    assert told[-1].loss < 0.3 * told[0].loss
    predicted = run.predict(net, pictures.rgb)
    score = score_segmentation(zip(predicted, pictures.ids, strict=True), CLASSES)
    assert score.accuracy > 0.85
    assert set(np.unique(predicted)) <= set(PATTERNED)


def test_weights_with_nan_or_of_another_network_are_refused(tmp_path: Path) -> None:
    net = unet.UNet(NET, CLASSES.names)
    with torch.no_grad():
        net.head.bias[3] = float("nan")
    path = tmp_path / "unet.safetensors"
    UNET_FILES.save(path, net, notes={})
    with pytest.raises(WeightsError, match=r"NaN or infinity \(head.bias\)"):
        UNET_FILES.export(path, tmp_path / "unet.onnx")
    with pytest.raises(WeightsError, match="expected weights of kind 'segmentation-unet', got"):
        UNET_FILES.export(SHIPPED_WEIGHTS / "teacher.safetensors", tmp_path / "unet.onnx")
    assert not (tmp_path / "unet.onnx").exists()


STILL = AugmentConfig(hue_deg=0.0, saturation=0.0, value=0.0, rotation_deg=0.0, shift=0.0)


def test_blur_and_noise_change_the_image_and_not_the_labels() -> None:
    (_, rgb, ids) = next(samples(1, seed=0))
    images = []
    for config in (replace(STILL, blur_px=3.0), STILL, replace(STILL, noise=20.0)):
        image, same = augmented(rgb, ids, np.random.default_rng(0), config)
        np.testing.assert_array_equal(same, ids)
        images.append(image)
    # HSV in eight bits and back costs a few levels.
    assert np.abs(images[1].astype(int) - rgb.astype(int)).mean() < 2.0
    steps = [np.abs(np.diff(image.astype(int), axis=1)).mean() for image in images]
    assert steps[0] < steps[1] < steps[2]


def test_a_network_begins_with_the_weights_of_another_one(pictures: run.LabelledImages) -> None:
    """With other classes its head begins anew."""
    start = unet.UNet(NET, CLASSES.names)
    config = replace(SHORT, steps=1, learning_rate=1e-12)
    names = tuple(f"other_{name}" for name in CLASSES.names)
    same, other = (
        _state(run.train_unet(replace(pictures, classes=classes), config, NET, start=start))
        for classes in (CLASSES.names, names)
    )
    for name, tensor in _state(start).items():
        if name.endswith("weight"):
            np.testing.assert_allclose(same[name], tensor, atol=1e-6, err_msg=name)
            near = np.allclose(other[name], tensor, atol=1e-6)
            assert near is not name.startswith("head."), name


def test_colours_stay_within_the_papers_limits() -> None:
    """Hue by up to 5 degrees, saturation by 2 %, value by 6 %."""
    config = AugmentConfig(rotation_deg=0.0, shift=0.0)
    rgb = np.full((20, 20, 3), (200, 90, 40), dtype=np.uint8)
    ids = np.zeros((20, 20), dtype=np.uint8)
    before = cv2.cvtColor(rgb, cv2.COLOR_RGB2HSV)[0, 0].astype(float)
    rng = np.random.default_rng(0)
    for _ in range(100):
        changed, _ = augmented(rgb, ids, rng, config)
        after = cv2.cvtColor(changed, cv2.COLOR_RGB2HSV)[10, 10].astype(float)
        assert abs(after[0] - before[0]) * 2.0 <= 5.0 + 2.0  # 8-bit hue counts in two degrees
        assert abs(after[1] / before[1] - 1.0) <= 0.02 + 0.01
        assert abs(after[2] / before[2] - 1.0) <= 0.06 + 0.01


def test_labels_move_with_their_pixels() -> None:
    ids = np.zeros((90, 160), dtype=np.uint8)
    ids[30:60, 40:120] = 4
    rgb = np.repeat((ids[..., None] > 0) * np.uint8(200), 3, axis=2)
    config = AugmentConfig(hue_deg=0.0, saturation=0.0, value=0.0)
    rng, again = (np.random.default_rng(1) for _ in range(2))
    for _ in range(20):
        changed, moved = augmented(rgb, ids, rng, config)
        agree = (changed[..., 0] > 100) == (moved == 4)
        assert agree.mean() > 0.98
        for one, other in zip(augmented(rgb, ids, again, config), (changed, moved), strict=True):
            np.testing.assert_array_equal(one, other)
