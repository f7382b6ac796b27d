"""Tree files with one mistake each, made from shipped missions and from small random trees."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Final
from xml.etree import ElementTree as ET

from uav_bt.tree.shipped import tree_files

_MISSIONS: Final = ("hover_and_look", "land_only", "survey_and_land", "explore_and_land_depth")
_KEYS: Final = ("elapsed_s", "height_above_ground_m", "phase", "flight_height_m", "site_map")
_KEYS_OF_OTHERS: Final = ("flight_pitch_rad", "track_tried_s", "corridor", "mark", "odometry")
_MOVERS: Final = (
    '<Turn degrees="90"/>',
    '<HoverFor seconds="1"/>',
    '<PointCamera pitch_deg="-40"/>',
    '<Explore policy="segmentation"/>',
    '<Explore policy="segmentation" looks_down="true"/>',
    '<Delay delay_msec="300"><HoverFor seconds="1"/></Delay>',
    '<Sequence><ScriptCondition code="@elapsed_s &gt; 2"/><Turn degrees="20"/></Sequence>',
    "<AlwaysSuccess/>",
    '<Script code="n := 3"/>',
)
_WRAPPERS: Final = (
    "<Sequence/>",
    "<Fallback/>",
    "<ReactiveSequence/>",
    "<ReactiveFallback/>",
    "<SequenceWithMemory/>",
    "<AsyncSequence/>",
    '<Parallel failure_count="-1"/>',
    "<ParallelAll/>",
)
_DECORATORS: Final = (
    "<Inverter/>",
    "<ForceSuccess/>",
    '<Repeat num_cycles="2"/>',
    '<RetryUntilSuccessful num_attempts="2"/>',
    '<Timeout msec="700"/>',
    '<Delay delay_msec="200"/>',
    "<RunOnce/>",
    '<Precondition if="n &gt; 0"/>',
    '<LoopInt queue="1;2;3" value="{i}"/>',
)
_LEAVES: Final = (
    "<Segment/>",
    "<FindMark/>",
    "<Hovering/>",
    "<TakeOff/>",
    '<HoverFor seconds="{n}"/>',
    '<Turn degrees="45"/>',
    '<PointCamera pitch_deg="-30"/>',
    '<Script code="n := n + 1"/>',
    '<Script code="n := 2" _onSuccess="word := \'red\'"/>',
    '<ScriptCondition code="n &gt; 2"/>',
    "<ScriptCondition code=\"word == 'red'\"/>",
    '<ScriptCondition code="@elapsed_s &gt; 1"/>',
    '<AlwaysFailure _skipIf="n &lt; 4"/>',
    '<SetBlackboard value="{n}" output_key="m"/>',
    '<Script code="m := 1; m += n"/>',
    '<SubTree ID="Part" n="{n}"/>',
    '<SubTree ID="Part" n="2"/>',
)
_PART: Final = '<Sequence><HoverFor seconds="{n}"/><Script code="n := n + 1"/></Sequence>'


def _node(text: str | bytes) -> ET.Element:
    return ET.fromstring(text)  # noqa: S314  # a text of this package


def random_tree(draw: random.Random) -> ET.Element:
    """Return a small tree file; its variables have values from the start.

    Args:
        draw: draws the nodes.
    """
    root = ET.Element("root", BTCPP_format="4", main_tree_to_execute="Main")
    body = ET.SubElement(ET.SubElement(root, "BehaviorTree", ID="Main"), "Sequence")
    body.append(_node("<Script code=\"n := 1; word := 'a'\"/>"))
    body.append(_branch(draw, depth=3, flies=True))
    ET.SubElement(root, "BehaviorTree", ID="Part").append(_node(_PART))
    return root


def _branch(draw: random.Random, *, depth: int, flies: bool) -> ET.Element:
    """Return a branch; one inside a Parallel does not fly, so that the tree is right."""
    if depth == 0 or draw.random() < 0.2:
        calm = [leaf for leaf in _LEAVES if not any(word in leaf for word in _FLYING)]
        return _node(draw.choice(_LEAVES if flies else calm))
    if draw.random() < 0.35:
        node = _node(draw.choice(_DECORATORS))
        node.append(_branch(draw, depth=depth - 1, flies=flies))
        return node
    node = _node(draw.choice(_WRAPPERS))
    for number in range(draw.randint(1, 4)):
        calm = "Parallel" in node.tag and number > 0
        node.append(_branch(draw, depth=depth - 1, flies=flies and not calm))
    return node


_FLYING: Final = ("HoverFor", "Turn", "PointCamera", "TakeOff", "SubTree")


def shipped_tree(draw: random.Random) -> ET.Element:
    """Return a shipped mission.

    Args:
        draw: draws which one.
    """
    (path,) = tree_files(draw.choice(_MISSIONS))
    return _node(path.read_bytes())


# --- mistakes -------------------------------------------------------------------------------------


def _places(root: ET.Element) -> list[tuple[ET.Element, int]]:
    """Return all nodes with a parent in a tree, as parent and index."""
    trees = [tree for tree in root if tree.tag == "BehaviorTree"]
    return [(node, index) for tree in trees for node in tree.iter() for index in range(len(node))]


def _wrap(draw: random.Random, root: ET.Element, wrapper: str) -> ET.Element:
    parent, index = draw.choice(_places(root))
    node = _node(wrapper)
    node.append(parent[index])
    parent[index] = node
    return node


def _insert(draw: random.Random, root: ET.Element, text: str) -> None:
    parent, index = draw.choice(_places(root))
    node = ET.Element("Sequence")
    node.append(_node(text))
    node.append(parent[index])
    parent[index] = node


def _unset_variable(draw: random.Random, root: ET.Element) -> None:
    """Read a variable that nothing sets, or that another branch sets."""
    name = draw.choice(("nobody", "late"))
    reader = draw.choice(
        (
            '<ScriptCondition code="{0} &gt;= 2"/>',
            '<HoverFor seconds="{{{0}}}"/>',
            '<Script code="{0} += 1"/>',
            '<AlwaysSuccess _skipIf="{0} == 1"/>',
            '<AlwaysSuccess _onSuccess="x := {0}"/>',
            '<SetBlackboard value="{{{0}}}" output_key="x"/>',
            '<LoopString queue="{{{0}}}" value="{{p}}"><AlwaysSuccess/></LoopString>',
        )
    )
    _insert(draw, root, reader.format(name))
    if name == "late":
        _insert(draw, root, '<Script code="late := 1"/>')


def _removed_setter(draw: random.Random, root: ET.Element) -> None:
    """Remove a Script, or let it run under a condition."""
    setters = [place for place in _places(root) if place[0][place[1]].tag == "Script"]
    if not setters:
        _unset_variable(draw, root)
        return
    parent, index = draw.choice(setters)
    if draw.random() < 0.5:
        parent[index] = ET.Element("AlwaysSuccess")
    else:
        parent[index].set("_skipIf", "@elapsed_s > 1")


def _swapped(draw: random.Random, root: ET.Element) -> None:
    """Exchange two neighbours."""
    parents = [parent for parent, index in _places(root) if index > 0]
    if parents:
        parent = draw.choice(parents)
        index = draw.randrange(1, len(parent))
        parent[index - 1], parent[index] = parent[index], parent[index - 1]


def _foreign_key(draw: random.Random, root: ET.Element) -> None:
    """Read a board key in a script or at a port."""
    key = draw.choice((*_KEYS, *_KEYS_OF_OTHERS))
    reader = draw.choice(
        (
            '<ScriptCondition code="@{0} &gt; 1"/>',
            '<AlwaysSuccess _while="@{0} &lt; 1"/>',
            '<Script code="x := @{0}"/>',
            '<ScriptCondition code="known(@{0}) &amp;&amp; @{0} &gt; 0"/>',
            '<HoverFor seconds="{{@{0}}}"/>',
            '<SetBlackboard value="{{@{0}}}" output_key="x"/>',
            '<SubTree ID="KeyPart" key="{{@{0}}}"/>',
        )
    )
    _insert(draw, root, reader.format(key))
    part = ET.SubElement(root, "BehaviorTree", ID="KeyPart")
    part.append(_node('<AlwaysSuccess _failureIf="key &gt; 1"/>'))


def _parallel_movers(draw: random.Random, root: ET.Element) -> None:
    """Let two branches run at the same time."""
    node = _wrap(draw, root, draw.choice(("<Parallel/>", "<ParallelAll/>")))
    for _ in range(draw.randint(1, 2)):
        node.insert(draw.randint(0, len(node)), _node(draw.choice(_MOVERS)))


def _bad_loop(draw: random.Random, root: ET.Element) -> None:
    """Loop over something else than a queue."""
    kind = draw.choice(("LoopInt", "LoopDouble", "LoopBool", "LoopString"))
    queue = draw.choice(("{@site_map}", "{@phase}", "{@elapsed_s}", "{v}", "1;x", "true;2", "{v}"))
    _wrap(draw, root, f'<{kind} queue="{queue}" value="{{e}}"/>')
    if queue == "{v}":
        first = draw.choice(("5", "'1;2'", "'a;b'", "0.5"))
        for tree in root.findall("BehaviorTree"):
            body = ET.Element("Sequence")
            body.append(ET.Element("Script", code=f"v := {first}"))
            body.append(tree[0])
            tree[:] = [body]


def _wrong_type(draw: random.Random, root: ET.Element) -> None:
    """Give a value of another type than the reader's."""
    value = draw.choice(("'fast'", "5", "-5", "'7'", "0.5", "1"))
    reader = draw.choice(
        (
            '<HoverFor seconds="{v}"/>',
            '<Turn degrees="{v}"/>',
            '<Repeat num_cycles="{v}"><AlwaysSuccess/></Repeat>',
            '<ScriptCondition code="v &gt; 1"/>',
            '<Script code="w := v * 2"/>',
            "<Script code=\"v := 'red'\"/>",
            '<Script code="v := 2"/>',
            '<SetBlackboard value="slow" output_key="v"/>',
            '<SubTree ID="TypedPart" v="{v}"/>',
        )
    )
    first = f'<Script code="v := {value}"/>'
    _insert(draw, root, f"<Sequence>{first}<ForceSuccess>{reader}</ForceSuccess></Sequence>")
    part = ET.SubElement(root, "BehaviorTree", ID="TypedPart")
    part.append(_node('<HoverFor seconds="{v}"/>'))


