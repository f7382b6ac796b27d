"""Compilation of loops over arrays to machine code by Numba.

A kernel is compiled for one signature when its module is imported, so nothing is compiled in
flight. Numba keeps the machine code beside the module, or in the user's cache folder
(`NUMBA_CACHE_DIR`, by default `~/.cache/numba`) where the module's folder is read-only. A change of
the source, of Numba or of the processor compiles the kernel again. Kernels use IEEE arithmetic
without reassociation, so that results do not depend on the cache.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, cast

import numba

Given = ParamSpec("Given")
Result = TypeVar("Result")


def compiled(signature: str) -> Callable[[Callable[Given, Result]], Callable[Given, Result]]:
    """Return a decorator that compiles a function to machine code.

    The function runs without the interpreter lock. Division by zero gives infinity or NaN.

    Args:
        signature: types of the result and of the arguments, in Numba's notation, such as
            `float64(float64[:, ::1], int64)`. `::1` marks an array that is contiguous in C order.
    """

    def decorate(function: Callable[Given, Result]) -> Callable[Given, Result]:
        options: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
        try:
            kernel = numba.njit(signature, cache=True, **options)(function)
        except RuntimeError as error:
            if "cannot cache" not in str(error):
                raise
            warnings.warn(
                "compiled code cannot be kept: neither the installation nor the cache folder can "
                "be written, so every start compiles again; set NUMBA_CACHE_DIR to a folder that "
                "can be written",
                RuntimeWarning,
                stacklevel=2,
            )
            kernel = numba.njit(signature, **options)(function)
        return cast("Callable[Given, Result]", kernel)

    return decorate
