"""Remarks on values of leaves' ports: names that are not installed, values that need caution."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

from uav_bt import plugins
from uav_bt.errors import InputError
from uav_bt.tree.loading.builder import POLICY_PORT
from uav_bt.tree.loading.findings import WARNING, Finding, Rule
from uav_bt.tree.loading.plans import GivenValue
from uav_bt.tree.port import Port
from uav_bt.tree.registry import NodeRegistry


def remarks_on(port: Port[Any], value: GivenValue, registry: NodeRegistry) -> Iterator[Finding]:
    """Yield findings for a name that is not installed, and for a value that needs caution.

    Args:
        port: of a leaf.
        value: text that the port gets.
        registry: the nodes and policies that may occur.
    """
    element = value.element
    where = element.at(value.attribute)
    finding = partial(Finding, str(element.path), where, node=value.path)
    look_up = port.look_up
    if port.name == POLICY_PORT:
        look_up = partial(plugins.look_up_policy, own=registry.factories)
    try:
        typed = port.convert(value.text)
    except ValueError:  # the first value of a variable that another one replaces
        return
    if look_up is not None:
        try:
            look_up(typed)
        except InputError as error:
            yield finding(message=f"{value.lead}{error}", rule=Rule.NOT_INSTALLED)
    odd = None if port.caution is None else port.caution(typed)
    if odd is not None:
        yield finding(message=f"{value.lead}{odd}", severity=WARNING, rule=Rule.LIMIT)
