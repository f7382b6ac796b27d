"""Reader of scene files: strict YAML; each mistake is reported with its file and line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import Field, TypeAdapter

from sim_bridge.twin.layout import MAX_MOVERS, LayoutError
from sim_bridge.twin.movers import MoverSpec
from sim_bridge.twin.objects import Helipad, ObjectSpec
from sim_bridge.twin.scene import Lighting, Scene, TakeOffSpec
from sim_bridge.twin.shapes import PRINTED, Vector2, lab_of_scene
from uav_bt.errors import InputError, SceneError, UnknownNameError, ValueRangeError
from uav_bt.lab.lab import LAB_FILE, LABS_FOLDER, SCENES_FOLDER, Lab
from uav_bt.lab.room import RoomSection
from uav_bt.lab.shipped import DEFAULT_LAB, default_mark, shipped_labs
from uav_bt.lab.surface import SIDE_PAPERS
from uav_bt.yaml_file import Steps, YamlFile, read_yaml, yaml_text

MAX_OBJECTS: Final = 200


def shipped_scenes() -> dict[str, Path]:
    """Return the files of the scenes that ship, by name: the paper's, then those of other labs."""
    folders = [Path(str(resources.files("sim_bridge.twin") / SCENES_FOLDER))]
    folders += [folder / SCENES_FOLDER for folder in shipped_labs().values()]
    return {path.stem: path for folder in folders for path in sorted(folder.glob("*.yaml"))}


def scene_files() -> dict[str, list[Path]]:
    """Return the files of each scene that ships, and of those of the labs in `labs/`, by name."""
    found = {name: [path] for name, path in shipped_scenes().items()}
    for file in sorted(Path(LABS_FOLDER).glob(f"*/{SCENES_FOLDER}/*.yaml")):
        if file.stem not in shipped_scenes():  # that of the shipped lab, or a copy of it
            found.setdefault(file.stem, []).append(file)
    return found


def scene_path(name_or_path: str | Path) -> Path:
    """Return the file of a scene, by its name in `scene_files` or by its path."""
    name, path, known = str(name_or_path), Path(name_or_path), scene_files()
    if name not in known:
        if path.is_file() or path.suffix in (".yaml", ".yml") or len(path.parts) != 1:
            return path
        own = f"{Path(LABS_FOLDER).resolve()}/*/{SCENES_FOLDER}"
        looked = f"no file; known are the shipped ones and those in {own}"
        raise UnknownNameError("scene", name, known, looked)
    if len(known[name]) > 1:
        paths = ", ".join(map(str, known[name]))
        raise InputError(f"several labs have a scene '{name}': give --lab, or a path ({paths})")
    return known[name][0]


def load_scene(name_or_path: str | Path) -> Scene:
    """Read a scene by its name, or by the path of a YAML file; see `scene_path`.

    Raises:
        UnknownNameError: the name is neither a known scene nor a file.
        SceneError: the file is malformed or describes an impossible scene.
    """
    path = scene_path(name_or_path)
    file = read_yaml(
        path,
        _SceneFile,
        "scene file",
        failure=SceneError,
        remedy="`uav-bt lab scenes` lists the shipped scenes",
    )
    found, lab = file.value, _lab_of(file)
    with file.at("lab"):
        known = lab_of_scene(lab).lab
    section = RoomSection() if known.room is None else known.room.section
    if found.ground is not None and section.ground is not None:
        raise file.error(f"the lab '{lab}' states its ground: remove this key", "ground")
    with file.at("helipad"):
        helipad = None if found.helipad is None else _helipad(found.helipad, known)
    light = section.light
    usual = Lighting() if light is None else Lighting(ambient=light.ambient, lamps=light.lamps)
    try:
        return Scene(
            name=found.name or path.stem,
            helipad=helipad,
            objects=(*(box.spec() for box in found.boxes), *found.objects),
            ground_size_m=None if found.ground is None else found.ground.size_m,
            movers=found.movers,
            lighting=found.lighting or usual,
            take_off=found.take_off.spec(),
            lab=lab,
        )
    except LayoutError as error:
        items: list[Steps] = [
            (key, n) for key in ("boxes", "objects") for n in range(len(getattr(found, key)))
        ]
        raise file.errors(
            (items[int(one.place[1])] if one.place[0] == "objects" else one.place, str(one))
            for one in (error, *error.others)
        ) from error


