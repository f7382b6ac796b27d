"""Tables of cases in tests/data: there, `!Hover {}` is an object and `!Status IDLE` a member."""

from __future__ import annotations

from enum import EnumMeta
from pathlib import Path
from typing import Any, Final

import yaml

from uav_bt import errors, types
from uav_bt.mission.safety import Override
from uav_bt.tree import Status
from uav_bt.types.place import LandOn

_CLASSES: Final = vars(types) | vars(errors) | {c.__name__: c for c in (Override, Status, LandOn)}


class _Reader(yaml.SafeLoader):
    """Reads YAML with the names of classes as tags; `!class Name` is the class itself."""


def _object(reader: Any, name: str, node: Any) -> Any:
    if name == "class":
        return _CLASSES[reader.construct_scalar(node)]
    made = _CLASSES[name]
    if isinstance(made, EnumMeta):
        return made[reader.construct_scalar(node)]
    return made(**reader.construct_mapping(node, deep=True))


_Reader.add_multi_constructor("!", _object)


def cases(name: str) -> Any:
    """Return the content of a file of tests/data."""
    text = (Path(__file__).parents[1] / "data" / f"{name}.yaml").read_text(encoding="utf-8")
    return _Reader(text).get_single_data()
