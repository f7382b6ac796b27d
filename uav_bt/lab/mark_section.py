"""The section `mark` of lab and site files: kind, size, height and options of the landing mark."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field
from typing_extensions import TypedDict

from uav_bt.plugins import make_mark_finder
from uav_bt.types.landing_mark import MAX_HEIGHT_M, LandingMark

_Side = Annotated[float, Field(gt=0.0, le=5.0)]


_Height = Annotated[float, Field(ge=0.0, lt=MAX_HEIGHT_M)]


class _Kind(TypedDict, total=False):
    kind: str
    options: dict[str, Any]


class MarkSection(_Kind, total=False):
    """Form of the section of a site file. Missing keys keep the values of the lab's mark.

    Attributes:
        kind: Registered name of the plug-in that finds the mark.
        options: Settings of the plug-in.
        size_m: Length and width of the top, metres.
        height_m: Height of the top above the ground, metres; 0 for a mat.
    """

    size_m: tuple[_Side, _Side]
    height_m: _Height


class WholeMarkSection(_Kind):
    """Form of the section of a lab file, which states the size."""

    size_m: tuple[_Side, _Side]
    height_m: _Height


def mark_of_section(
    section: MarkSection | WholeMarkSection, usual: LandingMark | None = None
) -> LandingMark:
    """Return the landing mark that a section describes.

    Args:
        section: Content of the section.
        usual: Source of the missing keys; None if the section is whole. Options belong to a kind,
            so another kind begins without options.

    Raises:
        InputError: The kind is not registered, or refuses an option.
    """
    kind = section.get("kind", "helipad" if usual is None else usual.kind)
    kept = {} if usual is None or usual.kind != kind else usual.options
    length_m, width_m = section["size_m"] if usual is None else section.get("size_m", usual.top_m)
    mark = LandingMark(
        kind=kind,
        length_m=length_m,
        width_m=width_m,
        height_m=section["height_m"] if usual is None else section.get("height_m", usual.height_m),
        options=section.get("options", kept),
    )
    if "kind" in section or "options" in section:
        make_mark_finder(mark)  # refuses wrong options
    return mark
