"""A mission that would fail in the air is refused before it flies."""

from __future__ import annotations

import os
import subprocess
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from tests.worlds.trees import check, document, subtree
from uav_bt import app
from uav_bt.app import provenance
from uav_bt.app.assembly import assemble
from uav_bt.app.loading import load_mission
from uav_bt.app.options import FlightOptions
from uav_bt.errors import InputError
from uav_bt.tree import NodeRegistry, parse_tree
from uav_bt.tree.registry import with_leaves

UP = subtree("Up", '<TakeOff height_m="{to_m}"/>')


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ('<HoverFor seconds="{t}"/>', "nothing sets variable 't' of tree 'Main'"),
        ('<Parallel><HoverFor/><Turn degrees="90"/></Parallel>', "ask for a movement in the same"),
        ('<SubTree ID="Up" to_m="2.6"/>', r"node 'Main/Sequence/Up/TakeOff' is to fly at 2\.6 m"),
    ],
)
def test_what_fails_in_the_air_is_refused_on_the_ground(body: str, message: str) -> None:
    text = document(f"<Sequence>{body}<Land/></Sequence>", UP)
    for refused in (partial(load_mission, options=FlightOptions()), app.check, app.assemble):
        with pytest.raises(InputError, match=message):
            refused(text)


# --- values of ports from outside -----------------------------------------------------------------


def test_a_value_from_outside_replaces_the_one_of_the_file() -> None:
    body = '<Sequence><TakeOff name="a"/><TakeOff name="b.c"/><TakeOff/><Land/></Sequence>'
    ports = {"Main/Sequence/a.height_m": "0.9", "b.c.height_m": 1.1, "TakeOff.height_m": 1.2}
    loaded = load_mission(document(body), FlightOptions(ports=ports))
    heights_m = [leaf.port_value("height_m") for leaf in [*loaded.leaves()][:3]]
    assert heights_m == [0.9, 1.1, 1.2]


@pytest.mark.parametrize(
    ("ports", "message"),
    [
        ({"TakeOf.height_m": 1}, "no node of that name or path; did you mean 'TakeOff'"),
        ({"HoverFor.seconds": 1}, r"fits 2 nodes: .*'Main/Sequence/HoverFor#2.seconds'"),
        ({"Explore.policy": "coverage"}, "'Explore.policy' is given two values"),
        ({"seconds": 1}, "expected NODE.PORT, such as TakeOff.height_m, got"),
        ({"TakeOff.height_m": None}, r"ports\['TakeOff.height_m'\]: expected a text, a number"),
        ("laps=3", "ports: expected values by node and port, such as"),
    ],
)
def test_a_wrong_value_from_outside_is_refused(ports: Any, message: str) -> None:
    body = (
        '<TakeOff/><HoverFor/><HoverFor/><Explore policy="corridor"/>'
        '<SubTree ID="ExploreFor" policy="corridor" duration_ms="900"/>'
    )
    with pytest.raises(InputError, match=message):
        load_mission(
            document(f"<Sequence>{body}<Land/></Sequence>"),
            FlightOptions(ports=ports, policies={"Explore": "corridor"}),
        )


def test_what_is_given_counts_before_the_parameter_file(tmp_path: Path) -> None:
    file = tmp_path / "params.yaml"
    file.write_text("{set: {TakeOff.height_m: 1.1}, var: {wait_s: 1, laps: 2}}")
    body = '<Sequence><TakeOff/><HoverFor seconds="{wait_s}"/><Repeat num_cycles="{laps}"><Land/>'
    options = FlightOptions(params=file, variables={"wait_s": 3, "laps": 4})
    tree = load_mission(document(f"{body}</Repeat></Sequence>"), options)
    assert tree.find("TakeOff").port_value("height_m") == 1.1
    assert tree.find("HoverFor").port_value("seconds") == 3.0
    assert tree.find("Repeat").port_value("num_cycles") == 4
    file.unlink()  # the options hold its values
    assert replace(options, seed=1).parameters == options.parameters


