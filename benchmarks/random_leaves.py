"""Ticks of a tree whose leaves answer at random, within their declarations."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, ClassVar, Final

from uav_bt.board import ELAPSED, HEIGHT, Key
from uav_bt.board.context import MissionContext
from uav_bt.errors import MissionError
from uav_bt.testing import TreeBench
from uav_bt.tree import Leaf, NodeRegistry, Port, Status, parse_tree
from uav_bt.tree.nodes import BUILTIN_NODES
from uav_bt.types import GimbalTo, Hover

_WORDS: Final = ("explore", "red", "")
_FORGETS: Final = 0.3  # share of activations in which a leaf does not write a key of its own


class RandomLeaf(Leaf):
    """Reads its ports, answers at random, and proposes as its class declares."""

    acts_for: ClassVar[type[Leaf]]  # the class whose declarations it has
    draw: ClassVar[random.Random]

    def on_setup(self, mission: MissionContext) -> None:
        """Read the ports that are needed before the take-off."""
        del mission
        for port in self.ports:
            if port.at_setup or port.name == "policy":
                self.port(port)

    def may_point(self) -> bool:
        """Ask the class."""
        return self.acts_for.may_point(self)

    def update(self) -> Status:
        """Answer; write outputs on success."""
        for port in self.ports:
            if port.direction != "output":
                self.port(port)
        self._write_keys()
        status = self.draw.choice(self.answers)
        if status is Status.RUNNING and self.moves:
            self.propose(Hover())
        if status is Status.RUNNING and self.may_point():
            self.point(GimbalTo(pitch_rad=-0.5))
        if status is Status.SUCCESS:
            for port in self.ports:
                if port.direction != "input":
                    self.set_port(port, _value(port, self.draw))
        return status

    def _write_keys(self) -> None:
        for key in self.writes:
            value = _value(key, self.draw)
            if value is not None and self.draw.random() > _FORGETS:
                self.write(key, value)


def _value(of: Key[Any] | Port[Any], draw: random.Random) -> Any:
    """Return a value for a key or an output; None for a type that scripts do not read."""
    if of.type is str:
        return draw.choice(_WORDS)
    makers: dict[type, Callable[[], Any]] = {
        bool: partial(draw.choice, (True, False)),
        int: partial(draw.randint, 0, 3),
        float: partial(draw.uniform, 0.0, 3.0),
    }
    return makers[of.type]() if of.type in makers else None


def random_registry(registry: NodeRegistry, draw: random.Random) -> NodeRegistry:
    """Return a registry whose leaves, except those of the format, answer at random.

    Args:
        registry: the nodes.
        draw: draws their answers.
    """
    nodes = [registry[node_id] for node_id in registry]
    own = [
        _random_class(node, draw) if issubclass(node, Leaf) and node not in BUILTIN_NODES else node
        for node in nodes
    ]
    return replace(registry, nodes=own)


def _random_class(node: type[Leaf], draw: random.Random) -> type[Leaf]:
    names = ("node_id", "ports", "reads", "writes", "answers", "moves", "points", "condition")
    body = {name: getattr(node, name) for name in names}
    return type(node.__name__, (RandomLeaf,), {**body, "acts_for": node, "draw": draw})


def raises_within(text: str, registry: NodeRegistry, *, ticks: int, seed: int) -> str | None:
    """Tick a tree with random answers, and return its first error; None without one.

    A tree that ends is started again. The time and the height are written in most ticks.

    Args:
        text: of the tree file.
        registry: the nodes that may occur.
        ticks: how many.
        seed: of the answers.
    """
    draw = random.Random(seed)  # noqa: S311  # no secret
    bench = TreeBench(parse_tree(text, random_registry(registry, draw)))
    bench.allow_stale()
    try:
        bench.setup()
        for _ in range(ticks):
            bench.board[ELAPSED] = bench.clock.now()
            if draw.random() > _FORGETS:
                bench.board[HEIGHT] = draw.uniform(0.0, 2.0)
            bench.tick()
            bench.log.events.clear()
            bench.outcomes[:-1] = []
    except MissionError as error:
        return str(error)
    return None
