"""Fixtures of the tests of the tree language."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

# The conformance runner is a script beside the packages of tests, and holds the scripted leaf.
sys.path.insert(0, str(Path(__file__).parents[2]))

from tree_world import World


@pytest.fixture
def world() -> World:
    return World()
