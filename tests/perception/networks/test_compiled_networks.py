"""Compiled networks in the cache folder: the same answers with and without them."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from onnx import TensorProto, helper

from perception.depth.runtime import load_depth_estimator
from perception.networks import compiled_networks, onnx_runtime
from perception.networks.inference_packages import import_openvino
from perception.segmentation.runtime import shipped_unet

FRAME = np.random.default_rng(5).integers(0, 256, (360, 640, 3)).astype(np.uint8)
PIXELS = np.full((1, 8, 16, 3), 51, dtype=np.uint8)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of compiled networks, which does not exist yet."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "uav-bt" / "networks"


@pytest.fixture
def compilations(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return a list that gets an entry when OpenVINO compiles a network."""
    real, counted = import_openvino(), list[str]()

    class Core:
        def __init__(self) -> None:
            self._core = real.Core()
            self.get_property = self._core.get_property
            self.import_model = self._core.import_model

        def compile_model(self, model: Any, device: str, settings: Any) -> Any:
            counted.append(device)
            return self._core.compile_model(model, device, settings)

    openvino = SimpleNamespace(Core=Core, get_version=real.get_version)
    monkeypatch.setattr(compiled_networks, "import_openvino", lambda: openvino)
    return counted


def onnx_file(folder: Path) -> Path:
    """Write a network that returns its input."""
    shape = [1, 3, 8, 16]
    graph = helper.make_graph(
        [helper.make_node("Identity", ["x"], ["y"])],
        "net",
        [helper.make_tensor_value_info("x", TensorProto.FLOAT, shape)],
        [helper.make_tensor_value_info("y", TensorProto.FLOAT, shape)],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    path = folder / "net.onnx"
    path.write_bytes(model.SerializeToString())
    return path


def answer(path: Path, *, mean: float = 0.0, threads: int = 1) -> float:
    """Return the answer of a network of `onnx_file` for a pixel of 51: (51 - mean) / 255."""
    model = onnx_runtime.accept_uint8(
        onnx_runtime.read_model(path, "a test"), mean=(mean, mean, mean)
    )
    return float(onnx_runtime.compile_model(model, threads, path)(PIXELS)[0][0, 0, 0, 0])


def test_the_second_start_reads_what_the_first_has_compiled(
    tmp_path: Path, folder: Path, compilations: list[str]
) -> None:
    path = onnx_file(tmp_path)
    assert answer(path) == pytest.approx(0.2)
    assert len(list(folder.iterdir())) == len(compilations) == 1
    assert answer(path) == pytest.approx(0.2)
    assert len(compilations) == 1


@pytest.mark.parametrize(
    "infer",
    [lambda: shipped_unet().ids(FRAME), lambda: load_depth_estimator("depth").depth(FRAME)],
    ids=["segmentation", "depth"],
)
def test_shipped_networks_answer_the_same_with_and_without_the_cache(
    infer: Callable[[], NDArray[Any]], tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiled, read = infer(), infer()
    assert len(list(folder.iterdir())) == 1
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    without_cache = infer()
    assert compiled.tobytes() == read.tobytes() == without_cache.tobytes()


@pytest.mark.parametrize(
    "damage",
    [
        lambda content: content[:0],
        lambda content: content[: len(content) // 2],
        lambda content: content[:-1] + bytes([content[-1] ^ 1]),
        lambda content: content[32:],
        lambda _: hashlib.sha256(b"else").digest() + b"else",
    ],
    ids=["empty", "half", "one bit", "without its digest", "something else"],
)
def test_a_damaged_file_is_compiled_and_written_again(
    damage: Callable[[bytes], bytes], tmp_path: Path, folder: Path, compilations: list[str]
) -> None:
    path = onnx_file(tmp_path)
    answer(path)
    (file,) = folder.iterdir()
    whole = file.read_bytes()
    file.write_bytes(damage(whole))
    assert answer(path) == pytest.approx(0.2)
    assert len(compilations) == 2
    answer(path)
    assert len(compilations) == 2


def test_a_folder_that_cannot_be_used_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    path = onnx_file(tmp_path)
    for unusable in ("/proc", str(path), "/dev/null/cache"):
        monkeypatch.setenv("XDG_CACHE_HOME", unusable)
        assert answer(path) == pytest.approx(0.2)
    assert capfd.readouterr() == ("", "")


def test_a_relative_or_unset_cache_folder_is_the_one_in_the_home_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = onnx_file(tmp_path)
    for name, value in (("one", None), ("two", "cache")):
        monkeypatch.setenv("HOME", str(tmp_path / name))
        monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
        if value is not None:
            monkeypatch.setenv("XDG_CACHE_HOME", value)
        answer(path)
        assert len(list((tmp_path / name / ".cache" / "uav-bt" / "networks").iterdir())) == 1


def test_each_preparation_and_setting_has_its_own_file(tmp_path: Path, folder: Path) -> None:
    path = onnx_file(tmp_path)
    for _ in range(2):
        assert answer(path) == pytest.approx(51 / 255)
        assert answer(path, mean=25.5) == pytest.approx(25.5 / 255)
        assert answer(path, threads=2) == pytest.approx(51 / 255)
    assert len(list(folder.iterdir())) == 3


def test_another_processor_or_version_compiles_again(
    tmp_path: Path, folder: Path, compilations: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = onnx_file(tmp_path)
    answer(path)
    with monkeypatch.context() as machine:
        machine.setattr(compiled_networks, "instruction_sets", lambda: ("flags : sse2",))
        answer(path)
    openvino = vars(compiled_networks)["import_openvino"]()
    monkeypatch.setattr(openvino, "get_version", lambda: "2031.0.0")
    answer(path)
    assert len(list(folder.iterdir())) == len(compilations) == 3


def test_the_oldest_files_are_deleted(tmp_path: Path, folder: Path) -> None:
    folder.mkdir(parents=True)
    for age_s in range(30):
        old = folder / f"old-{age_s}.blob"
        old.touch()
        os.utime(old, (1e9 - age_s, 1e9 - age_s))
    answer(onnx_file(tmp_path))
    kept = {file.name for file in folder.iterdir()}
    assert len(kept) == 24
    assert "old-22.blob" in kept
    assert "old-23.blob" not in kept
