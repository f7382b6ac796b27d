"""Choice of OpenGL: made once, from the working backends; errors name a remedy."""

from __future__ import annotations

import _ctypes
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from sim_bridge.twin import gl
from uav_bt.errors import InputError, MissingDependencyError, UnknownNameError


@pytest.fixture(autouse=True)
def _fresh(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(gl.sys, "platform", "linux")


def choose() -> str:
    """Choose as in a new process, ignoring the choice of this one."""
    return gl.choose_gl.__wrapped__()


def test_egl_is_taken_where_it_works(monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo and PyOpenGL are configured for it."""
    monkeypatch.setenv("PYOPENGL_PLATFORM", "")
    monkeypatch.setattr(gl, "_egl_works", lambda: True)
    assert choose() == "egl"
    assert os.environ["MUJOCO_GL"] == os.environ["PYOPENGL_PLATFORM"] == "egl"


def test_without_egl_osmesa_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """The wheel's library is preloaded."""
    monkeypatch.setenv("PYOPENGL_PLATFORM", "")
    monkeypatch.setattr(gl, "_egl_works", lambda: False)
    monkeypatch.setattr(gl, "_loads", lambda *_, **__: True)
    monkeypatch.setattr(gl, "_preload_wheel", lambda: True)
    assert choose() == "osmesa"
    assert os.environ["MUJOCO_GL"] == "osmesa"


def test_with_nothing_the_message_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    """The message names both remedies: pip and apt."""
    monkeypatch.setattr(gl, "_loads", lambda *_, **__: False)
    monkeypatch.setattr(gl, "_wheel_folder", lambda: None)
    with pytest.raises(MissingDependencyError, match="pip install --no-deps lavavu-osmesa") as seen:
        choose()
    assert "apt install libegl1 libgl1" in str(seen.value)
    assert "MUJOCO_GL" not in os.environ


def test_asking_for_osmesa_without_it_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """A requested backend is not replaced by another."""
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    monkeypatch.setattr(gl, "_loads", lambda *_, **__: False)
    monkeypatch.setattr(gl, "_wheel_folder", lambda: None)
    with pytest.raises(MissingDependencyError, match="no OSMesa was found"):
        choose()


def test_drawing_turned_off_and_unknown_ways_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """`MUJOCO_GL=off` and a misspelt value have different errors."""
    monkeypatch.setenv("MUJOCO_GL", "off")
    with pytest.raises(MissingDependencyError, match="unset it"):
        choose()
    monkeypatch.setenv("MUJOCO_GL", "eggl")
    with pytest.raises(UnknownNameError, match="did you mean 'egl'"):
        choose()


def test_a_failure_inside_opengl_is_translated(monkeypatch: pytest.MonkeyPatch) -> None:
    """PyOpenGL's AttributeError without libraries becomes an error with a remedy."""

    def broken(_: str) -> None:
        raise AttributeError("'NoneType' object has no attribute 'eglQueryString'")

    monkeypatch.setattr(gl, "choose_gl", lambda: "egl")
    monkeypatch.setattr(gl.importlib, "import_module", broken)
    for use in (gl.load_mujoco, lambda: gl.open_context(64, 64)):
        with pytest.raises(MissingDependencyError, match=r"eglQueryString.*Install one of"):
            use()


@pytest.mark.parametrize(
    "error",
    [
        RuntimeError("The MUJOCO_EGL_DEVICE_ID environment variable must be an integer between"),
        ValueError("invalid literal for int() with base 10: 'gpu'"),
    ],
)
def test_a_device_of_another_machine_names_its_variable(
    monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    """EGL works: nothing is to be installed."""
    monkeypatch.setenv("MUJOCO_EGL_DEVICE_ID", "7")
    monkeypatch.setattr(gl, "choose_gl", lambda: "egl")
    message = str(gl.no_gl(error))
    assert "MUJOCO_EGL_DEVICE_ID=7 names a device that this machine does not have" in message
    assert "Install" not in message
    assert "Install" in str(gl.no_gl(RuntimeError("no display")))


def test_a_fork_of_a_process_that_has_drawn_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """It would wait for ever for the driver's threads."""
    parent = os.getpid() + 1
    monkeypatch.setattr(gl, "_drawn_in", {parent})
    with pytest.raises(InputError, match=r"before this process was forked.*'spawn'"):
        gl.open_context(64, 64)


def test_the_llvm_of_triton_is_loaded_before_that_of_mesa(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    library = tmp_path / "triton" / "_C" / "libtriton.so"
    library.parent.mkdir(parents=True)
    shutil.copy(_ctypes.__file__, library)  # any shared library
    (tmp_path / "triton" / "__init__.py").touch()
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "triton", raising=False)  # the real one of PyTorch
    monkeypatch.setenv("PYOPENGL_PLATFORM", "")
    mapped = []
    monkeypatch.setattr(
        gl, "_egl_works", lambda: mapped.append(Path("/proc/self/maps").read_text()) or True
    )
    choose()
    assert str(library) in mapped[0]


def test_importing_the_package_is_light() -> None:
    """The package imports neither MuJoCo nor OpenCV nor YAML."""
    code = (
        "import sys, sim_bridge.twin; "
        "print([m for m in ('mujoco', 'cv2', 'yaml', 'OpenGL') if m in sys.modules])"
    )
    done = subprocess.run(  # noqa: S603  (code of this test)
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert done.stdout.strip() == "[]"
