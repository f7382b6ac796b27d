"""The JSON schema of lab files, for editors."""

from __future__ import annotations

import json
from typing import Any

from pydantic import ConfigDict, TypeAdapter

from uav_bt.lab.flight_keys import FlightKeys
from uav_bt.lab.lab_file import LabFile


def lab_schema() -> str:
    """Return the schema of lab files as JSON.

    YAML editors find it by a line at the head of a lab file:
    `# yaml-language-server: $schema=lab.schema.json`.
    """
    schema, shared = _schema(LabFile), _schema(FlightKeys)
    for name, part in shared["properties"].items():  # pydantic omits texts of inherited keys
        schema["properties"][name] = part
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "Lab file"}
    return json.dumps({**head, **_closed(schema)}, indent=2) + "\n"


def _schema(form: Any) -> Any:
    config = ConfigDict(use_attribute_docstrings=True)
    whole = TypeAdapter(tuple[form], config=config).json_schema()  # a dataclass takes no config
    return {"$defs": whole["$defs"], **whole["$defs"].pop(form.__name__)}


def _closed(part: Any) -> Any:
    """Return a part of a schema without titles, in which objects refuse unknown keys."""
    if isinstance(part, list):
        return [_closed(each) for each in part]
    if not isinstance(part, dict):
        return part
    closed = {
        name: _closed(value)
        for name, value in part.items()
        if not (name == "title" and isinstance(value, str))  # pydantic repeats the key
    }
    if "properties" in closed and closed.get("type") == "object":
        closed["additionalProperties"] = False
    return closed
