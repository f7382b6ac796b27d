"""MuJoCo with an OpenGL backend that works without a display.

Modules that use MuJoCo import it from here: it reads ``MUJOCO_GL`` once, when it is imported. It
calls OpenGL through PyOpenGL, which searches for plain library names and cannot change its backend
within a process. So this module first tests a backend by opening a context through ctypes.
"""

from __future__ import annotations

import ctypes
import importlib
import importlib.util
import os
import sys
from functools import cache
from pathlib import Path
from typing import Any

from uav_bt.errors import InputError, MissingDependencyError, UnknownNameError

_ADVICE = (
    "the twin needs OpenGL to draw the camera's images, and none works on this machine. "
    "Install one of: `pip install --no-deps lavavu-osmesa` (no root needed), "
    "`apt install libegl1 libgl1` or `apt install libosmesa6`"
)
# In the order of their dependencies.
_WHEEL_LIBRARIES = (
    *("libtinfo", "libzstd", "libffi", "libpcre2-8", "libselinux", "libdrm"),
    *("libglapi", "libLLVM", "libOSMesa"),
)
_KINDS = ("egl", "osmesa", "glfw", "glx")
_OFF = ("disable", "disabled", "off", "false", "0")
_DEVICE = "MUJOCO_EGL_DEVICE_ID"  # MuJoCo's, set by clusters for each job
_drawn_in: set[int] = set()  # process ids that have opened a context; a fork inherits them
_EGL_PLATFORM_DEVICE = 0x313F
_EGL_OPENGL_API = 0x30A2
_EGL_OFFSCREEN_OPENGL = (0x3033, 0x0001, 0x3040, 0x0008, 0x3038)  # pbuffer, OpenGL, end of list


@cache
def choose_gl() -> str:
    """Select the OpenGL backend of this process, and return MuJoCo's name of it.

    ``MUJOCO_GL`` is respected if set. Otherwise the first that works is used: EGL, the OSMesa of
    the ``lavavu-osmesa`` wheel, the system's OSMesa. macOS and Windows use MuJoCo's default. Where
    none works, or ``MUJOCO_GL`` is none, the error names the remedy.
    """
    asked = os.environ.get("MUJOCO_GL", "").lower().strip()
    if asked in _OFF:
        raise MissingDependencyError(
            f"MUJOCO_GL={asked} turns drawing off, and the twin must draw; unset it"
        )
    if not sys.platform.startswith("linux"):
        return asked or ("cgl" if sys.platform == "darwin" else "glfw")
    if asked and asked not in _KINDS:
        raise UnknownNameError("MUJOCO_GL", asked, _KINDS)
    _load_triton_first()
    kind = asked or ("egl" if _egl_works() else "osmesa")
    if kind == "osmesa" and not (_preload_wheel() or _loads("libOSMesa.so", "libOSMesa.so.8")):
        was_asked = "MUJOCO_GL=osmesa, but no OSMesa was found: " if asked else ""
        raise MissingDependencyError(was_asked + _ADVICE)
    os.environ["MUJOCO_GL"] = kind
    if kind in ("egl", "osmesa"):
        os.environ["PYOPENGL_PLATFORM"] = kind
    return kind


def open_context(width_px: int, height_px: int) -> Any:
    """Return a new GL context of MuJoCo's selected backend."""
    # The threads of a driver do not survive a fork; its first call there would never return.
    if _drawn_in and os.getpid() not in _drawn_in:
        raise InputError(
            "OpenGL was used before this process was forked, and would block here; start "
            "processes with multiprocessing's 'spawn', or fly many missions by `uav-bt campaign`"
        )
    kind = choose_gl()
    module = kind if kind in ("egl", "osmesa", "cgl") else "glfw"
    try:
        # PyOpenGL raises AttributeError if a library is missing; a device variable without a
        # number is a ValueError.
        context = importlib.import_module(f"mujoco.{module}").GLContext(width_px, height_px)
    except (ImportError, AttributeError, OSError, RuntimeError, ValueError) as error:
        raise no_gl(error) from error
    _drawn_in.add(os.getpid())
    return context


def no_gl(error: Exception) -> MissingDependencyError:
    """Return the error for a failure inside OpenGL; its message names the remedy."""
    device, remedy = os.environ.get(_DEVICE), _ADVICE
    if device is not None and (isinstance(error, ValueError) or _DEVICE in str(error)):
        remedy = f"{_DEVICE}={device} names a device that this machine does not have; unset it"
    return MissingDependencyError(f"OpenGL by {choose_gl()} failed ({error}): {remedy}")


def _import_mujoco() -> Any:
    """Import MuJoCo; where no OpenGL works it computes, and `open_context` says what is missing."""
    asked = os.environ.get("MUJOCO_GL")
    try:
        choose_gl()
        return importlib.import_module("mujoco")
    except (InputError, AttributeError, ImportError, OSError, RuntimeError):
        os.environ["MUJOCO_GL"] = "disable"
    try:
        return importlib.import_module("mujoco")
    except ImportError as error:
        raise MissingDependencyError(
            f"the twin needs MuJoCo; install it with `pip install mujoco` ({error})"
        ) from error
    finally:
        if asked is None:
            del os.environ["MUJOCO_GL"]
        else:
            os.environ["MUJOCO_GL"] = asked


