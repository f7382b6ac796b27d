"""Fixtures of the tests of the tree language."""

from __future__ import annotations

import pytest

from tests.worlds.trees import World


@pytest.fixture
def world() -> World:
    return World()
