"""Short training of the depth network from a record."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from perception.depth.runtime import load_depth_estimator
from sim_bridge.anafi import anafi_camera
from tests.paper_lab import paper_map
from tests.worlds.footage import frame, state, write_record
from uav_bt.cli.root import uav_bt
from uav_bt.learning.dataset import read_flights
from uav_bt.types import ClassMap, Frame

COUNT = 6


@pytest.fixture
def film(tmp_path: Path) -> Path:
    """Return a record of stripes, which is quick to make."""
    frames = []
    for place in range(COUNT):
        image = np.zeros((180, 320, 3), np.uint8)
        image[:, 4 * place :: 16] = 200
        frames.append(frame(image, place, 0.1 * place))
    states = [state(one.captured_s) for one in frames]
    return write_record(tmp_path / "stripes.mcap", anafi_camera(320, 180), frames, states)


class _Ground:
    """A segmenter that returns ground below the top rows, and counts its calls."""

    def __init__(self) -> None:
        self.asked = 0

    def segment(self, frame: Frame) -> ClassMap:
        self.asked += 1
        ids = np.zeros((112, 224), np.uint8)
        ids[40:] = 1
        return paper_map(ids=ids, captured_s=frame.captured_s)


def test_labels_are_made_once_and_kept(film: Path, tmp_path: Path) -> None:
    segmenter = _Ground()
    (first,) = read_flights([film], segmenter, tmp_path / "run")
    (again,) = read_flights([film], segmenter, tmp_path / "run")
    assert segmenter.asked == COUNT
    assert first.labels is not None
    assert again.labels is not None
    np.testing.assert_array_equal(first.labels, again.labels)
    assert np.isfinite(first.labels[::3, 0, 100]).all()
    assert read_flights([film], None, tmp_path)[0].labels is None


def test_the_command_trains_on_a_record(film: Path, tmp_path: Path) -> None:
    out = tmp_path / "mine.safetensors"
    result = CliRunner().invoke(
        uav_bt,
        [
            *("net", "train", "depth", str(film), "--out", str(out)),
            *("--run", str(tmp_path / "run")),
            *("--labels", "contact", "--no-photometric", "--steps", "1"),
        ],
    )
    assert result.exit_code == 0, result.output
    assert f"depth network: {out} and {out.with_suffix('.onnx')}" in result.output
    estimator = load_depth_estimator(out.with_suffix(".onnx"))
    assert estimator.depth(np.zeros((360, 640, 3), np.uint8)).shape == (128, 160)
