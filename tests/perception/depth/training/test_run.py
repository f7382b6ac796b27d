"""Training the depth network: it learns, resumes bit by bit, and refuses unusable input."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from perception.depth.training import network, run
from perception.depth.training.clips import ClipSource
from perception.depth.training.footage import Flight, shrink
from perception.networks.training.loop import Progress
from tests.perception.depth.depth_flight import known_flight
from uav_bt.errors import WeightsError

SIZE_PX = (64, 64)
NET = network.DepthNetConfig(width_px=64, height_px=64, channels=(8, 12, 16))
SHORT = run.DepthTrainingConfig(steps=4, batch=1, checkpoint_every=2, warm_up_steps=2)
LABELS_ONLY = replace(SHORT, photometric=False)


@pytest.fixture(scope="module")
def flight() -> Flight:
    known = known_flight(8)
    small = [replace(frame, image=shrink(frame.image, SIZE_PX)) for frame in known.footage.frames]
    return Flight(
        frames=tuple(small),
        states=known.footage.states,
        camera=known.footage.camera.resized(*SIZE_PX),
        labels=known.labels()[:, :, 2::4, 2::5],
    )


@pytest.fixture(scope="module")
def source(flight: Flight) -> ClipSource:
    return ClipSource([flight])


@pytest.fixture(scope="module")
def bare(flight: Flight) -> ClipSource:
    return ClipSource([replace(flight, labels=None)])


def test_labels_teach_depth(source: ClipSource) -> None:
    told: list[float] = []
    config = replace(LABELS_ONLY, steps=50, batch=2, learning_rate=5e-3)
    run.train_depth(
        source, config, NET, progress=lambda now, _net: told.append(now.terms["labels"])
    )
    assert len(told) == 50
    assert np.mean(told[-5:]) < 0.6 * np.mean(told[:5])


def test_neighbouring_frames_teach_without_labels(bare: ClipSource) -> None:
    terms: list[dict[str, float]] = []
    config = replace(SHORT, steps=30, batch=2, learning_rate=5e-3)
    run.train_depth(bare, config, NET, progress=lambda now, _net: terms.append(dict(now.terms)))
    assert set(terms[0]) == {"photometric", "geometry", "smoothness"}
    total = [sum(term.values()) for term in terms]
    assert np.mean(total[-6:]) < np.mean(total[:6])


def test_with_a_pose_network_beside_it_a_resumed_run_ends_where_an_unbroken_one_does(
    source: ClipSource, tmp_path: Path
) -> None:
    config = replace(SHORT, pose="network")
    unbroken = run.train_depth(source, config, NET)
    assert not unbroken.training

    def stop(now: Progress, _net: network.DepthNet) -> None:
        if now.step == 3:
            raise KeyboardInterrupt

    path = tmp_path / "checkpoint.safetensors"
    with pytest.raises(KeyboardInterrupt):
        run.train_depth(source, config, NET, checkpoint=path, progress=stop)
    steps: list[int] = []
    told = {"progress": lambda now, _net: steps.append(now.step)}
    resumed = run.train_depth(source, config, NET, checkpoint=path, **told)
    assert steps == [3, 4]
    for name, value in unbroken.state_dict().items():
        assert torch.equal(value, resumed.state_dict()[name]), name


def test_a_run_may_begin_with_weights_of_its_shape(source: ClipSource, tmp_path: Path) -> None:
    path, first = tmp_path / "depth.safetensors", network.DepthNet(NET)
    network.DEPTH_FILES.save(path, first, notes={})
    slow = replace(LABELS_ONLY, steps=1, learning_rate=1e-6, seed=7)
    net = run.train_depth(source, slow, NET, start=path)
    pairs = zip(first.parameters(), net.parameters(), strict=True)
    assert max(float((one - two).detach().abs().max()) for one, two in pairs) < 1e-4
    network.DEPTH_FILES.save(path, network.DepthNet(replace(NET, channels=(8, 12, 20))), notes={})
    with pytest.raises(WeightsError, match="another shape"):
        run.train_depth(source, slow, NET, start=path)
