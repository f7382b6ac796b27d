"""The branches of a tree file."""

from __future__ import annotations

from pathlib import Path

import pytest

from uav_bt.errors import TreeError
from uav_bt.testing.branches import _RULES, tree_branches
from uav_bt.tree import Leaf, NodeKind, NodeRegistry
from uav_bt.tree.nodes import BUILTIN_NODES


class Go(Leaf):
    """Goes."""


class Ask(Leaf):
    """Asks."""

    condition = True


REGISTRY = NodeRegistry([Go, Ask])
LETTERS = {"SUCCESS": "S", "FAILURE": "F", "SKIPPED": "K", "HALTED": "H"}


def branches(tmp_path: Path, body: str, *trees: str) -> str:
    """Return the outcomes of each node in the order of the file, as `SF SFH`."""
    path = tmp_path / "t.xml"
    path.write_text(
        '<root BTCPP_format="4" main_tree_to_execute="M">'
        f'<BehaviorTree ID="M">{body}</BehaviorTree>{"".join(trees)}</root>',
        encoding="utf-8",
    )
    return " ".join(
        "".join(letter for name, letter in LETTERS.items() if name in {o.value for o in n.outcomes})
        for n in tree_branches(path, REGISTRY)
    )


OK, NO = "<AlwaysSuccess/>", "<AlwaysFailure/>"


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ("<Go/>", "SFH"),
        ("<Ask/>", "SF"),
        ('<Condition ID="Foreign"/>', "SF"),
        ('<Action ID="Foreign"/>', "SFH"),
        ("<Foreign/>", "SFH"),
        ('<Sleep msec="5"/>', "SH"),
        ('<Script code="a:=1"/>', "S"),
        ('<Go _skipIf="a"/>', "SFKH"),
        ('<AlwaysSuccess _failureIf="a"/>', "SF"),
        ('<AlwaysFailure _successIf="a" _while="a"/>', "SFK"),
        (f"<Sequence>{OK}<Go/></Sequence>", "SF S SFH"),
        (f"<Sequence>{OK}{OK}</Sequence>", "S S S"),
        (f"<ReactiveSequence>{NO}<Go/></ReactiveSequence>", "F F SFH"),
        (f"<Fallback>{NO}<Go/></Fallback>", "SF F SFH"),
        (f"<Fallback><Go/>{OK}</Fallback>", "S SFH S"),
        ('<Sequence><Go _skipIf="a"/></Sequence>', "SFK SFKH"),
        (f"<Parallel>{OK}{OK}</Parallel>", "S S S"),
        (f"<Inverter>{OK}</Inverter>", "F S"),
        ("<ForceSuccess><Go/></ForceSuccess>", "S SFH"),
        ("<ForceFailure><Go/></ForceFailure>", "F SFH"),
        ("<KeepRunningUntilFailure><Go/></KeepRunningUntilFailure>", "F SFH"),
        ('<Repeat num_cycles="-1"><Go/></Repeat>', "F SFH"),
        ('<Repeat num_cycles="{n}"><Go/></Repeat>', "SF SFH"),
        ('<RetryUntilSuccessful num_attempts="-1"><Go/></RetryUntilSuccessful>', "S SFH"),
        (f"<RunOnce>{OK}</RunOnce>", "SK S"),
        (f'<RunOnce then_skip="false">{OK}</RunOnce>', "S S"),
        (f'<Timeout msec="100">{OK}</Timeout>', "SF S"),
        (f'<Delay delay_msec="100">{OK}</Delay>', "S S"),
        (f'<Precondition if="a" else="SKIPPED">{OK}</Precondition>', "SK S"),
        (f'<SkipUnlessUpdated entry="{{a}}">{OK}</SkipUnlessUpdated>', "SK S"),
        (f'<LoopInt queue="1;2" value="{{v}}">{OK}</LoopInt>', "S S"),
        (f"<IfThenElse><Ask/>{OK}</IfThenElse>", "SF SF S"),
        (f"<WhileDoElse><Ask/>{OK}{OK}</WhileDoElse>", "S SF S S"),
        (f'<Switch2 variable="{{v}}" case_1="1" case_2="2">{OK}{OK}{NO}</Switch2>', "SF S S F"),
        (f"<TryCatch><Go/>{OK}</TryCatch>", "SF SFH S"),
        (f"<Custom>{OK}</Custom>", "SF S"),
    ],
)
def test_what_can_happen(tmp_path: Path, body: str, expected: str) -> None:
    """Outcomes depend on the kind, the conditions and the outcomes of the children."""
    assert branches(tmp_path, body) == expected


def test_a_subtree_answers_what_its_tree_answers(tmp_path: Path) -> None:
    """An unused tree is listed, too; recursion does not hang."""
    used = f'<BehaviorTree ID="U"><Sequence>{OK}</Sequence></BehaviorTree>'
    unused = '<BehaviorTree ID="N"><SubTree ID="N"/></BehaviorTree>'
    assert branches(tmp_path, '<SubTree ID="U"/>', used, unused) == "S S S SF"


def test_every_node_of_the_format_with_children_has_a_rule(tmp_path: Path) -> None:
    """The outcomes of foreign nodes only are assumed."""
    for node in BUILTIN_NODES:
        if node.kind is not NodeKind.SUBTREE and not issubclass(node, Leaf):
            assert node.node_id in _RULES


def test_other_files_are_refused(tmp_path: Path) -> None:
    """The message has the position."""
    (tmp_path / "x.xml").write_text("<root>", encoding="utf-8")
    with pytest.raises(TreeError, match=r"x\.xml:1:7: not well-formed XML"):
        tree_branches(tmp_path / "x.xml", REGISTRY)
    (tmp_path / "y.xml").write_text("<config/>", encoding="utf-8")
    with pytest.raises(TreeError, match=r"y\.xml:1:1: the file has no BehaviorTree"):
        tree_branches(tmp_path / "y.xml", REGISTRY)


def test_a_file_that_the_loader_refuses_can_be_listed(tmp_path: Path) -> None:
    """Only the checker reports missing children and unknown trees."""
    empty = '<BehaviorTree ID="E"/>'
    body = f'<Sequence><IfThenElse>{OK}</IfThenElse><SubTree ID="E"/><SubTree ID="?"/></Sequence>'
    assert branches(tmp_path, body, empty) == "SF SF S SF SF"
