"""Fixtures of the tests of the tree language."""

from __future__ import annotations

import pytest
from hypothesis import settings

from tests.worlds.trees import World

# For tests that draw trees: python -m pytest FILE --hypothesis-profile many-trees
settings.register_profile("many-trees", deadline=None, max_examples=300)


@pytest.fixture
def world() -> World:
    return World()
