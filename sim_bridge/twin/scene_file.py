"""Scene files: strict YAML in, `Scene` out, every mistake with its file and line."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from importlib import resources
from pathlib import Path

import yaml

from sim_bridge.twin.scene import (
    BoxSpec,
    Helipad,
    Lighting,
    Scene,
    TakeOffSpec,
    Vector2,
    Vector3,
    layout_problem,
)
from uav_bt.errors import SceneError, UnknownNameError, ValueRangeError, did_you_mean

__all__ = ["load_scene", "scene_names"]

_TAG = "tag:yaml.org,2002:"
_NUMBERS = {f"{_TAG}{kind}" for kind in ("int", "float")}
_WORDS = {f"{_TAG}str", *_NUMBERS}


def _shipped() -> dict[str, Path]:
    folder = Path(str(resources.files("sim_bridge.twin") / "scenes"))
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}


def scene_names() -> tuple[str, ...]:
    """Return the names of the scenes that ship with the project."""
    return tuple(_shipped())


def load_scene(name_or_path: str | Path) -> Scene:
    """Read a scene.

    Args:
        name_or_path: the name of a shipped scene, or a YAML file.

    Raises:
        UnknownNameError: neither a shipped scene nor a file.
        SceneError: the file is malformed or describes a lab that cannot be.
    """
    shipped = _shipped()
    path = shipped.get(str(name_or_path), Path(name_or_path))
    if not path.is_file():
        if path.suffix not in (".yaml", ".yml") and len(path.parts) == 1:
            raise UnknownNameError("scene", str(name_or_path), shipped)
        raise SceneError(path, "no such scene file; `uav-bt scenes` lists the shipped scenes")
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise SceneError(path, f"cannot be read as UTF-8 text: {error}") from error
    try:
        root = yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else None
        raise SceneError(path, f"not valid YAML: {error.problem}", line) from error
    except (yaml.YAMLError, RecursionError) as error:
        raise SceneError(path, f"not valid YAML: {error}") from error
    if root is None:
        raise SceneError(path, "the file is empty; a scene needs at least a helipad", 1)
    return _Reader(path).scene(root)


class _Reader:
    """Turns YAML nodes, which know their lines, into the values a scene is made of."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def scene(self, root: yaml.Node) -> Scene:
        keys = ("name", "helipad", "boxes", "lighting", "take_off")
        items = self._mapping(root, "scene", keys, required=("helipad",))
        helipad = self._helipad(items["helipad"])
        nodes = self._list(items["boxes"], "boxes") if "boxes" in items else []
        boxes = tuple(self._box(node) for node in nodes)
        problem = layout_problem(helipad, boxes)
        if problem is not None:
            raise self._error(nodes[problem[0]], problem[1])
        name = self._text(items["name"], "name") if "name" in items else self._path.stem
        lighting = self._lighting(items["lighting"]) if "lighting" in items else Lighting()
        take_off = self._take_off(items["take_off"]) if "take_off" in items else TakeOffSpec()
        try:
            return Scene(
                name=name, helipad=helipad, boxes=boxes, lighting=lighting, take_off=take_off
            )
        except ValueRangeError as error:
            raise self._error(items.get("take_off", root), str(error)) from error

    def _helipad(self, node: yaml.Node) -> Helipad:
        keys = ("position_m", "yaw_deg", "size_m")
        items = self._mapping(node, "helipad", keys, required=("position_m",))
        try:
            return Helipad(
                position_m=self._pair(items["position_m"], "position_m"),
                yaw_deg=self._number(items["yaw_deg"], "yaw_deg") if "yaw_deg" in items else 0.0,
                size_m=(
                    self._triple(items["size_m"], "size_m")
                    if "size_m" in items
                    else (0.5, 0.5, 0.4)
                ),
            )
        except ValueRangeError as error:
            raise self._error(node, str(error)) from error

    def _box(self, node: yaml.Node) -> BoxSpec:
        keys = ("pattern", "position_m", "yaw_deg", "size_m")
        items = self._mapping(node, "box", keys, required=("pattern", "position_m", "size_m"))
        try:
            return BoxSpec(
                pattern=self._integer(items["pattern"], "pattern"),
                position_m=self._pair(items["position_m"], "position_m"),
                size_m=self._triple(items["size_m"], "size_m"),
                yaw_deg=self._number(items["yaw_deg"], "yaw_deg") if "yaw_deg" in items else 0.0,
            )
        except ValueRangeError as error:
            raise self._error(node, str(error)) from error

    def _lighting(self, node: yaml.Node) -> Lighting:
        items = self._mapping(node, "lighting", ("ambient", "direction", "shadows"))
        default = Lighting()
        try:
            return Lighting(
                ambient=(
                    self._number(items["ambient"], "ambient")
                    if "ambient" in items
                    else default.ambient
                ),
                direction=(
                    self._triple(items["direction"], "direction")
                    if "direction" in items
                    else default.direction
                ),
                shadows=(
                    self._boolean(items["shadows"], "shadows")
                    if "shadows" in items
                    else default.shadows
                ),
            )
        except ValueRangeError as error:
            raise self._error(node, str(error)) from error

    def _take_off(self, node: yaml.Node) -> TakeOffSpec:
        items = self._mapping(node, "take_off", ("from", "yaw_deg"), required=("from",))
        yaw_deg = self._number(items["yaw_deg"], "yaw_deg") if "yaw_deg" in items else 0.0
        start = items["from"]
        if isinstance(start, yaml.SequenceNode):
            return TakeOffSpec(position_m=self._pair(start, "from"), yaw_deg=yaw_deg)
        word = start.value if isinstance(start, yaml.ScalarNode) else None
        if word == "random" and "yaw_deg" in items:
            raise self._error(items["yaw_deg"], "take_off: from random draws the yaw too; drop it")
        if word not in ("helipad", "random"):
            raise self._error(
                start, f"take_off: from must be helipad, random or [x, y], got {word}"
            )
        return TakeOffSpec(yaw_deg=yaw_deg, random=word == "random")

    def _mapping(
        self, node: yaml.Node, what: str, keys: Sequence[str], required: Sequence[str] = ()
    ) -> dict[str, yaml.Node]:
        if not isinstance(node, yaml.MappingNode):
            raise self._error(node, f"{what} must be a mapping of {', '.join(keys)}")
        items: dict[str, yaml.Node] = {}
        for key, value in node.value:
            name = str(key.value)
            if name not in keys:
                raise self._error(
                    key,
                    f"unknown key '{name}' in {what}{did_you_mean(name, keys)} "
                    f"(known: {', '.join(keys)})",
                )
            if name in items:
                raise self._error(key, f"key '{name}' is given twice in {what}")
            items[name] = value
        for name in required:
            if name not in items:
                raise self._error(node, f"{what} lacks the key '{name}'")
        return items

    def _list(self, node: yaml.Node, name: str) -> list[yaml.Node]:
        if not isinstance(node, yaml.SequenceNode):
            raise self._error(node, f"{name} must be a list")
        return list(node.value)

    def _number(self, node: yaml.Node, name: str) -> float:
        if isinstance(node, yaml.ScalarNode) and node.tag in _NUMBERS:
            with contextlib.suppress(ValueError):  # `!!float abc` wears the tag of a number too
                return float(yaml.SafeLoader("").construct_object(node))
        raise self._error(node, f"{name} must be a number, got {_shown(node)}")

    def _integer(self, node: yaml.Node, name: str) -> int:
        value = self._number(node, name)
        if not value.is_integer():
            raise self._error(node, f"{name} must be a whole number, got {_shown(node)}")
        return int(value)

    def _boolean(self, node: yaml.Node, name: str) -> bool:
        if isinstance(node, yaml.ScalarNode) and node.tag == f"{_TAG}bool":
            return str(node.value).lower() in ("true", "yes", "on")
        raise self._error(node, f"{name} must be true or false, got {_shown(node)}")

    def _text(self, node: yaml.Node, name: str) -> str:
        if isinstance(node, yaml.ScalarNode) and node.tag in _WORDS and node.value:
            return str(node.value)
        raise self._error(node, f"{name} must be a word, got {_shown(node)}")

    def _pair(self, node: yaml.Node, name: str) -> Vector2:
        x, y = self._numbers(node, name, 2)
        return x, y

    def _triple(self, node: yaml.Node, name: str) -> Vector3:
        x, y, z = self._numbers(node, name, 3)
        return x, y, z

    def _numbers(self, node: yaml.Node, name: str, count: int) -> list[float]:
        items = node.value if isinstance(node, yaml.SequenceNode) else []
        if len(items) != count:
            raise self._error(node, f"{name} must be a list of {count} numbers, got {_shown(node)}")
        return [self._number(item, name) for item in items]

    def _error(self, node: yaml.Node, message: str) -> SceneError:
        return SceneError(self._path, message, node.start_mark.line + 1)


def _shown(node: yaml.Node) -> str:
    if isinstance(node, yaml.ScalarNode):
        return f"'{node.value}'"
    if isinstance(node, yaml.SequenceNode):
        return f"a list of {len(node.value)}"
    return "a mapping"
