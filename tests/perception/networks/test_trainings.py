"""What every training keeps to: it goes on from its checkpoint, and refuses another run's."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest

from tests.paper_lab import CLASSES
from tests.perception.control.control_world import TINY, made_up_flight
from tests.perception.depth.depth_flight import small_flight
from tests.perception.segmentation.patterned import samples
from uav_bt.errors import WeightsError

SHORT: Final = {"steps": 6, "batch": 2, "checkpoint_every": 3, "warm_up_steps": 2}


def train_student(*, seed: int, **run: Any) -> Any:
    from perception.control.training import run as training
    from perception.control.training.samples import ControlSamples

    views = ControlSamples([made_up_flight(1)], TINY)
    config = training.ControlTrainingConfig(**SHORT, seed=seed)
    return training.train_control(views, config, TINY, **run)


def train_depth(*, seed: int, **run: Any) -> Any:
    """With a pose network beside it."""
    from perception.depth.training import run as training
    from perception.depth.training.clips import ClipSource
    from perception.depth.training.network import DepthNetConfig

    net = DepthNetConfig(width_px=64, height_px=64, channels=(8, 12, 16))
    config = training.DepthTrainingConfig(**SHORT, seed=seed, pose="network")
    return training.train_depth(ClipSource([small_flight()]), config, net, **run)


def train_unet(*, seed: int, **run: Any) -> Any:
    from perception.segmentation.training import run as training
    from perception.segmentation.training.unet import UNetConfig

    rgb, ids = zip(*[each[1:] for each in samples(8, seed=0, width=64, height=32)], strict=True)
    images = training.LabelledImages(rgb=np.stack(rgb), ids=np.stack(ids), classes=CLASSES.names)
    net = UNetConfig(width_px=64, height_px=32, channels=(8, 12, 16), outputs=17)
    return training.train_unet(images, training.TrainingConfig(**SHORT, seed=seed), net, **run)


TRAININGS: Final = [train_student, train_depth, train_unet]


@pytest.mark.parametrize("train", TRAININGS, ids=lambda train: train.__name__)
def test_a_training_that_was_stopped_ends_as_a_whole_one(
    train: Callable[..., Any], tmp_path: Path
) -> None:
    whole = train(seed=0)
    assert not whole.training
    checkpoint, told = tmp_path / "run.safetensors", list[int]()

    def stop(now: Any, _net: object) -> None:
        if now.step == 4:  # the checkpoint of step 3 is the newest
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(seed=0, checkpoint=checkpoint, progress=stop)
    with pytest.raises(WeightsError, match="other settings or data; delete the file"):
        train(seed=1, checkpoint=checkpoint)
    resumed = train(seed=0, checkpoint=checkpoint, progress=lambda now, _: told.append(now.step))
    assert told == [4, 5, 6]
    for name, tensor in whole.state_dict().items():
        np.testing.assert_array_equal(resumed.state_dict()[name], tensor, err_msg=name)
    checkpoint.write_bytes(checkpoint.read_bytes()[:1000])
    with pytest.raises(WeightsError, match="damaged"):
        train(seed=0, checkpoint=checkpoint)
