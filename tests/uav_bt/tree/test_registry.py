"""Registry and plug-ins: unique names, suggestions, and messages about broken packages."""

from __future__ import annotations

import importlib.metadata
import re

import pytest

from tests.conformance import Scripted
from tests.worlds.tables import cases
from uav_bt import plugins
from uav_bt.board.blackboard import Key
from uav_bt.errors import InputError, UnknownNameError
from uav_bt.tree import Leaf, NodeRegistry

CASES = cases("missions")

OWN = Key("own_key", int, "a plug-in's")


class Plugged(Leaf):
    """A leaf of another package."""

    reads = (OWN,)


LEAVES = (Plugged,)
NOT_LEAVES = 3  # these two are named in missions.yaml
WRONG = (int,)
YOURS = f"{__name__}:LEAVES"


def _install(monkeypatch: pytest.MonkeyPatch, *points: tuple[str, str, str]) -> None:
    found = [importlib.metadata.EntryPoint(name, value, group) for group, name, value in points]
    monkeypatch.setattr(plugins, "_installed", lambda _: importlib.metadata.EntryPoints(found))


def test_ids_are_sorted_and_an_unknown_one_gets_a_suggestion() -> None:
    registry = NodeRegistry()
    assert list(registry) == sorted(registry)
    with pytest.raises(UnknownNameError, match="did you mean 'Sequence'"):
        _ = registry["Sequense"]


def test_duplicates_name_both() -> None:
    registry = NodeRegistry([Scripted])
    assert registry.with_nodes(Scripted)["Scripted"] is Scripted
    other = type("Scripted", (Leaf,), {"__module__": "elsewhere"})
    with pytest.raises(
        InputError, match=r"by tests\.conformance\.Scripted and by elsewhere\.Scripted"
    ):
        registry.with_nodes(other)
    with pytest.raises(InputError, match="expected a node class"):
        registry.with_nodes(object)  # type: ignore[arg-type]


@pytest.mark.parametrize(("value", "message"), CASES["broken_packages"])
def test_broken_packages_are_named(
    monkeypatch: pytest.MonkeyPatch, value: str, message: str
) -> None:
    _install(monkeypatch, (plugins.BEHAVIOURS, "mine", value), (plugins.BEHAVIOURS, "yours", YOURS))
    registry = NodeRegistry.installed()
    assert registry["Plugged"] is Plugged
    (fault,) = registry.faults
    assert "'mine'" in fault
    assert re.search(message, fault)


def test_loading_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    _install(monkeypatch, (plugins.POLICIES, "rule", "builtins:dict"))
    assert plugins.names(plugins.POLICIES) == ("rule",)
    assert plugins.load(plugins.POLICIES, "rule") is dict
    with pytest.raises(UnknownNameError, match=r"unknown policy 'rul'; did you mean 'rule'\?"):
        plugins.load(plugins.POLICIES, "rul")


def test_two_packages_of_one_name(monkeypatch: pytest.MonkeyPatch) -> None:
    same = (plugins.DRONES, "twin", "a:make")
    _install(monkeypatch, same, same)
    assert plugins.names(plugins.DRONES) == ("twin",)
    _install(monkeypatch, same, (plugins.DRONES, "twin", "b:make"))
    with pytest.raises(InputError, match="by a:make and by b:make"):
        plugins.load(plugins.DRONES, "twin")
