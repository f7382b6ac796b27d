"""Compiled networks in the cache folder: the same answers with and without them."""

import hashlib
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from perception.depth.runtime import load_depth_estimator
from perception.networks import inference_packages as compiled_networks
from perception.networks.inference_packages import import_openvino
from perception.networks.mapping import InputFormat
from perception.networks.onnx_runtime import OnnxNetwork
from perception.segmentation.runtime import shipped_unet
from tests.perception.networks.small_networks import save

FRAME = np.random.default_rng(5).integers(0, 256, (360, 640, 3)).astype(np.uint8)
PIXELS = np.full((8, 16, 3), 51, dtype=np.uint8)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of compiled networks, which does not exist yet."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "uav-bt" / "networks"


@pytest.fixture
def compilations(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return a list that gets an entry when OpenVINO compiles a network."""
    real, counted = import_openvino(), list[str]()

    class Core(real.Core):
        def compile_model(self, model: Any, device: str, settings: Any) -> Any:
            counted.append(device)
            return super().compile_model(model, device, settings)

    openvino = SimpleNamespace(Core=Core, get_version=real.get_version)
    monkeypatch.setattr(compiled_networks, "import_openvino", lambda: openvino)
    return counted


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Return a network that gives its input."""
    return save(tmp_path / "net.onnx", "y = Identity(x)")


def answer(path: Path, *, mean: float = 0.0, threads: int = 1) -> float:
    """Return the answer of a network of `path` for a pixel of 51: (51 - mean) / 255."""
    network = OnnxNetwork(path, "a test")
    network.take_images(InputFormat(mean=(mean, mean, mean)))
    network.compile([network.outputs()["y"]], threads)
    return float(network.run(PIXELS)[0][0, 0, 0, 0])


@pytest.mark.parametrize("kind", ["segmentation", "depth"])
def test_shipped_networks_answer_the_same_with_and_without_the_cache(
    kind: str, tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def infer() -> bytes:
        depth = kind == "depth"
        made = load_depth_estimator("depth").depth(FRAME) if depth else shipped_unet().ids(FRAME)
        return made.tobytes()

    compiled, read = infer(), infer()
    assert len(list(folder.iterdir())) == 1
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert compiled == read == infer()


def test_a_damaged_file_is_made_again(path: Path, folder: Path, compilations: list[str]) -> None:
    """Empty, one bit, without its digest, something else."""
    assert answer(path) == pytest.approx(0.2)
    (file,) = folder.iterdir()
    whole = file.read_bytes()
    other = hashlib.sha256(b"else").digest() + b"else"
    for damaged in (b"", whole[:-1] + bytes([whole[-1] ^ 1]), whole[32:], other):
        file.write_bytes(damaged)
        compilations.clear()
        assert answer(path) == answer(path) == pytest.approx(0.2)
        assert len(compilations) == 1


def test_a_folder_that_cannot_be_used_changes_nothing_and_home_has_the_default(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    home = tmp_path / ".cache" / "uav-bt" / "networks"
    for unusable in ("/proc", str(path), "/dev/null/cache"):
        monkeypatch.setenv("XDG_CACHE_HOME", unusable)
        assert answer(path) == pytest.approx(0.2)
    assert capfd.readouterr() == ("", "")
    assert not home.exists()
    for index, relative in enumerate(("", "cache")):
        monkeypatch.setenv("XDG_CACHE_HOME", relative)
        answer(path, mean=float(index))
        assert len(list(home.iterdir())) == index + 1


def test_what_a_compilation_depends_on_has_its_own_file(
    path: Path, folder: Path, compilations: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for _ in range(2):
        assert answer(path) == pytest.approx(51 / 255)
        assert answer(path, mean=25.5) == pytest.approx(25.5 / 255)
        assert answer(path, threads=2) == pytest.approx(51 / 255)
    assert len(list(folder.iterdir())) == len(compilations) == 3
    with monkeypatch.context() as machine:
        machine.setattr(compiled_networks, "instruction_sets", lambda: ("flags : sse2",))
        answer(path)
    openvino: Any = vars(compiled_networks)["import_openvino"]()
    monkeypatch.setattr(openvino, "get_version", lambda: "2031.0.0")
    answer(path)
    assert len(list(folder.iterdir())) == len(compilations) == 5


def test_the_oldest_files_are_deleted(path: Path, folder: Path) -> None:
    folder.mkdir(parents=True)
    for age_s in range(30):
        old = folder / f"old-{age_s}.blob"
        old.touch()
        os.utime(old, (1e9 - age_s, 1e9 - age_s))
    answer(path)
    kept = {file.name for file in folder.iterdir()}
    assert len(kept) == 24
    assert "old-22.blob" in kept
    assert "old-23.blob" not in kept
