"""Networks that fly: the inference runtime and its compiled files."""

import hashlib
import itertools
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from perception.depth.runtime import load_depth_estimator
from perception.networks import inference_packages
from perception.networks import inference_packages as compiled_networks
from perception.networks.inference_packages import import_openvino
from perception.networks.mapping import InputFormat
from perception.networks.onnx_runtime import OnnxNetwork, shrunk
from perception.segmentation.runtime import shipped_unet
from tests.perception.networks.small_networks import save
from tests.worlds.tables import cases
from uav_bt.errors import AnswerError, ValueRangeError, WeightsError

SAME = "y = Identity(x)"


def network(path: Path, wanted: InputFormat | None = None, class_axis: Any = None) -> OnnxNetwork:
    made = OnnxNetwork(path, "a test")
    made.take_images(wanted or InputFormat())
    made.compile(list(made.outputs().values()), 1, class_axis=class_axis)
    return made


def test_colours_come_as_the_network_wants_them(tmp_path: Path) -> None:
    path = save(tmp_path / "n.onnx", SAME)
    changed = InputFormat(mean=(10, 0, 0), scale=(2, 1, 4), colours="bgr")
    for wanted, seen in (
        (InputFormat(), [30 / 255, 40 / 255, 50 / 255]),
        (changed, [12.5, 40.0, 10.0]),
    ):
        (given,) = network(path, wanted).run(np.full((8, 16, 3), (30, 40, 50), dtype=np.uint8))
        np.testing.assert_allclose(given[0, :, 2, 5], seen, rtol=1e-6)


def test_other_types_layouts_and_open_sizes_are_taken(tmp_path: Path) -> None:
    # A network of whole numbers scales inside; divided by 255 before, every image would be black.
    path = save(tmp_path / "n.onnx", "y = Cast <to=1> (x)", "uint8[1,3,8,16]")
    (given,) = network(path).run(np.full((8, 16, 3), 51, np.uint8))
    assert (given == 51.0).all()
    path = save(tmp_path / "n.onnx", SAME, "float[1,8,16,3]", "float[1,8,16,3]")
    rgb = np.full((8, 16, 3), (0, 51, 255), dtype=np.uint8)
    (given,) = network(path, InputFormat(layout="nhwc")).run(rgb)
    np.testing.assert_allclose(given[0, 2, 5], [0.0, 0.2, 1.0], rtol=1e-6)
    path = save(tmp_path / "n.onnx", SAME, "float[n,3,h,w]", "float[n,3,h,w]")
    assert network(path, InputFormat(size=(16, 8))).size_px == (16, 8)


@pytest.mark.parametrize(("shape", "wanted", "message"), cases("perception")["network_inputs"])
def test_another_input_is_refused(tmp_path: Path, shape: str, wanted: dict, message: str) -> None:
    path = save(tmp_path / "n.onnx", SAME, f"float[{shape}]", f"float[{shape}]")
    with pytest.raises(WeightsError, match=message):
        network(path, InputFormat(**wanted))


def test_what_the_runtime_cannot_run_is_refused_in_one_line(tmp_path: Path) -> None:
    """OpenVINO has no plan for the largest index as a truth value."""
    nodes = "a = ArgMax <axis=1, keepdims=1> (x) y = Cast <to=9> (a)"
    path = save(tmp_path / "n.onnx", nodes, given="bool[1,1,8,16]")
    with pytest.raises(WeightsError, match="OpenVINO cannot run this network") as refused:
        network(path)
    assert "\n" not in str(refused.value)
    with pytest.raises(ValueRangeError, match="at least one thread"):
        OnnxNetwork(path, "a test").compile([], 0)


def test_the_best_class_is_the_one_numpy_finds(tmp_path: Path) -> None:
    """The first of equal ones."""
    path = save(tmp_path / "n.onnx", SAME)
    rgb = np.random.default_rng(0).integers(0, 4, (8, 16, 3), dtype=np.uint8)
    for axis in (1, 3):
        (numbers,) = network(path, class_axis=axis).run(rgb)
        exact = rgb.transpose(2, 0, 1)[None].argmax(axis=axis)
        np.testing.assert_array_equal(numbers[:, 0], exact)


def test_one_number_that_is_infinite_or_none_is_found(tmp_path: Path) -> None:
    bad = ("y = Log(x)", "s = Sub(x, one) y = Sqrt(s)")
    for nodes, axis in itertools.product(bad, (None, 1)):
        path = save(tmp_path / "n.onnx", nodes, constants="float one = {0.002}")
        made, rgb = network(path, class_axis=axis), np.full((8, 16, 3), 90, dtype=np.uint8)
        made.run(rgb)
        rgb[3, 5, 1] = 0  # one score of one pixel, and not its best
        with pytest.raises(AnswerError, match="NaN or infinity"):
            made.run(rgb)


@pytest.mark.parametrize("size", [(224, 112), (320, 256), (256, 256), (160, 96), (500, 300)])
def test_a_smaller_image_has_the_means_of_what_it_covers(size: tuple[int, int]) -> None:
    """Sharp borders and noise, as a rendered box against a wall has."""
    rng = np.random.default_rng(1)
    rgb = np.full((360, 640, 3), 90, dtype=np.uint8)
    rgb[100:300, 200:420] = (200, 120, 40)
    rgb[150:170] = 20
    rgb = np.clip(rgb + rng.normal(0.0, 5.0, rgb.shape), 0, 255).astype(np.uint8)
    exact = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA).astype(int)
    assert np.abs(shrunk(rgb, size) - exact).mean() < 1.0
    # Images of the size stay, and small ones become larger.
    assert shrunk(rgb, (640, 360)) is rgb
    larger = shrunk(np.full((9, 16, 3), 77, dtype=np.uint8), size)
    assert larger.shape == (size[1], size[0], 3)
    assert (larger == 77).all()


# --- compiled networks in the cache folder --------------------------------------------------------

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


# --- the processor's instructions that inference leaves out ---------------------------------------

WITH_TILES = "flags\t\t: fpu avx2 avx512_vnni amx_bf16 amx_tile amx_int8\n"


def test_tile_instructions_are_left_out_where_they_are_announced(tmp_path: Path) -> None:
    path = tmp_path / "cpuinfo"
    for info, before, added in (
        (None, {}, {}),
        (WITH_TILES, {}, {"ONEDNN_MAX_CPU_ISA": "AVX512_CORE_FP16"}),
        # With a cap, a processor that has VNNI but no AVX-512 would lose it.
        ("flags\t\t: fpu avx2 avx_vnni\n", {}, {}),
        ("Features : asimd\n", {}, {}),
        (WITH_TILES, {"ONEDNN_MAX_CPU_ISA": "AVX2"}, {}),
        (WITH_TILES, {"DNNL_MAX_CPU_ISA": "AVX2"}, {}),
    ):
        if info is not None:
            path.write_text(info, encoding="utf-8")
        environment = dict(before)
        inference_packages._spare_amx(environment, path)
        assert environment == {**before, **added}
