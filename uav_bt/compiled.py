"""Compilation of loops over arrays to machine code by Numba.

A kernel is compiled for one signature when its module is imported, so nothing is compiled in
flight. Numba keeps the machine code beside the module, or in the user's cache folder
(`NUMBA_CACHE_DIR`, by default `~/.cache/numba`) where the module's folder is read-only. A change of
the source, of Numba or of the processor compiles the kernel again. Kernels use IEEE arithmetic
without reassociation, so that results do not depend on the cache.

`python -m uav_bt.compiled` compiles all kernels, for example after an installation.
"""

from __future__ import annotations

import functools
import importlib
import logging
import pkgutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, ParamSpec, TypeVar, cast

import numba

Given = ParamSpec("Given")
Result = TypeVar("Result")

_ROOMS: Final = ("perception", "sim_bridge", "behaviours")
_log = logging.getLogger(__name__)


def compiled(signature: str) -> Callable[[Callable[Given, Result]], Callable[Given, Result]]:
    """Return a decorator that compiles a function to machine code.

    The function runs without the interpreter lock. Division by zero gives infinity or NaN. The
    signature has the types of the result and of the arguments, in Numba's notation, such as
    `float64(float64[:, ::1], int64)`. `::1` marks an array that is contiguous in C order.
    """

    def decorate(function: Callable[Given, Result]) -> Callable[Given, Result]:
        options: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
        try:
            kernel = numba.njit(cache=True, **options)(function)
            kernel.compile(signature)
            if kernel.stats.cache_misses:
                _say("compiling for this machine; this takes half a minute, once")
        except RuntimeError as error:
            if "cannot cache" not in str(error):
                raise
            _say(
                "compiled code cannot be kept, because neither the installation nor the cache "
                "folder can be written: every start compiles for half a minute; set "
                "NUMBA_CACHE_DIR to a folder that can be written"
            )
            kernel = numba.njit(**options)(function)
            kernel.compile(signature)
        kernel.disable_compile()
        return cast("Callable[Given, Result]", kernel)

    return decorate


@functools.cache  # each message is shown once in a process
def _say(message: str) -> None:
    _log.warning(message)


def compile_all() -> None:
    """Import all modules with kernels, which compiles those that are not in the cache."""
    for room in _ROOMS:
        folder = importlib.import_module(room).__path__
        for module in pkgutil.walk_packages(folder, f"{room}."):
            file = Path(folder[0]).parent / (module.name.replace(".", "/") + ".py")
            if file.is_file() and "from uav_bt.compiled import" in file.read_text(encoding="utf-8"):
                importlib.import_module(module.name)


if __name__ == "__main__":
    compile_all()
