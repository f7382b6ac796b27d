"""Ports, and the registry of nodes and plug-ins."""

from __future__ import annotations

import importlib.metadata
import re
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pytest

from tests.conformance import Scripted
from tests.worlds.tables import cases
from uav_bt import plugins
from uav_bt.board.blackboard import Key
from uav_bt.errors import InputError, UnknownNameError, ValueRangeError
from uav_bt.tree import Leaf, NodeRegistry, load_tree
from uav_bt.tree import node_ports as engine
from uav_bt.tree.loading import attributes as loader
from uav_bt.tree.loading.loader import check_file
from uav_bt.tree.port import Port, Reference, bind_ports, parse_reference

PORTS = cases("ports")
KINDS: dict[str, type] = {kind.__name__: kind for kind in (int, float, bool, str, list)}


@pytest.mark.parametrize(("kind", "given", "value"), PORTS["typed"])
def test_values_are_typed(kind: str, given: object, value: object) -> None:
    bound = Port("p", KINDS[kind]).bind(given)
    assert bound == value
    assert type(bound) is KINDS[kind]


@pytest.mark.parametrize(
    ("kind", "given", "expected"), [*PORTS["refused"], ("int", "9" * 5000, "an integer")]
)
def test_mistyped_values_are_refused(kind: str, given: object, expected: str) -> None:
    with pytest.raises(ValueError, match=f"expected {expected}"):
        Port("p", KINDS[kind]).bind(given)


@pytest.mark.parametrize(("kind", "value", "read"), PORTS["read"])
def test_variables_are_read_as_by_the_engine(kind: str, value: object, read: object) -> None:
    """A script's `true` is valid for a port of booleans, its number for a port of texts."""
    port = Port("p", KINDS[kind])
    if read is None:
        with pytest.raises(ValueError, match="expected"):
            port.read(value)
    else:
        assert port.read(value) == read


@pytest.mark.parametrize(("text", "name", "on_board"), PORTS["references"])
def test_references(text: str, name: str | None, *, on_board: bool) -> None:
    """Braces around a key make a reference, `{=}` one to the port's own name."""
    if name == "":
        with pytest.raises(ValueError, match="not a reference"):
            parse_reference(text, "p")
    else:
        wanted = None if name is None else Reference(name, on_board=on_board)
        assert parse_reference(text, "p") == wanted


@pytest.mark.parametrize(
    ("least", "most", "words", "wrong"),
    [(0.3, 20, "0.3 to 20", "0.29"), (0, None, "0 or more", "-1"), (None, 9, "9 or less", "9.5")],
)
def test_numbers_keep_to_their_range(
    least: float | None, most: float | None, words: str, wrong: str
) -> None:
    port = Port("p", float, least=least, most=most)
    assert port.range == words
    assert not port.takes_all
    for bound in (least, most):
        assert bound is None or port.bind(f"{bound}") == bound
    for take in (port.bind, lambda text: port.read(float(text))):
        with pytest.raises(ValueError, match=f"expected {words}, got {wrong}"):
            take(wrong)


def test_other_refusals() -> None:
    with pytest.raises(ValueError, match="only numbers have a range"):
        Port("p", str, most=3)
    port = Port("out", int, direction="output")
    assert port.bind("{x}") == Reference("x", on_board=False)
    with pytest.raises(ValueError, match="needs a reference"):
        port.bind("3")

    def positive(value: float) -> None:
        if value <= 0:
            raise ValueRangeError("must be above 0")

    with pytest.raises(ValueError, match="must be above 0"):
        Port("p", float, check=positive).bind("-1")


@pytest.mark.parametrize("name", ["name", "ID", "_x", "", "a b", "1a"])
def test_reserved_port_names(name: str) -> None:
    with pytest.raises(ValueError, match="cannot be a port's name"):
        Port(name, int)


MISSION = Path(__file__).parents[3] / "trees" / "survey_and_land.xml"


def test_each_node_is_bound_once(monkeypatch: pytest.MonkeyPatch) -> None:
    registry, calls = NodeRegistry.installed(), Counter[str]()

    def counting(name: str) -> Callable[..., Any]:
        def counted(ports: Iterable[Port[Any]], *given: Any) -> Any:
            calls[name] += any(True for _ in ports)
            return bind_ports(ports, *given)

        return counted

    for module in (engine, loader):
        monkeypatch.setattr(module, "bind_ports", counting(module.__name__))
    nodes = [node for node in load_tree(MISSION, registry).nodes() if node.ports]
    assert calls == {loader.__name__: len(nodes), engine.__name__: 0}
    check_file(MISSION, registry)
    assert calls[loader.__name__] == 2 * len(nodes)


# --- the registry ---------------------------------------------------------------------------------

PACKAGES = cases("missions")

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


@pytest.mark.parametrize(("value", "message"), PACKAGES["broken_packages"])
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


def test_two_packages_of_one_name(monkeypatch: pytest.MonkeyPatch) -> None:
    same = (plugins.DRONES, "twin", "a:make")
    _install(monkeypatch, same, same)
    assert plugins.names(plugins.DRONES) == ("twin",)
    _install(monkeypatch, same, (plugins.DRONES, "twin", "b:make"))
    with pytest.raises(InputError, match="by a:make and by b:make"):
        plugins.load(plugins.DRONES, "twin")