def _load_triton_first() -> None:
    """Load Triton's library, part of GPU builds of PyTorch, before Mesa's.

    Each contains a separate LLVM. A process that loads Triton's second, because it draws and then
    trains, crashes when PyTorch imports Triton.
    """
    spec = importlib.util.find_spec("triton")
    if spec is not None and spec.origin is not None:
        _loads(str(Path(spec.origin).parent / "_C" / "libtriton.so"), mode=ctypes.RTLD_LOCAL)


def _loads(*names: str, mode: int = ctypes.RTLD_GLOBAL) -> bool:
    for name in names:
        try:
            ctypes.CDLL(name, mode)
        except OSError:
            continue
        return True
    return False


def _egl_works() -> bool:
    """Open and close a context on the first EGL device, as MuJoCo does."""
    if not (_loads("libGL.so.1", "libGL.so") and _loads("libEGL.so.1")):
        return False
    egl, pointer = ctypes.CDLL("libEGL.so.1", ctypes.RTLD_GLOBAL), ctypes.c_void_p
    egl.eglGetProcAddress.restype = pointer
    query = egl.eglGetProcAddress(b"eglQueryDevicesEXT")
    get_display = egl.eglGetProcAddress(b"eglGetPlatformDisplayEXT")
    if not query or not get_display:
        return False
    count = ctypes.c_int(0)
    devices = (pointer * 16)()
    query_devices = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_int, pointer, pointer)(query)
    if not query_devices(16, ctypes.addressof(devices), ctypes.addressof(count)):
        return False
    open_display = ctypes.CFUNCTYPE(pointer, ctypes.c_uint, pointer, pointer)(get_display)
    displays = (open_display(_EGL_PLATFORM_DEVICE, d, None) for d in devices[: count.value])
    return any(_display_works(egl, display) for display in displays if display)


def _display_works(egl: ctypes.CDLL, display: int) -> bool:
    pointer = ctypes.c_void_p
    shown = pointer(display)
    if not egl.eglInitialize(shown, None, None):
        return False
    try:
        wanted = (ctypes.c_int * len(_EGL_OFFSCREEN_OPENGL))(*_EGL_OFFSCREEN_OPENGL)
        config, found = pointer(), ctypes.c_int(0)
        egl.eglChooseConfig(shown, wanted, ctypes.byref(config), 1, ctypes.byref(found))
        if found.value < 1 or not egl.eglBindAPI(_EGL_OPENGL_API):
            return False
        egl.eglCreateContext.restype = pointer
        context = egl.eglCreateContext(shown, config, None, None)
        if not context:
            return False
        egl.eglDestroyContext(shown, pointer(context))
        return True
    finally:
        egl.eglTerminate(shown)


def _preload_wheel() -> bool:
    """Load the libraries of ``lavavu-osmesa`` by path, and give PyOpenGL the path of its OSMesa.

    The wheel's libraries contain no search path, so each must be loaded before those that need it.
    PyOpenGL would still search for plain ``libOSMesa.so``.
    """
    folders = [Path(entry or ".") / "lavavu_osmesa.libs" for entry in sys.path]
    folder = next((each for each in folders if any(each.glob("libOSMesa-*"))), None)
    if folder is None:
        return False
    libraries = [path for stem in _WHEEL_LIBRARIES for path in sorted(folder.glob(f"{stem}-*"))]
    for path in libraries:
        try:
            ctypes.CDLL(str(path), ctypes.RTLD_GLOBAL)
        except OSError as error:
            raise MissingDependencyError(
                f"{path.name} of lavavu-osmesa cannot be loaded ({error}): {_ADVICE}"
            ) from error
    _show_pyopengl(libraries[-1])
    return True


def _show_pyopengl(osmesa: Path) -> None:
    """Make PyOpenGL's loader return the wheel's library for OSMesa.

    PyOpenGL loads its libraries while `OpenGL.platform` is imported, so the loader module is
    replaced before that.
    """
    package = importlib.util.find_spec("OpenGL")
    if package is None or not package.submodule_search_locations:
        raise MissingDependencyError(
            "the twin needs PyOpenGL; install it with `pip install PyOpenGL`"
        )
    name = "OpenGL.platform.ctypesloader"
    file = Path(package.submodule_search_locations[0]) / "platform" / "ctypesloader.py"
    spec = importlib.util.spec_from_file_location(name, file)
    if name in sys.modules or spec is None or spec.loader is None:
        raise MissingDependencyError(
            "PyOpenGL was imported before the twin, or its version is unknown to the twin; make "
            f"the drone first, or set MUJOCO_GL. {_ADVICE}"
        )
    loader: Any = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loader)
    find_as_usual = loader.loadLibrary

    def load_library(kind: Any, library: str, mode: int = ctypes.RTLD_GLOBAL) -> Any:
        if library == "OSMesa":
            return ctypes.CDLL(str(osmesa), mode)
        return find_as_usual(kind, library, mode)

    loader.loadLibrary = load_library
    sys.modules[name] = loader


mujoco: Any = _import_mujoco()
