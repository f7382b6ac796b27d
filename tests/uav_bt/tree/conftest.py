"""Fixtures of the tests of the tree language."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

# The conformance runner is a script in `tests/`, with the scripted leaf. Its folder must not be on
# the path: `tests/uav_bt` could hide the package.
_SCRIPT = Path(__file__).parents[2] / "conformance.py"
_SPEC = importlib.util.spec_from_file_location("conformance", _SCRIPT)
if _SPEC is None or _SPEC.loader is None:
    raise ImportError(f"{_SCRIPT} cannot be loaded")
_MODULE = importlib.util.module_from_spec(_SPEC)
sys.modules["conformance"] = _MODULE
_SPEC.loader.exec_module(_MODULE)

from tests.worlds.trees import World  # noqa: E402  # needs the module above


@pytest.fixture
def world() -> World:
    return World()
