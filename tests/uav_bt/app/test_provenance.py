"""Provenance of results."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from uav_bt import app
from uav_bt.app import provenance
from uav_bt.app.loading import load_mission
from uav_bt.errors import InputError


def test_the_networks_that_a_mission_loads_are_named_with_their_checksums() -> None:
    weights = provenance.weights_of(app.check("explore_and_land_segmentation"))
    assert list(weights) == ["unet.onnx"]
    assert len(weights["unet.onnx"]) == 64


def test_a_height_that_an_entry_of_a_subtree_gives_is_held_against_the_ceiling() -> None:
    text = """<root BTCPP_format="4" main_tree_to_execute="Main">
      <BehaviorTree ID="Main"><SubTree ID="Up" to_m="2.6"/></BehaviorTree>
      <BehaviorTree ID="Up"><TakeOff height_m="{to_m}"/></BehaviorTree>
    </root>"""
    with pytest.raises(InputError, match=r"node 'Main/Up/TakeOff' is to fly at 2\.6 m"):
        load_mission(text, app.FlightOptions())


def test_a_mission_s_text_decides_over_its_checksum(tmp_path: Path) -> None:
    """The included file counts like the mission's own."""
    part, path = tmp_path / "down.xml", tmp_path / "mission.xml"
    path.write_text(
        '<root BTCPP_format="4" main_tree_to_execute="Down"><include path="down.xml"/></root>'
    )
    found = set()
    for leaf in ("<AlwaysSuccess/>", "<AlwaysFailure/>"):
        part.write_text(
            f'<root BTCPP_format="4"><BehaviorTree ID="Down">{leaf}</BehaviorTree></root>'
        )
        found.add(provenance.sha256_of(app.check(path)))
    assert len(found) == 2


def test_git_is_not_needed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert provenance.commit(tmp_path) is None  # no checkout
    monkeypatch.setattr(provenance.shutil, "which", lambda _: None)
    provenance.commit.cache_clear()
    assert provenance.commit() is None
    provenance.commit.cache_clear()


def test_looking_at_a_checkout_changes_nothing_in_it(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("one")
    git = ["git", "-C", str(tmp_path), "-c", "user.name=a", "-c", "user.email=a@b"]
    for words in (["init", "-q"], ["add", "file"], ["commit", "-q", "-m", "one"]):
        subprocess.run([*git, *words], check=True)  # noqa: S603 - git itself
    os.utime(file, (1.0, 1.0))  # git would check the file again and update its index
    index = tmp_path / ".git" / "index"
    before = index.read_bytes()
    head = provenance.commit(tmp_path)
    assert head is not None
    assert not head.endswith("+changes")
    assert index.read_bytes() == before
