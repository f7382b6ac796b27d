"""Palettes: nodes of other engines, known only by their models."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.conformance import Scripted
from tests.worlds.trees import World, document
from uav_bt.errors import NodeFailedError, TreeError
from uav_bt.tree import Leaf, NodeKind, NodeRegistry, Port, load_tree, parse_tree
from uav_bt.tree.describe import palette_xml
from uav_bt.tree.loading.models import PaletteNode, with_palette
from uav_bt.tree.loading.uses import Uses
from uav_bt.tree.nodes import Sequence

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
