"""Short texts of objects: `__repr__ = brief_repr` in the body of a dataclass."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import MISSING, fields
from typing import Any

import numpy as np


def brief_repr(value: Any) -> str:
    """Return a dataclass object as the code that creates it, without default values.

    Arrays are shown by shape and type.
    """
    return f"{type(value).__qualname__}({', '.join(_given(value))})"


def _given(value: Any) -> Iterator[str]:
    for each in fields(value):
        default = each.default if each.default_factory is MISSING else each.default_factory()
        here = getattr(value, each.name)
        if isinstance(here, np.ndarray):
            yield f"{each.name}=<{'x'.join(map(str, here.shape))} {here.dtype}>"
        elif default is MISSING or here != default:
            yield f"{each.name}={here!r}"
