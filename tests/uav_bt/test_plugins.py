"""The error of a missing package names the extra that installs it."""

from __future__ import annotations

import sys

import pytest

from uav_bt.errors import MissingDependencyError
from uav_bt.plugins import need


def test_what_is_installed_is_not_missed() -> None:
    need("record", "json", "xml")


def test_everything_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "json", None)
    with pytest.raises(MissingDependencyError) as missing:
        need("view", "json", "xml", "no_such_package", what="a view")
    assert str(missing.value) == (
        "a view needs json and no_such_package; "
        'run `pip install -c constraints.txt -e ".[view]"` in the folder of uav-bt\'s source'
    )
