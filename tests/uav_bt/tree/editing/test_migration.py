"""Files of version 3 become files of version 4; what has no equal there is listed."""

from __future__ import annotations

from pathlib import Path

import pytest

from uav_bt.errors import TreeError
from uav_bt.tree import parse_tree
from uav_bt.tree.editing.migration import migrate_source
from uav_bt.tree.loading.loader import check_text

HERE = Path("old.xml")
VERSION_3 = """\
<?xml version="1.0"?>
<root main_tree_to_execute="Main">
  <!-- SequenceStar: stays in a comment -->
  <BehaviorTree ID="Main">
    <SequenceStar name="SequenceStar">
      <SetBlackboard output_key="goal"   value="1"/>
      <SubTree ID="Move" target="goal" name="move"/>
      <SubTreePlus ID="Move" __autoremap="1" target='{goal}'/>

      <Parallel success_threshold="1"
                failure_threshold="1">
        <Control ID="SequenceStar"><AlwaysSuccess/></Control>
      </Parallel>
      <RetryUntilSuccesful num_attempts="3"> <AlwaysSuccess/> </RetryUntilSuccesful>
    </SequenceStar>
  </BehaviorTree>
  <BehaviorTree ID="Move"><AlwaysSuccess _skipIf2="a"/></BehaviorTree>
  <TreeNodesModel>
    <SubTree ID="Move"><input_port name="target" default="goal"/></SubTree>
  </TreeNodesModel>
</root>
"""
VERSION_4 = """\
<?xml version="1.0"?>
<root BTCPP_format="4" main_tree_to_execute="Main">
  <!-- SequenceStar: stays in a comment -->
  <BehaviorTree ID="Main">
    <SequenceWithMemory name="SequenceStar">
      <SetBlackboard output_key="goal"   value="1"/>
      <SubTree ID="Move" target="{goal}" name="move"/>
      <SubTree ID="Move" _autoremap="1" target='{goal}'/>

      <Parallel success_count="1"
                failure_count="1">
        <Control ID="SequenceWithMemory"><AlwaysSuccess/></Control>
      </Parallel>
      <RetryUntilSuccessful num_attempts="3"> <AlwaysSuccess/> </RetryUntilSuccessful>
    </SequenceWithMemory>
  </BehaviorTree>
  <BehaviorTree ID="Move"><AlwaysSuccess _skipIf2="a"/></BehaviorTree>
  <TreeNodesModel>
    <SubTree ID="Move"><input_port name="target" default="goal"/></SubTree>
  </TreeNodesModel>
</root>
"""


def migrated(body: str) -> tuple[str, list[str]]:
    """Return a main tree of version 3 as one of version 4, and what is said of it."""
    text = f'<root><BehaviorTree ID="M">{body}</BehaviorTree></root>'
    result = migrate_source(text.encode(), HERE)
    new = result.data.decode()
    head, tail = '<root BTCPP_format="4"><BehaviorTree ID="M">', "</BehaviorTree></root>"
    assert new.startswith(head), new
    return new.removeprefix(head).removesuffix(tail), [str(each) for each in result.findings]


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_names_change_and_nothing_else(newline: str) -> None:
    result = migrate_source(VERSION_3.replace("\n", newline).encode(), HERE)
    assert result.data.decode() == VERSION_4.replace("\n", newline)
    assert result.findings == ()
    assert not [
        each for each in check_text(result.data, path=HERE) if "_skipIf2" not in each.message
    ]


def test_version_3_may_be_written_in_the_root() -> None:
    result = migrate_source(VERSION_3.replace("<root", "<root BTCPP_format='3'").encode(), HERE)
    assert result.data.decode() == VERSION_4.replace('BTCPP_format="4"', "BTCPP_format='4'")


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (
            'BlackboardCheckInt value_A="{x}" value_B="1" return_on_mismatch="SUCCESS"',
            'Precondition if="x == 1" else="SUCCESS"',
        ),
        ('BlackboardCheckDouble value_B="-1.5" value_A="{x}"', 'Precondition if="x == -1.5"'),
        ('BlackboardCheckBool value_A="{x}" value_B="True"', 'Precondition if="x == true"'),
        ('BlackboardCheckString value_A="{x}" value_B="a b"', "Precondition if=\"x == 'a b'\""),
    ],
)
def test_a_check_of_the_board_is_a_precondition(old: str, new: str) -> None:
    body, notes = migrated(f"<{old}><AlwaysSuccess/></{old.split(maxsplit=1)[0]}>")
    assert body == f"<{new}><AlwaysSuccess/></Precondition>"
    (note,) = notes
    assert note.startswith("old.xml:1:28: warning: BlackboardCheck")
    assert "compared at every tick" in note
    parse_tree(f'<root BTCPP_format="4"><BehaviorTree ID="M">{body}</BehaviorTree></root>')


@pytest.mark.parametrize(
    "given",
    [
        'value_A="{x}" value_B="one"',
        'value_A="{x}"',
        'value_A="{a b}" value_B="1"',
    ],
)
def test_a_check_that_is_no_script_is_left_and_listed(given: str) -> None:
    old = f"<BlackboardCheckInt {given}><AlwaysSuccess/></BlackboardCheckInt>"
    body, notes = migrated(old)
    assert body == old
    assert ["cannot be written as a script" in note for note in notes] == [True]


def test_what_ticks_otherwise_is_listed_with_its_line() -> None:
    body, notes = migrated(
        "\n<Sequence>\n"
        '<SubTree ID="A" __shared_blackboard="true"/>\n'
        '<SubTree ID="A" __shared_blackboard="false" x="y"/>\n'
        '<AlwaysSuccess _skipIf="port"/>\n'
        '<SubTree ID="A" x="{y}"/></Sequence>'
    )
    assert body == (
        "\n<Sequence>\n"
        '<SubTree ID="A" _autoremap="true"/>\n'
        '<SubTree ID="A" x="{y}"/>\n'
        '<AlwaysSuccess _skipIf="port"/>\n'
        '<SubTree ID="A" x="{y}"/></Sequence>'
    )
    places = [note.split(": ")[0] for note in notes]
    assert places == ["old.xml:3:17", "old.xml:5:16", "old.xml:6:17"]
    assert "_autoremap shares" in notes[0]
    assert "script in version 4" in notes[1]
    assert "reference already" in notes[2]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (VERSION_4, 'got BTCPP_format="4"'),
        ("<Sequence/>", "got <Sequence>"),
        ("<root>", "not well-formed"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><root/>', "not allowed"),
    ],
)
def test_what_is_no_file_of_version_3_is_refused(text: str, words: str) -> None:
    with pytest.raises(TreeError, match=words.replace("[", "\\[")):
        migrate_source(text.encode(), HERE)
