"""Short texts of objects: `__repr__ = brief_repr` in the body of a dataclass."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import MISSING, fields
from typing import Any

import numpy as np


def brief_repr(value: Any) -> str:
    """Return a dataclass object as the code that creates it, without default values."""
    return f"{type(value).__qualname__}({', '.join(_given(value))})"


def _given(value: Any) -> Iterator[str]:
    for each in fields(value):
        default = each.default if each.default_factory is MISSING else each.default_factory()
        here = getattr(value, each.name)
        if default is MISSING or here != default:
            yield f"{each.name}={here!r}"


def shapes_repr(value: Any) -> str:
    """Return the fields of a dataclass object, arrays only by shape and type."""
    shown = (f"{each.name}={_shape(getattr(value, each.name))}" for each in fields(value))
    return f"{type(value).__qualname__}({', '.join(shown)})"


def _shape(value: object) -> str:
    if isinstance(value, np.ndarray):
        return f"<{'x'.join(map(str, value.shape))} {value.dtype}>"
    return repr(value)
