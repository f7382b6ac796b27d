"""The XML Schema of tree files agrees with the loader, as far as a schema can."""

from __future__ import annotations

from pathlib import Path

import pytest
from lxml import etree

from tests.conformance import REGISTRY as TRACED
from tests.conformance import Scripted, read_traces
from tests.worlds.tables import cases
from tests.worlds.trees import document
from uav_bt.board import STATE
from uav_bt.tree import Leaf, NodeRegistry, Port
from uav_bt.tree.loading.loader import check_text
from uav_bt.tree.loading.schema import schema_xml
from uav_bt.types import DroneState

CASES = cases("loading")

TREES = Path(__file__).parents[3] / "trees"
PARSER = etree.XMLParser(resolve_entities=False, no_network=True)


class Paint(Leaf):
    """Paints <something> & stops."""

    ports = (
        Port("colour", str, doc="what it is painted with", choices=("red", "blue")),
        Port("layers", int, default=2, doc="how many"),
        Port("coats", int, default=1, least=1, most=9, doc="how often"),
        Port("width_m", float, default=0.5, doc="width, m"),
        Port("edge_m", float, default=0.5, least=0.01, doc="of the edge, m"),
        Port("dry", bool, default=False, doc="wait for it to dry"),
        Port("title", str, default="", doc="written below"),
        Port("of", DroneState, default="{@state}", doc="what is painted"),
        Port("area", float, direction="output", doc="m2"),
    )
    reads = (STATE,)


REGISTRY = NodeRegistry([Scripted, Paint])


def schema_of(registry: NodeRegistry) -> etree.XMLSchema:
    return etree.XMLSchema(etree.fromstring(schema_xml(registry).encode(), PARSER))


@pytest.fixture(scope="module")
def schema() -> etree.XMLSchema:
    return schema_of(REGISTRY)


def valid(schema: etree.XMLSchema, text: str) -> bool:
    return bool(schema.validate(etree.fromstring(text.encode(), PARSER)))


def loads(text: str) -> bool:
    """Return whether the loader accepts a text whose variables may come from elsewhere."""
    text = text.replace(' main_tree_to_execute="Main"', "")
    return not check_text(text, REGISTRY, path=Path("m.xml"))


def test_every_shipped_tree_is_valid() -> None:
    schema = schema_of(NodeRegistry.installed())
    for path in TREES.glob("*.xml"):
        schema.assertValid(etree.parse(str(path), PARSER))


def test_every_tree_of_the_reference_traces_is_valid() -> None:
    schema = schema_of(TRACED)
    traces = read_traces()
    texts = {trace["xml"] for trace in traces}
    assert len(texts) >= 100
    assert [text for text in texts if not valid(schema, text)] == []


@pytest.mark.parametrize("body", CASES["valid"])
def test_what_the_loader_accepts_is_valid(schema: etree.XMLSchema, body: str) -> None:
    assert loads(document(body))
    assert valid(schema, document(body)), schema.error_log


@pytest.mark.parametrize("body", CASES["not_valid"])
def test_what_the_loader_refuses_is_not_valid(schema: etree.XMLSchema, body: str) -> None:
    assert not loads(document(body))
    assert not valid(schema, document(body))


def test_subtrees_take_any_entry_and_trees_have_ids_of_their_own(schema: etree.XMLSchema) -> None:
    use = '<SubTree ID="Other" name="o" _autoremap="true" any="{thing}" more="1" _skipIf="false"/>'
    other = '<BehaviorTree ID="Other"><AlwaysSuccess/></BehaviorTree>'
    assert loads(document(use, other))
    assert valid(schema, document(use, other))
    assert not valid(schema, document(use, other, other))


def test_the_head_of_a_file_is_checked(schema: etree.XMLSchema) -> None:
    good = document("<AlwaysSuccess/>")
    assert valid(schema, good)
    for bad in (
        good.replace('BTCPP_format="4"', 'BTCPP_format="3"'),
        good.replace('BTCPP_format="4"', ""),
        good.replace("main_tree_to_execute", "main_tree"),
        good.replace("BehaviorTree", "BehaviourTree"),
    ):
        assert not loads(bad)
        assert not valid(schema, bad)
