"""Shapes of objects: the kinds of a lab, and boxes in printed paper.

The drawn surfaces, the contacts, the rays of the drone without images and the ground computations
all come from the parts of a shape, or from the triangles of a mesh.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from sim_bridge.twin.furniture import Part, block, parts_of, whole
from uav_bt.errors import UnknownNameError
from uav_bt.lab.classes import OUTSIDE
from uav_bt.lab.lab import LAB_FILE, LABS_FOLDER, Lab
from uav_bt.lab.obj_file import pieces
from uav_bt.lab.room import ObjectKind
from uav_bt.lab.shipped import load_lab, shipped_labs
from uav_bt.lab.surface import ROOF_PAPERS, SIDE_PAPERS, Surface
from uav_bt.types import Pose2D
from uav_bt.types.ground import Standing

Vector2 = tuple[float, float]
Vector3 = tuple[float, float, float]

ORIGIN: Final = Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0)
PRINTED: Final = "box-"  # with the number of a pattern the kind of a box in printed paper
_KEPT: Final = 16  # labs


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
        return parts_of(self.kind)

    @cached_property
    def outline(self) -> Standing:
        """The shape at the origin."""
        return self.standing(ORIGIN)

    def standing(self, pose: Pose2D) -> Standing:
        """Return the shape at a place on the ground."""
        around = next(whole(self.kind)).at(pose)
        blocks = tuple(part.at(pose) for part in self.parts)
        return Standing(
            footprint=around.footprint,
            height_m=around.top_m,
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
        class_id = lab.classes.id_of(kind.class_name) if kind.class_name else OUTSIDE
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
