"""Shapes of objects: the kinds of a lab, and boxes in printed paper.

The drawn surfaces, the contacts, the rays of the drone without images and the ground computations
all come from the parts of a shape, or from the triangles of a mesh.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import UnknownNameError
from uav_bt.lab.lab import LAB_FILE, LABS_FOLDER, Lab
from uav_bt.lab.obj_file import pieces
from uav_bt.lab.room import ROOF_PAPERS, SIDE_PAPERS, ObjectKind, Surface
from uav_bt.lab.shipped import load_lab, shipped_labs
from uav_bt.types import Pose2D
from uav_bt.types.ground import Block, Footprint, Standing

Vector2 = tuple[float, float]
Vector3 = tuple[float, float, float]

ORIGIN: Final = Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0)
PRINTED: Final = "box-"  # with the number of a pattern the kind of a box in printed paper
_KEPT: Final = 16  # labs
_OVERHANG_M: Final = 0.05  # of a table's top over its legs, if it is large enough; chosen
_INSET_M: Final = 0.004  # of shelves within their posts, so that no two faces lie in one plane
_LOWEST_SHELF_M: Final = 0.12  # upper side of a rack's lowest shelf
_BELOW_POSTS_M: Final = 0.02  # of a rack's highest shelf


@dataclass(frozen=True, kw_only=True)
class Part(Block):
    """An upright box or cylinder of an object, in the axes of the object."""

    frame: bool = False  # a leg or a post
    roofed: bool = False  # its upper side has the class and look of the object's top


@dataclass(frozen=True, kw_only=True, eq=False)
class Shape:
    """A kind of object as the twin builds it."""

    name: str  # of the kind, and of its size if that is another
    kind: ObjectKind
    class_id: int  # of its surfaces
    top_class: int  # of its upper face
    mesh: NDArray[np.float64] | None = None  # (N, 3, 3) triangles; None: the parts are the shape

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """Its boxes and cylinders; of a mesh the boxes around its connected pieces."""
        if self.mesh is not None:
            return tuple(_around(piece) for piece in pieces(self.mesh))
        parts_of = {"table": _table, "rack": _rack}.get(self.kind.shape, _whole)
        return tuple(parts_of(self.kind))

    @cached_property
    def outline(self) -> Standing:
        """The shape at the origin."""
        return self.standing(ORIGIN)

    def standing(self, pose: Pose2D) -> Standing:
        """Return the shape at a place on the ground."""
        whole = next(_whole(self.kind)).at(pose)
        blocks = tuple(part.at(pose) for part in self.parts)
        return Standing(
            footprint=whole.footprint,
            height_m=whole.top_m,
            class_id=self.class_id,
            parts=() if len(blocks) == 1 and self.mesh is None else blocks,
        )

    def of_size(self, size_m: Vector3, form: Literal["box", "cylinder"] | None = None) -> Shape:
        """Return the shape with another size, and as a box or cylinder if one is given."""
        kind = replace(self.kind, size_m=size_m, shape=form or self.kind.shape)
        if kind == self.kind:
            return self
        mesh = self.mesh
        if mesh is not None:
            mesh = mesh * (np.array(size_m) / self.kind.size_m)
        return replace(self, name=f"{self.name}-{kind.shape}-{size_m}", kind=kind, mesh=mesh)


def block(half_m: Vector2, base_m: float, top_m: float, at_m: Vector2 = (0.0, 0.0)) -> Part:
    """Return a box between two heights, by its half sizes and centre."""
    outline = Footprint(x_m=at_m[0], y_m=at_m[1], half_x_m=half_m[0], half_y_m=half_m[1])
    return Part(footprint=outline, base_m=base_m, top_m=top_m)


def _whole(kind: ObjectKind) -> Iterator[Part]:
    length_m, width_m, height_m = kind.size_m
    part = block((length_m / 2, width_m / 2), 0.0, height_m)
    outline = replace(part.footprint, round=kind.shape == "cylinder")
    yield replace(part, footprint=outline, roofed=True)


def _table(kind: ObjectKind) -> Iterator[Part]:
    length_m, width_m, height_m = kind.size_m
    below_m = height_m - kind.board_m
    inset_m = min(_OVERHANG_M, min(length_m, width_m) / 2 - kind.post_m)
    yield replace(block((length_m / 2, width_m / 2), below_m, height_m), roofed=True)
    yield from _legs(kind, inset_m, below_m)


def _rack(kind: ObjectKind) -> Iterator[Part]:
    length_m, width_m, height_m = kind.size_m
    half_m = (length_m / 2 - _INSET_M, width_m / 2 - _INSET_M)
    lowest_m = max(_LOWEST_SHELF_M, kind.board_m) if kind.shelves > 1 else height_m
    tops_m = np.linspace(min(lowest_m, height_m), height_m, kind.shelves) - _BELOW_POSTS_M
    for top_m in tops_m.tolist():
        shelf = block(half_m, max(top_m - kind.board_m, 0.0), top_m)
        yield replace(shelf, roofed=top_m == tops_m[-1])
    yield from _legs(kind, 0.0, height_m)


def _legs(kind: ObjectKind, inset_m: float, top_m: float) -> Iterator[Part]:
    """Yield four legs at the corners, moved inwards."""
    half_m = kind.post_m / 2
    x_m, y_m = (side / 2 - inset_m - half_m for side in kind.size_m[:2])
    for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
        leg = block((half_m, half_m), 0.0, top_m, (sx * x_m, sy * y_m))
        yield replace(leg, frame=True)


def _around(piece: NDArray[np.float64]) -> Part:
    low, high = piece.min(axis=(0, 1)), piece.max(axis=(0, 1))
    (x_m, y_m, _), (half_x_m, half_y_m, _) = (
        ((low + high) / 2).tolist(),
        ((high - low) / 2).tolist(),
    )
    return block((half_x_m, half_y_m), float(low[2]), float(high[2]), (x_m, y_m))


# --- the kinds of a lab ---------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class SceneLab:
    """A lab with the shapes that its scenes may place, by the names of their kinds."""

    lab: Lab
    shapes: Mapping[str, Shape]

    def shape(self, kind: str) -> Shape:
        """Return the shape of a kind; refuse an unknown name."""
        if kind not in self.shapes:
            raise UnknownNameError("kind of object", kind, self.shapes)
        return self.shapes[kind]


def lab_of_scene(name: str) -> SceneLab:
    """Return a lab by name or path; it is read once while its file stays the same."""
    places = (shipped_labs().get(name), Path(LABS_FOLDER) / name, Path(name))
    files = (place / LAB_FILE for place in places if place is not None)
    file = next((each for each in files if each.is_file()), Path(name))
    stamp = (str(file.resolve()), file.stat().st_mtime_ns) if file.is_file() else None
    return _read(name, stamp)


@lru_cache(maxsize=_KEPT)
def _read(name: str, _stamp: tuple[str, int] | None) -> SceneLab:
    lab = load_lab(name)
    kinds = {
        f"{PRINTED}{number}": _printed(number, lab.classes.names[class_id])
        for number, class_id in enumerate(lab.classes.standing[: len(SIDE_PAPERS)], start=1)
    }
    kinds |= lab.room.section.objects if lab.room is not None else {}
    meshes = lab.room.meshes if lab.room is not None else {}
    shapes = {}
    for kind_name, kind in kinds.items():
        class_id = lab.classes.id_of(kind.class_name)
        shapes[kind_name] = Shape(
            name=kind_name,
            kind=kind,
            class_id=class_id,
            top_class=int(lab.classes.top_of[class_id]) or class_id,
            mesh=meshes.get(kind_name),
        )
    return SceneLab(lab=lab, shapes=shapes)


def _printed(number: int, class_name: str) -> ObjectKind:
    """Return the kind of a box in printed paper, of which each lab has one for each class."""
    return ObjectKind(
        class_name=class_name,
        shape="box",
        size_m=(0.4, 0.4, 1.7),
        surface=Surface(generator=SIDE_PAPERS[number - 1]),
        top=Surface(generator=ROOF_PAPERS[(number - 1) % len(ROOF_PAPERS)]),
    )
