"""The options of a landing mark, read into the form of its kind."""

from __future__ import annotations

from typing import TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from uav_bt.errors import ValueRangeError, did_you_mean
from uav_bt.types import LandingMark

OptionsT = TypeVar("OptionsT", bound="Options")


class Options(BaseModel):
    """The options of a kind that has none; base of the forms of others."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


def read_options(mark: LandingMark, form: type[OptionsT]) -> OptionsT:
    """Return the options of a landing mark; raises ValueRangeError for the first wrong one."""
    try:
        return form.model_validate(dict(mark.options))
    except ValidationError as error:
        wrong = error.errors(include_url=False)[0]
    steps, kind = [str(step) for step in wrong["loc"]], f"landing mark '{mark.kind}'"
    where, message = ".".join(steps), wrong["msg"].removeprefix("Input ")
    if wrong["type"] == "extra_forbidden":
        schema = form.model_json_schema()
        if len(steps) > 1:  # a form has one nested form at most
            [schema] = schema["$defs"].values()
        known = list(schema["properties"])
        raise ValueRangeError(
            f"{kind} has no option '{where}'{did_you_mean(steps[-1], known)} "
            f"(options: {', '.join(known) or 'none'})"
        )
    if wrong["type"] == "missing":
        raise ValueRangeError(f"{kind} needs the option {where}")
    if wrong["type"] == "value_error":
        raise ValueRangeError(f"{kind} {wrong['ctx']['error']}")
    raise ValueRangeError(f"option {where} of {kind} {message}, got {wrong['input']!r}")
