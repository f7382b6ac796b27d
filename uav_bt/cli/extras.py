"""Packages that only some commands need, and the extra that installs each."""

from __future__ import annotations

from typing import Final

from uav_bt.errors import MissingDependencyError

_EXTRAS: Final = {
    "distributed": "dask",
    "foxglove": "record",
    "jinja2": "campaign",
    "joblib": "campaign",
    "matplotlib": "campaign",
    "mcap": "record",
    "onnx": "train",
    "rerun": "view",
    "torch": "train",
}


def missing_extra(error: ModuleNotFoundError) -> Exception:
    """Return the error about the extra that installs a module, or the given one if none does."""
    module = (error.name or "").partition(".")[0]
    if module not in _EXTRAS:
        return error
    return MissingDependencyError(
        f"this needs {module}; install with `pip install 'uav-bt[{_EXTRAS[module]}]'`"
    )
