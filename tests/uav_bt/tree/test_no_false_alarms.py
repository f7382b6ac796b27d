"""The check of variables' types never refuses a valid file."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.worlds.trees import World, document
from uav_bt.board import HEIGHT
from uav_bt.errors import NodeFailedError, TreeError
from uav_bt.tree import Leaf, NodeRegistry, Port, Status, parse_tree
from uav_bt.tree.loading import loader

NAMES = ("a", "b", "c", "_p")


class Pad:
    """A value that only ports of its type accept."""


class Give(Leaf):
    """Writes its connected ports, with their types."""

    ports = (
        Port("number", float, direction="output"),
        Port("whole", int, direction="output"),
        Port("truth", bool, direction="output"),
        Port("text", str, direction="output"),
        Port("pad", Pad, direction="output"),
        Port("thing", object, direction="output"),
    )
    values: tuple[object, ...] = (2.0, 3, True, "4", Pad(), 5)

    def update(self) -> Status:
        for port, value in zip(self.ports, self.values, strict=True):
            self.set_port(port, value)
        return Status.SUCCESS


class Take(Leaf):
    """Reads its connected ports."""

    ports = (
        Port("number", float, default=1.0),
        Port("whole", int, default=1),
        Port("truth", bool, default=True),
        Port("text", str, default=""),
    )

    def update(self) -> Status:
        for port in self.ports:
            self.port(port)
        return Status.SUCCESS


class Needy(Take):
    """Reads a required number."""

    ports = (Port("number", float),)


class TakePad(Take):
    """Reads a pad."""

    ports = (Port("pad", Pad),)


NODES = NodeRegistry([Give, Take, Needy, TakePad])

name = st.sampled_from(NAMES)
node = st.one_of(
    st.builds('<Give {}="{{{}}}"/>'.format, st.sampled_from([p.name for p in Give.ports]), name),
    st.builds('<Take {}="{{{}}}"/>'.format, st.sampled_from([p.name for p in Take.ports]), name),
    st.builds('<Needy number="{{{}}}"/>'.format, name),
    st.builds('<TakePad pad="{{{}}}"/>'.format, name),
    st.builds(
        '<SetBlackboard value="{}" output_key="{}"/>'.format,
        st.sampled_from(["1", "x", "true", "{a}", "{b}", "{_p}", "{@height_above_ground_m}"]),
        name,
    ),
    st.builds('<UnsetBlackboard key="{}"/>'.format, name),
    st.builds(
        '<Script code="{} {} {}"/>'.format,
        name,
        st.sampled_from([":=", "=", "+="]),
        st.sampled_from(["1", "1.5", "'2'", "'x'", "true", "a", "b + 1", "b .. 'x'", "c ? a : 1"]),
    ),
    st.builds('<AlwaysSuccess _skipIf="{} == 1"/>'.format, name),
    st.builds(
        '<SubTree ID="In" {}/>'.format,
        st.lists(
            st.one_of(
                st.builds('a="{{{}}}"'.format, name),
                st.just('a="1"'),
                st.just('a="{@height_above_ground_m}"'),
            ),
            max_size=1,
        ).flatmap(
            lambda one: st.sampled_from(["", '_autoremap="true"', 'b="{a}"', 'b="x"']).map(
                lambda more: " ".join([*one, more])
            )
        ),
    ),
)
plain = node.filter(lambda text: not text.startswith("<SubTree"))


@settings(
    max_examples=200,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
)
@given(st.lists(node, min_size=1, max_size=4), st.lists(plain, min_size=1, max_size=3))
def test_what_flies_is_never_refused(outer: list[str], inner: list[str]) -> None:
    """A tree whose nodes all run without an error has no findings."""
    if not any(text.startswith("<SubTree") for text in outer):
        outer = [*outer, '<SubTree ID="In"/>']  # unused trees would not be ticked
    text = document(
        f"<Sequence>{''.join(outer)}</Sequence>",
        f'<BehaviorTree ID="In"><Sequence>{"".join(inner)}</Sequence></BehaviorTree>',
    )
    if not flies(text):
        return
    parse_tree(text, NODES)


def flies(text: str) -> bool:
    """Return whether a tree ticks twice without an error when its variables are not checked."""
    world = World()
    world.board.declare(HEIGHT)
    world.board.write(HEIGHT, 1.0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(loader, "check_variables", lambda *_: None)
        try:
            tree = parse_tree(text, NODES)
        except TreeError:
            return False
    tree.setup(world.context)
    try:
        return [tree.tick(), tree.tick()] == [Status.SUCCESS] * 2
    except NodeFailedError:
        return False


def test_many_of_the_generated_trees_fly() -> None:
    """The property above is not empty: a tree with all kinds of nodes runs."""
    assert flies(
        document(
            '<Sequence><Give number="{a}"/><SubTree ID="In" a="{a}"/></Sequence>',
            '<BehaviorTree ID="In"><Needy number="{a}"/></BehaviorTree>',
        )
    )
    assert not flies(document('<Needy number="{a}"/>'))