def test_a_loaded_tree_takes_ports_and_no_variables() -> None:
    tree = parse_tree(document('<HoverFor seconds="1"/>'))
    assert load_mission(tree, FlightOptions(ports={"HoverFor.seconds": "2"})) is tree
    assert tree.find("HoverFor").port_value("seconds") == 2.0
    with pytest.raises(InputError, match=r"variables: for tree files only; .*\['name'\] = value"):
        load_mission(tree, FlightOptions(variables={"t": 2}))


# --- leaves of a Python file ----------------------------------------------------------------------

WAIT = """
from uav_bt.tree import Leaf, Port, Status
class Wait(Leaf):
    ports = (Port("ticks", int, default=3, doc="how many"),)
    def update(self):
        return Status.SUCCESS
class _Base(Leaf):
    pass
"""


def test_a_tree_uses_the_leaves_of_a_python_file(tmp_path: Path) -> None:
    file = tmp_path / "my_leaves.py"
    file.write_text(WAIT)
    text = document('<Sequence><Wait ticks="4"/><Land/></Sequence>')
    for _ in range(2):  # the file is run once; its classes stay the same
        loaded = load_mission(text, FlightOptions(leaves=[file, str(file)][:1]))
        assert next(loaded.leaves()).port_value("ticks") == 4
    with pytest.raises(InputError, match="unknown node 'Wait'; --leaves FILE"):
        load_mission(text, FlightOptions())


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("absent.py", None, "no such file"),
        ("leaves.txt", WAIT, "whose name ends in .py"),
        ("wrong.py", "class Wait(:\n", r"wrong.py:1: is not valid Python"),
        ("raises.py", "\n1 / 0\n", r"cannot be run: .*raises.py:2: ZeroDivisionError"),
        ("empty.py", "x = 1\n", "defines no leaf, policy or drone"),
        ("policy.py", "class corridor:\n    def decide(self, view): ...\n", "'corridor' is taken"),
        ("taken.py", WAIT.replace("Wait", "Land"), "'Land' is registered twice"),
    ],
)
def test_a_file_without_usable_leaves_is_refused(
    tmp_path: Path, name: str, content: str | None, message: str
) -> None:
    if content is not None:
        (tmp_path / name).write_text(content)
    with pytest.raises(InputError, match=message):
        load_mission(document("<Land/>"), FlightOptions(leaves=[tmp_path / name]))


PARTS = """
from dataclasses import dataclass
from sim_bridge.plain import PlainConfig
from uav_bt.answers import Rotate

class Spin:
    def __init__(self, by=1.0):
        self.by = by
    @classmethod
    def from_text(cls, text):
        return cls(float(text))
    def decide(self, view):
        return Rotate(yaw_rad=self.by)

@dataclass(frozen=True, kw_only=True)
class Slow(PlainConfig):
    pass
"""


def test_policies_and_drones_of_a_python_file(tmp_path: Path) -> None:
    file = tmp_path / "my_parts.py"
    file.write_text(PARTS)
    options = FlightOptions(leaves=[file], drone="Slow", scene="val-a")
    text = document('<Sequence><Explore policy="Spin:0.5"/><Land/></Sequence>')
    flight = assemble(text, options)
    assert flight.scene_name == "val-a"
    made = [flight.context.policy(name) for name in ("Spin:0.5", "Spin")]
    assert [vars(policy) for policy in made] == [{"by": 0.5}, {"by": 1.0}]
    with pytest.raises(InputError, match="unknown policy 'Spn'; did you mean 'Spin'"):
        load_mission(text.replace("Spin", "Spn"), options)
    with pytest.raises(InputError, match="unknown drone 'Slow'"):
        assemble("land_only", drone="Slow")
    registry = with_leaves(NodeRegistry.installed(), [file])
    assert check(text, registry) == ()


# --- provenance -----------------------------------------------------------------------------------


def test_git_is_not_needed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert provenance.commit(tmp_path) is None  # no checkout
    monkeypatch.setenv("PATH", "")
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
