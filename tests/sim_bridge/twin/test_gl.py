"""Choice of OpenGL: made once, from the working backends; errors name a remedy."""

from __future__ import annotations

import _ctypes
import os
import shutil
import subprocess
import sys
from importlib.machinery import ModuleSpec
from pathlib import Path
from unittest.mock import Mock

import pytest

from sim_bridge.twin import gl
from uav_bt.errors import InputError, MissingDependencyError, UnknownNameError


@pytest.fixture(autouse=True)
def _another_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setenv("PYOPENGL_PLATFORM", "")
    monkeypatch.setattr(gl.sys, "platform", "linux")
    monkeypatch.setattr(gl, "choose_gl", gl.choose_gl.__wrapped__)  # without this one's choice


@pytest.mark.parametrize(("egl", "kind"), [(True, "egl"), (False, "osmesa")])
def test_egl_is_taken_where_it_works_and_osmesa_elsewhere(
    monkeypatch: pytest.MonkeyPatch, kind: str, *, egl: bool
) -> None:
    """MuJoCo and PyOpenGL are configured for it."""
    monkeypatch.setattr(gl, "_egl_works", lambda: egl)
    monkeypatch.setattr(gl, "_preload_wheel", lambda: True)
    assert gl.choose_gl() == kind
    assert os.environ["MUJOCO_GL"] == os.environ["PYOPENGL_PLATFORM"] == kind


@pytest.mark.parametrize(
    ("asked", "error", "message"),
    [
        ("", MissingDependencyError, "pip install --no-deps lavavu-osmesa.*apt install libegl1"),
        ("osmesa", MissingDependencyError, "no OSMesa was found"),
        ("off", MissingDependencyError, "unset it"),
        ("eggl", UnknownNameError, "did you mean 'egl'"),
    ],
)
def test_what_does_not_work_or_is_not_meant_is_refused(
    monkeypatch: pytest.MonkeyPatch, asked: str, error: type[Exception], message: str
) -> None:
    """A requested backend is not replaced by another."""
    monkeypatch.setenv("MUJOCO_GL", asked)
    monkeypatch.setattr(gl, "_loads", lambda *_, **__: False)
    monkeypatch.setattr(gl, "_preload_wheel", lambda: False)
    with pytest.raises(error, match=message):
        gl.choose_gl()
    assert os.environ["MUJOCO_GL"] == asked


@pytest.mark.parametrize(
    ("error", "remedy"),
    [
        (AttributeError("'NoneType' has no attribute 'eglQueryString'"), "OpenGL.*Install one of"),
        (RuntimeError("MUJOCO_EGL_DEVICE_ID must be an integer between"), "=7 names a device"),
        (ValueError("invalid literal for int() with base 10: 'gpu'"), "=7 names a device"),
    ],
)
def test_a_failure_inside_opengl_names_its_remedy(
    monkeypatch: pytest.MonkeyPatch, error: Exception, remedy: str
) -> None:
    monkeypatch.setenv("MUJOCO_EGL_DEVICE_ID", "7")
    monkeypatch.setattr(gl, "choose_gl", lambda: "egl")
    monkeypatch.setattr(gl.importlib, "import_module", Mock(side_effect=error))
    with pytest.raises(MissingDependencyError, match=remedy):
        gl.open_context(64, 64)


def test_a_fork_of_a_process_that_has_drawn_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """It would wait for ever for the driver's threads."""
    monkeypatch.setattr(gl, "_drawn_in", {os.getpid() + 1})
    with pytest.raises(InputError, match=r"before this process was forked.*'spawn'"):
        gl.open_context(64, 64)


def test_the_llvm_of_triton_is_loaded_before_that_of_mesa(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    library = tmp_path / "triton" / "_C" / "libtriton.so"
    library.parent.mkdir(parents=True)
    shutil.copy(_ctypes.__file__, library)  # any shared library
    triton = ModuleSpec("triton", None, origin=str(tmp_path / "triton" / "__init__.py"))
    monkeypatch.setattr(gl.importlib.util, "find_spec", {"triton": triton}.get)
    monkeypatch.setattr(
        gl, "_egl_works", lambda: str(library) in Path("/proc/self/maps").read_text()
    )
    monkeypatch.setattr(gl, "_preload_wheel", lambda: False)
    assert gl.choose_gl() == "egl"


@pytest.mark.flight
def test_a_plain_drone_flies_without_opengl_and_a_twin_draws_afterwards() -> None:
    """MuJoCo is imported without drawing where no OpenGL works; the package imports none of it."""
    code = """
import os, sys, sim_bridge.twin
print([name for name in ("mujoco", "cv2", "yaml", "OpenGL") if name in sys.modules])
from uav_bt import app
print(app.fly("land_only", drone="plain", scene="depot-train-c", seed=3).outcome)
print(sorted({"OpenGL", "glfw"} & set(sys.modules)), os.environ.pop("MUJOCO_GL"))
drone = sim_bridge.twin.TwinConfig(profile="ideal", image_size_px=(64, 36)).create()
drone.connect()
print(drone.observe().frame.image.std() > 1)
drone.disconnect()
"""
    told = subprocess.check_output(  # noqa: S603  (code of this test)
        [sys.executable, "-c", code],
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "MUJOCO_GL": "disable"},
    )
    assert told == "[]\nsuccess\n[] disable\nTrue\n"