def _lab_of(file: YamlFile[_SceneFile]) -> str:
    """Return the name or path of the lab that a scene states, or in whose folder it lies."""
    stated, folder = file.value.lab, file.path.parent.parent.resolve()
    inside = file.path.parent.name == SCENES_FOLDER and (folder / LAB_FILE).is_file()
    if not inside or stated not in {None, folder.name}:
        return DEFAULT_LAB if stated is None else stated
    ours = shipped_labs().get(folder.name)
    return folder.name if ours is not None and ours.resolve() == folder else str(folder)


def _helipad(pad: _Pad, lab: Lab) -> Helipad:
    """Return the landing mark; what the scene does not state is as in the lab."""
    usual = lab.mark or default_mark()
    kind = pad.kind or usual.kind
    options = usual.options if kind == usual.kind else {}
    return Helipad(
        position_m=pad.position_m,
        yaw_deg=pad.yaw_deg,
        size_m=pad.size_m or usual.size_m,
        kind=kind,
        options=options if pad.options is None else pad.options,
    )


def scene_text(scene: Scene) -> str:
    """Return a scene as the text of a scene file."""
    values = TypeAdapter(Scene).dump_python(scene, mode="json", exclude_defaults=True)
    if scene.helipad is not None:  # in full, as the lab may have another mark
        values["helipad"] = TypeAdapter(Helipad).dump_python(scene.helipad, mode="json")
    size_m, start = values.pop("ground_size_m", None), scene.take_off
    if size_m is not None:
        values["ground"] = {"size_m": size_m}
    spot = "helipad" if start.position_m is None else list(start.position_m)
    values["take_off"] = (
        {"from": "random"} if start.random else {"from": spot, "yaw_deg": start.yaw_deg}
    )
    for mover in values.get("movers", ()):
        if "kind" in mover:
            for key in ("shape", "size_m"):
                mover.pop(key, None)
    return yaml_text(values)


# --- the form of a file ---------------------------------------------------------------------------

_Side = Annotated[float, Field(ge=0.05)]
_GroundSide = Annotated[float, Field(ge=2.0, le=12.0)]


@dataclass(frozen=True, kw_only=True)
class _Box:
    pattern: Annotated[int, Field(ge=1, le=len(SIDE_PAPERS))]
    position_m: Vector2
    yaw_deg: float = 0.0
    size_m: tuple[_Side, _Side, Annotated[float, Field(ge=0.05, le=4.0)]]  # below the ceiling

    def spec(self) -> ObjectSpec:
        return ObjectSpec(
            kind=f"{PRINTED}{self.pattern}",
            position_m=self.position_m,
            yaw_deg=self.yaw_deg,
            size_m=self.size_m,
        )


@dataclass(frozen=True, kw_only=True)
class _Ground:
    size_m: tuple[_GroundSide, _GroundSide]


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
    size_m: tuple[_Side, _Side, Annotated[float, Field(ge=0.0, le=4.0)]] | None = None
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
    boxes: Annotated[tuple[_Box, ...], Field(max_length=MAX_OBJECTS)] = ()
    objects: Annotated[tuple[ObjectSpec, ...], Field(max_length=MAX_OBJECTS)] = ()
    ground: _Ground | None = None
    movers: Annotated[tuple[MoverSpec, ...], Field(max_length=MAX_MOVERS)] = ()
    lighting: Lighting | None = None
    take_off: _TakeOff = field(default_factory=_TakeOff)
