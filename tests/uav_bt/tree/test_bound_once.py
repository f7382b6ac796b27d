"""The ports of a node are bound once: by the loader, while it checks and builds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pytest

from uav_bt.tree import NodeRegistry, load_tree
from uav_bt.tree import node_ports as engine
from uav_bt.tree.loading import attributes as loader
from uav_bt.tree.loading.loader import check_file
from uav_bt.tree.port import Port, bind_ports

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