def _late_value(draw: random.Random, root: ET.Element) -> None:
    """Give a policy or a network by a variable."""
    leaf = draw.choice(
        (
            '<Explore policy="{v}"/>',
            '<Segment model="{v}"/>',
            '<BuildCorridor side_m="{v}"/>',
            '<SubTree ID="PolicyPart" rule="{v}"/>',
            '<SubTree ID="PolicyPart" rule="segmentation"/>',
        )
    )
    value = "1" if "side_m" in leaf else "'unet'" if "model" in leaf else "'segmentation'"
    _insert(draw, root, f'<Sequence><Script code="v := {value}"/>{leaf}</Sequence>')
    part = ET.SubElement(root, "BehaviorTree", ID="PolicyPart")
    part.append(_node('<Explore policy="{rule}"/>'))


def _skipped_condition(draw: random.Random, root: ET.Element) -> None:
    """Ask a condition that may be skipped, or too many children of a Parallel."""
    wrapper = draw.choice(("<IfThenElse/>", "<WhileDoElse/>", '<Parallel success_count="3"/>'))
    node = _wrap(draw, root, wrapper)
    condition = draw.choice(('_skipIf="@elapsed_s &gt; 1"', '_while="@elapsed_s &lt; 1"', ""))
    node.insert(0, _node(f"<AlwaysSuccess {condition}/>"))


MISTAKES: Final[dict[str, Callable[[random.Random, ET.Element], None]]] = {
    "unset variable": _unset_variable,
    "removed setter": _removed_setter,
    "exchanged nodes": _swapped,
    "board key": _foreign_key,
    "parallel branches": _parallel_movers,
    "loop": _bad_loop,
    "type": _wrong_type,
    "late value": _late_value,
    "choice": _skipped_condition,
}


def wrong_tree(seed: int) -> tuple[str, str]:
    """Return the name of a mistake, and the text of a tree file with it.

    Args:
        seed: of the tree and the mistake.
    """
    draw = random.Random(seed)  # noqa: S311  # no secret
    root = random_tree(draw) if draw.random() < 0.5 else shipped_tree(draw)
    name = draw.choice(list(MISTAKES))
    MISTAKES[name](draw, root)
    return name, ET.tostring(root, encoding="unicode")
