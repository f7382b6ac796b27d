"""Reader of scene files: strict YAML; each mistake is reported with its file and line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter

from sim_bridge.twin.lab_of_scene import SceneLab, lab_of_scene
from sim_bridge.twin.layout import GroundSpec, LabGround, LayoutError, ground_of
from sim_bridge.twin.movers import MoverSpec
from sim_bridge.twin.objects import BoxSpec, Helipad, Vector2, Vector3
from sim_bridge.twin.placed import ObjectSpec, of_its_kind
from sim_bridge.twin.scene import Lighting, Scene, TakeOffSpec
from uav_bt.errors import InputError, SceneError, UnknownNameError, ValueRangeError
from uav_bt.lab.lab import LAB_FILE, SCENES_FOLDER
from uav_bt.lab.room import RoomSection
from uav_bt.lab.shipped import DEFAULT_LAB, default_mark, shipped_labs
from uav_bt.yaml_file import YamlFile, read_yaml, yaml_text


def shipped_scenes() -> dict[str, Path]:
    """Return the files of the scenes that ship, by name: the paper's, then those of other labs."""
    folders = [Path(str(resources.files("sim_bridge.twin") / SCENES_FOLDER))]
    folders += [folder / SCENES_FOLDER for folder in shipped_labs().values()]
    return {path.stem: path for folder in folders for path in sorted(folder.glob("*.yaml"))}


def scene_names() -> tuple[str, ...]:
    """Return the names of the scenes that ship with the project."""
    return tuple(shipped_scenes())


def load_scene(name_or_path: str | Path) -> Scene:
    """Read a scene.

    Args:
        name_or_path: name of a shipped scene, or path of a YAML file.

    Raises:
        UnknownNameError: the name is neither a shipped scene nor a file.
        SceneError: the file is malformed or describes an impossible scene.
    """
    shipped = shipped_scenes()
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
    lab = _lab_of(file)
    try:
        known = lab_of_scene(lab)
    except UnknownNameError as error:
        raise file.error(str(error), "lab") from error
    found, room = file.value, known.lab.room
    section = RoomSection() if room is None else room.section
    if found.ground is not None and section.ground is not None:
        raise file.error(f"the lab '{lab}' states its ground: remove this key", "ground")
    helipad, movers = _helipad(file, known), _movers(file, known, lab)
    try:
        return Scene(
            name=found.name or path.stem,
            helipad=helipad,
            boxes=found.boxes,
            ground=found.ground or ground_of(section.ground),
            movers=movers,
            lighting=found.lighting or _lighting(section),
            take_off=found.take_off.spec(),
            lab=lab,
            objects=found.objects,
        )
    except LayoutError as error:
        raise file.error(error.problem.message, *error.problem.place) from error
    except ValueRangeError as error:
        raise file.error(str(error), "take_off") from error


def _lab_of(file: YamlFile[_SceneFile]) -> str:
    """Return name or path of a scene's lab: the one it states, or the one in whose folder it lies.

    A lab that ships is returned by its name.
    """
    stated, folder = file.value.lab, file.path.parent.parent.resolve()
    inside = file.path.parent.name == SCENES_FOLDER and (folder / LAB_FILE).is_file()
    if not inside or stated not in {None, folder.name}:
        return DEFAULT_LAB if stated is None else stated
    ours = shipped_labs().get(folder.name)
    return folder.name if ours is not None and ours.resolve() == folder else str(folder)


def _helipad(file: YamlFile[_SceneFile], known: SceneLab) -> Helipad | None:
    """Return the landing mark; what the scene does not state is as in the lab."""
    pad, usual = file.value.helipad, known.lab.mark or default_mark()
    if pad is None:
        return None
    kind = pad.kind or usual.kind
    options = usual.options if kind == usual.kind else {}
    try:
        return Helipad(
            position_m=pad.position_m,
            yaw_deg=pad.yaw_deg,
            size_m=pad.size_m or usual.size_m,
            kind=kind,
            options=options if pad.options is None else pad.options,
        )
    except InputError as error:
        raise file.error(str(error), "helipad") from error


def _movers(file: YamlFile[_SceneFile], known: SceneLab, lab: str) -> tuple[MoverSpec, ...]:
    movers = []
    for index, mover in enumerate(file.value.movers):
        try:
            movers.append(of_its_kind(mover, known.shapes, lab))
        except ValueRangeError as error:
            raise file.error(str(error), "movers", index) from error
    return tuple(movers)


def _lighting(room: RoomSection) -> Lighting:
    if room.light is None:
        return Lighting()
    return Lighting(ambient=room.light.ambient, lamps=room.light.lamps)


def scene_text(scene: Scene) -> str:
    """Return a scene as the text of a scene file."""
    values, start = TypeAdapter(Scene).dump_python(scene, mode="json"), scene.take_off
    spot = "helipad" if start.position_m is None else list(start.position_m)
    values["take_off"] = (
        {"from": "random"} if start.random else {"from": spot, "yaw_deg": start.yaw_deg}
    )
    if scene.lab == DEFAULT_LAB:
        del values["lab"]
    if isinstance(scene.ground, LabGround):
        del values["ground"]
    for mover in values["movers"]:
        for key in ("shape", "pattern", "size_m") if mover["kind"] else ("kind",):
            del mover[key]
    for part, key in ((values, "objects"), (values["lighting"], "lamps")):
        if not part[key]:
            del part[key]
    return yaml_text(values)


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
class _Pad:
    position_m: Vector2
    yaw_deg: float = 0.0
    size_m: Vector3 | None = None
    kind: str | None = None
    options: Mapping[str, Any] | None = None


@dataclass(frozen=True, kw_only=True)
class _SceneFile:
    lab: str | None = None
    helipad: _Pad | None = None
    # Strict mode refuses numbers as text, but a scene may have the name 7.
    name: Annotated[str | None, Field(min_length=1, strict=False, coerce_numbers_to_str=True)] = (
        None
    )
    boxes: tuple[BoxSpec, ...] = ()
    objects: tuple[ObjectSpec, ...] = ()
    ground: GroundSpec | None = None
    movers: tuple[MoverSpec, ...] = ()
    lighting: Lighting | None = None
    take_off: _TakeOff = field(default_factory=_TakeOff)
