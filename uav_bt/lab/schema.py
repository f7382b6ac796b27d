"""The JSON schema of lab files, for editors."""

from __future__ import annotations

import json
from typing import Any

from pydantic import ConfigDict, TypeAdapter
from pydantic.json_schema import GenerateJsonSchema

from uav_bt.lab.flight_keys import FlightKeys
from uav_bt.lab.lab_file import LabFile


class _Untitled(GenerateJsonSchema):
    def field_title_should_be_set(self, _: Any) -> bool:
        """Return that no field has a title, which would be its key again."""
        return False


def lab_schema() -> str:
    """Return the schema of lab files as JSON.

    YAML editors find it by a line at the head of a lab file:
    `# yaml-language-server: $schema=lab.schema.json`.
    """
    schema, shared = _schema(LabFile), _schema(FlightKeys)
    for name, part in shared["properties"].items():  # pydantic omits texts of inherited keys
        schema["properties"][name] = part
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    return json.dumps({**head, **schema, "title": "Lab file"}, indent=2) + "\n"


def _schema(form: Any) -> Any:
    config = ConfigDict(use_attribute_docstrings=True, extra="forbid")
    adapter = TypeAdapter(tuple[form], config=config)  # a dataclass takes no config by itself
    definitions = adapter.json_schema(schema_generator=_Untitled)["$defs"]
    for part in definitions.values():
        del part["title"]  # the name of a class
    return {"$defs": definitions, **definitions.pop(form.__name__)}
