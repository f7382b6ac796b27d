"""Reader of scene files: strict YAML; each mistake is reported with its file and line."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import Annotated, Literal

import yaml
from pydantic import Field, TypeAdapter

from sim_bridge.twin.movers import MoverSpec
from sim_bridge.twin.objects import BoxSpec, Helipad, Vector2
from sim_bridge.twin.scene import (
    GroundSpec,
    Lighting,
    Scene,
    TakeOffSpec,
    layout_problem,
    traffic_problem,
)
from uav_bt.errors import SceneError, UnknownNameError, ValueRangeError
from uav_bt.lab.lab import LAB_FILE, SCENES_FOLDER
from uav_bt.lab.shipped import DEFAULT_LAB, load_lab
from uav_bt.yaml_file import read_yaml


def _shipped() -> dict[str, Path]:
    folder = Path(str(resources.files("sim_bridge.twin") / "scenes"))
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}


def scene_names() -> tuple[str, ...]:
    """Return the names of the scenes that ship with the project."""
    return tuple(_shipped())


def load_scene(name_or_path: str | Path) -> Scene:
    """Read a scene.

    Args:
        name_or_path: name of a shipped scene, or path of a YAML file.

    Raises:
        UnknownNameError: the name is neither a shipped scene nor a file.
        SceneError: the file is malformed or describes an impossible scene.
    """
    shipped = _shipped()
    path = shipped.get(str(name_or_path), Path(name_or_path))
    if not path.is_file() and path.suffix not in (".yaml", ".yml") and len(path.parts) == 1:
        raise UnknownNameError("scene", str(name_or_path), shipped)
    file = read_yaml(
        path,
        _SceneFile,
        "scene file",
        failure=SceneError,
        remedy="`uav-bt lab scenes` lists the shipped scenes",
    )
    found = file.value
    lab = _lab(path, found.lab)
    try:
        load_lab(lab)
    except UnknownNameError as error:
        raise file.error(str(error), "lab") from error
    problem = layout_problem(found.helipad, found.boxes, found.ground)
    if problem is not None:
        raise file.error(problem.message, *problem.place)
    try:
        scene = Scene(
            name=found.name or path.stem,
            helipad=found.helipad,
            boxes=found.boxes,
            ground=found.ground,
            lighting=found.lighting,
            take_off=found.take_off.spec(),
            lab=lab,
        )
    except ValueRangeError as error:
        raise file.error(str(error), "take_off") from error
    problem = traffic_problem(scene, found.movers)
    if problem is not None:
        raise file.error(problem.message, *problem.place)
    return replace(scene, movers=found.movers)


def _lab(path: Path, stated: str | None) -> str:
    """Return name or path of a scene's lab: the one it states, or the one in whose folder it lies.

    Args:
        path: Scene file.
        stated: Lab that the file states; None if it states none.
    """
    folder = path.parent.parent
    inside = path.parent.name == SCENES_FOLDER and (folder / LAB_FILE).is_file()
    if inside and stated in {None, folder.resolve().name}:
        return str(folder)
    return DEFAULT_LAB if stated is None else stated


def scene_text(scene: Scene) -> str:
    """Return a scene as the text of a scene file."""
    values, start = TypeAdapter(Scene).dump_python(scene, mode="json"), scene.take_off
    spot = "helipad" if start.position_m is None else list(start.position_m)
    values["take_off"] = (
        {"from": "random"} if start.random else {"from": spot, "yaw_deg": start.yaw_deg}
    )
    if scene.lab == DEFAULT_LAB:
        del values["lab"]
    return yaml.safe_dump(values, sort_keys=False)


@dataclass(frozen=True, kw_only=True)
class _TakeOff:
    start: Annotated[Literal["helipad", "random"] | Vector2, Field(alias="from")] = "helipad"
    yaw_deg: float | None = None

    def __post_init__(self) -> None:
        if self.start == "random" and self.yaw_deg is not None:
            raise ValueRangeError("from: random draws the yaw too; drop yaw_deg")

    def spec(self) -> TakeOffSpec:
        return TakeOffSpec(
            position_m=None if isinstance(self.start, str) else self.start,
            yaw_deg=self.yaw_deg or 0.0,
            random=self.start == "random",
        )


@dataclass(frozen=True, kw_only=True)
class _SceneFile:
    lab: str | None = None
    helipad: Helipad | None = None
    # Strict mode refuses numbers as text, but a scene may have the name 7.
    name: Annotated[str | None, Field(min_length=1, strict=False, coerce_numbers_to_str=True)] = (
        None
    )
    boxes: tuple[BoxSpec, ...] = ()
    ground: GroundSpec = field(default_factory=GroundSpec)
    movers: tuple[MoverSpec, ...] = ()
    lighting: Lighting = field(default_factory=Lighting)
    take_off: _TakeOff = field(default_factory=_TakeOff)
