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
from uav_bt.errors import ValueRangeError, WeightsError

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


def _same(one: network.DepthNet, two: network.DepthNet) -> bool:
    pairs = zip(one.state_dict().values(), two.state_dict().values(), strict=True)
    return all(torch.equal(first, second) for first, second in pairs)


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


def test_a_pose_network_learns_beside_it(bare: ClipSource) -> None:
    config = replace(SHORT, pose="network")
    net = run.train_depth(bare, config, NET)
    assert not net.training
    with torch.inference_mode():
        assert net(torch.rand(1, 3, 64, 64)).shape == (1, 1, 32, 32)


@pytest.mark.parametrize("pose", ["telemetry", "network"])
def test_a_resumed_run_ends_where_an_unbroken_one_does(
    source: ClipSource, tmp_path: Path, pose: str
) -> None:
    config = replace(SHORT, pose=pose)
    unbroken = run.train_depth(source, config, NET)

    class BreakOffError(Exception):
        pass

    def stop(now: Progress, _net: network.DepthNet) -> None:
        if now.step == 3:
            raise BreakOffError

    path = tmp_path / "checkpoint.safetensors"
    with pytest.raises(BreakOffError):
        run.train_depth(source, config, NET, checkpoint=path, progress=stop)
    steps: list[int] = []
    resumed = run.train_depth(
        source,
        config,
        NET,
        checkpoint=path,
        progress=lambda now, _net: steps.append(now.step),
    )
    assert steps == [3, 4]
    assert _same(unbroken, resumed)


def test_a_checkpoint_of_other_settings_is_refused(source: ClipSource, tmp_path: Path) -> None:
    path = tmp_path / "checkpoint.safetensors"
    run.train_depth(source, LABELS_ONLY, NET, checkpoint=path)
    with pytest.raises(WeightsError, match="other settings or data; delete the file"):
        run.train_depth(source, replace(LABELS_ONLY, seed=1), NET, checkpoint=path)


def test_a_run_may_begin_with_trained_weights(source: ClipSource, tmp_path: Path) -> None:
    path = tmp_path / "depth.safetensors"
    first = run.train_depth(source, LABELS_ONLY, NET)
    network.DEPTH_FILES.save(path, first, notes={})
    kept: list[float] = []

    def compare(now: Progress, net: network.DepthNet) -> None:
        del now
        pairs = zip(first.parameters(), net.parameters(), strict=True)
        kept.append(max(float((one - two).detach().abs().max()) for one, two in pairs))

    slow = replace(LABELS_ONLY, steps=1, learning_rate=1e-6, seed=7)
    run.train_depth(source, slow, NET, start=path, progress=compare)
    assert kept[0] < 1e-4


def test_weights_of_another_shape_are_refused(source: ClipSource, tmp_path: Path) -> None:
    path = tmp_path / "depth.safetensors"
    other = network.DepthNet(replace(NET, channels=(8, 12, 20)))
    network.DEPTH_FILES.save(path, other, notes={})
    with pytest.raises(WeightsError, match="another shape"):
        run.train_depth(source, LABELS_ONLY, NET, start=path)


def test_numbers_that_make_no_sense_are_refused() -> None:
    with pytest.raises(ValueRangeError):
        replace(SHORT, steps=0)


def test_predictions_are_depth_maps_at_half_the_size() -> None:
    net = network.DepthNet(NET).eval()
    pictures = np.random.default_rng(0).integers(0, 255, (2, 64, 64, 3), dtype=np.uint8)
    depth = run.predict_depth(net, pictures)
    assert depth.shape == (2, 32, 32)
    assert depth.dtype == np.float32
