"""What editors of trees exchange with us: palettes and the XML Schema."""

from __future__ import annotations

from pathlib import Path

import pytest
from lxml import etree

from tests.conformance import REGISTRY as TRACED
from tests.conformance import Scripted, read_traces
from tests.worlds.tables import cases
from tests.worlds.trees import World, document
from uav_bt.board import STATE
from uav_bt.errors import NodeFailedError, TreeError
from uav_bt.tree import Leaf, NodeKind, NodeRegistry, Port, load_tree, parse_tree
from uav_bt.tree.describe import palette_xml
from uav_bt.tree.loading.findings import Findings
from uav_bt.tree.loading.loader import check_text
from uav_bt.tree.loading.models import PaletteNode, with_palette
from uav_bt.tree.loading.schema import schema_xml
from uav_bt.tree.loading.uses import Uses
from uav_bt.tree.nodes import Sequence
from uav_bt.types import DroneState

FOREIGN = """<TreeNodesModel>
  <Action ID="ComputePath" editable="true">
    <input_port name="goal" type="geometry_msgs::msg::PoseStamped"/>
    <input_port name="planner" type="std::string" default="GridBased">which planner</input_port>
    <input_port name="retries" type="unsigned int"/>
    <input_port name="hz" type="double" default="0.5"/>
    <input_port name="straight" type="bool"/>
    <input_port name="otherwise" type="BT::NodeStatus" default="FAILURE"/>
    <output_port name="path" type="nav_msgs::msg::Path" default="{path}"/>
    <inout_port name="count" type="int"/>
    <MetadataFields><Metadata author="somebody"/></MetadataFields>
  </Action>
  <Condition ID="IsStuck"/>
  <Control ID="PipelineSequence"/>
  <Decorator ID="RateController"><input_port name="hz"/></Decorator>
  <SubTree ID="Elsewhere"><input_port name="x"/></SubTree>
</TreeNodesModel>
"""


class Land(Leaf):
    """Lands."""

    ports = (Port("speed_mps", float, doc="m/s"),)


def written(folder: Path, text: str) -> Path:
    path = folder / "palette.xml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture
def foreign(tmp_path: Path) -> NodeRegistry:
    return with_palette(NodeRegistry(), written(tmp_path, FOREIGN))


def test_kinds_ports_and_descriptions_come_from_the_model(foreign: NodeRegistry) -> None:
    kinds = {name: foreign[name].kind for name in foreign if name not in NodeRegistry()}
    assert kinds == {
        "ComputePath": NodeKind.ACTION,
        "IsStuck": NodeKind.CONDITION,
        "PipelineSequence": NodeKind.CONTROL,
        "RateController": NodeKind.DECORATOR,
    }
    ports = {port.name: port for port in foreign["ComputePath"].ports}
    types = {name: port.type for name, port in ports.items()}
    assert types == {
        "goal": object,
        "planner": str,
        "retries": int,
        "hz": float,
        "straight": bool,
        "otherwise": str,
        "path": object,
        "count": int,
    }
    assert (ports["path"].direction, ports["count"].direction) == ("output", "inout")
    assert (ports["planner"].default, ports["planner"].doc) == ("GridBased", "which planner")


def test_a_foreign_node_is_not_ticked(foreign: NodeRegistry, world: World) -> None:
    for body in ("<IsStuck/>", "<PipelineSequence><AlwaysSuccess/></PipelineSequence>"):
        tree = parse_tree(document(body), foreign)
        tree.setup(world.context)
        with pytest.raises(NodeFailedError, match="known from a palette only"):
            tree.tick()


def test_the_palette_of_our_own_nodes_can_be_read_again(tmp_path: Path) -> None:
    ours = NodeRegistry.installed()
    read = with_palette(NodeRegistry(), written(tmp_path, palette_xml(ours)))
    assert set(read) == set(ours)
    for node_id in set(ours) - set(NodeRegistry()):
        node, known = read[node_id], ours[node_id]
        assert node.kind is known.kind
        assert [(port.name, port.type, port.direction) for port in node.ports] == [
            (port.name, port.type, port.direction) for port in known.ports
        ]
        for port, own in zip(node.ports, known.ports, strict=True):
            assert port.doc == (f"{own.doc} ({own.range})" if own.range else own.doc)


def test_a_described_node_stays_or_is_replaced(tmp_path: Path) -> None:
    text = '<TreeNodesModel><Action ID="Sequence"/></TreeNodesModel>'
    assert with_palette(NodeRegistry(), written(tmp_path, text))["Sequence"] is Sequence
    installed = NodeRegistry([Land, Scripted])
    alike = written(tmp_path, palette_xml(installed))
    assert with_palette(installed, alike)["Land"] is Land
    text = '<TreeNodesModel><Action ID="Land"><input_port name="topic"/></Action></TreeNodesModel>'
    registry = with_palette(installed, written(tmp_path, text))
    assert registry["Scripted"] is Scripted
    assert issubclass(registry["Land"], PaletteNode)
    parse_tree(document('<Land topic="/land"/>'), registry)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<root/>", "1:1: expected a <TreeNodesModel>, or a <root> that holds one; got <root>"),
        ("<TreeNodesModel>", "not well-formed XML"),
    ],
)
def test_a_palette_that_makes_no_sense_is_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(TreeError) as error:
        with_palette(NodeRegistry(), written(tmp_path, text))
    assert message in error.value.findings[0]
    assert error.value.findings[0].startswith(f"{tmp_path / 'palette.xml'}:1:")


def test_an_odd_port_does_not_cost_a_palette(tmp_path: Path) -> None:
    """These lines of the palettes of Nav2 and other projects were once refused."""
    path = written(
        tmp_path,
        '<root BTCPP_format="4"><TreeNodesModel>'
        '<Action ID="Cut"><input_port name="far" type="double" '
        'default="std::numeric_limits&lt;double&gt;::infinity()"/></Action>'
        '<Control ID="Keep"><bidirectional_port name="at"/></Control>'
        '<Action ID="Count"><input_port name="n" type="unsigned" default="1u"/>'
        '<output_port name="o" default="door"/><input_port name="n"/></Action>'
        "</TreeNodesModel></root>",
    )
    odd = Findings()
    registry = with_palette(NodeRegistry(), path, odd)
    assert len([*odd]) == 5
    text = document('<Keep><Cut far="2.5"/><Count n="3"/></Keep>')
    assert check_text(text, registry, path=Path("m.xml")) == ()
    assert check_text(text.replace("2.5", "far"), registry, path=Path("m.xml"))


def test_enumerations_of_a_palette_are_known_to_scripts(tmp_path: Path) -> None:
    palette = written(
        tmp_path,
        '<root BTCPP_format="4"><TreeNodesModel><Enumeration ID="Supply">'
        '<Member name="SUPPLY_FULL" value="4"/></Enumeration></TreeNodesModel></root>',
    )
    tree = tmp_path / "tree.xml"
    tree.write_text(
        '<root BTCPP_format="4"><BehaviorTree ID="A">'
        '<ScriptCondition code="SUPPLY_FULL == 4"/></BehaviorTree></root>'
    )
    registry = with_palette(NodeRegistry.installed(), palette)
    assert Uses(load_tree(tree, registry)).unset() == {}
    assert [*Uses(load_tree(tree)).unset()] == ["SUPPLY_FULL"]


# --- the schema agrees with the loader, as far as a schema can ------------------------------------

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
