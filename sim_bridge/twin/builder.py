"""Builder of a MuJoCo model: the drone, textures, drawn surfaces and contacts.

Separate geoms serve the camera (meshes with exact texture coordinates) and the contacts (plain
boxes, cylinders and convex meshes). The drone's geom is in a group that its camera never draws.
The name of a contact is the part of its geom's name before the slash.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_bridge.twin.body import CONTROL_STEP_S, HULL_HALF_M
from sim_bridge.twin.gl import mujoco
from sim_bridge.twin.solids import Mesh, Solid, yaw_quaternion
from uav_bt.errors import InputError

HULL_MASS_KG = 0.32  # mass of the ANAFI
STEPS_PER_CONTROL = 2
PHYSICS_STEP_S = CONTROL_STEP_S / STEPS_PER_CONTROL  # short enough for contacts at 1 m/s
HIT_GROUP = 3  # geom group that MuJoCo does not draw by default

_SEEN_GROUP = 0
_DRONE_GROUP = 4  # not drawn by default either: the camera never sees the drone


@dataclass(frozen=True, kw_only=True)
class LabModel:
    """A compiled scene."""

    model: Any  # mujoco.MjModel
    class_of_geom: NDArray[np.uint8]  # (number of geoms,): class id of each geom
    hull_geom: int
    hull_body: int
    obstacle_geoms: tuple[int, ...]  # contact geoms of obstacles

    def contact_name(self, geom: int) -> str:
        """Return the name in contacts of a geom: that of its object."""
        return _contact_name(self.model, geom)


def _contact_name(model: Any, geom: int) -> str:
    name: str = model.geom(geom).name
    return name.split("/", maxsplit=1)[0]


class Builder:
    """Builds a model with the drone.

    Args:
        drawn: whether a camera looks at it; if not, textures and visible surfaces are left out.
        far_m: largest distance that the camera sees.
    """

    def __init__(self, *, drawn: bool, far_m: float) -> None:
        self.drawn = drawn
        self.spec = mujoco.MjSpec()
        self.spec.option.timestep = PHYSICS_STEP_S
        self.spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
        # Clipping: the near plane shows all that the hull almost touches, the far plane the room.
        self.spec.stat.extent = 8.0
        self.spec.stat.center = (0.0, 0.0, 1.0)
        self.spec.visual.map.znear = 0.02 / 8.0
        self.spec.visual.map.zfar = far_m / 8.0
        self.spec.visual.map.shadowclip = 1.0
        self.spec.visual.quality.shadowsize = 2048
        self.spec.visual.headlight.active = 0
        self._classes: dict[str, int] = {}
        self._drone()

    def done(self, obstacles: Collection[str]) -> LabModel:
        """Compile the model.

        Args:
            obstacles: names in contacts of boxes, objects and movers.

        Raises:
            InputError: MuJoCo cannot build a mesh.
        """
        try:
            model = self.spec.compile()
        except ValueError as error:
            raise InputError(f"MuJoCo cannot build this scene: {error}") from error
        ids = np.zeros(model.ngeom, np.uint8)
        for name, class_id in self._classes.items():
            ids[model.geom(name).id] = class_id
        hit = np.flatnonzero(model.geom_group == HIT_GROUP).tolist()
        return LabModel(
            model=model,
            class_of_geom=ids,
            hull_geom=model.geom("drone").id,
            hull_body=model.body("drone").id,
            obstacle_geoms=tuple(geom for geom in hit if _contact_name(model, geom) in obstacles),
        )

    def _drone(self) -> None:
        body = self.spec.worldbody.add_body(name="drone")
        body.add_freejoint(name="drone")
        body.add_geom(
            name="drone",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=HULL_HALF_M,
            mass=HULL_MASS_KG,
            group=_DRONE_GROUP,
            rgba=(0.25, 0.26, 0.28, 1.0),
            friction=(0.8, 0.01, 0.001),
        )

    def texture(self, name: str, make: Callable[[], NDArray[np.uint8]]) -> None:
        """Add a material with a texture, unless there is one of that name."""
        if not self.drawn or self.spec.material(name) is not None:
            return  # another object uses the same texture
        image = make()
        texture = self.spec.add_texture(
            name=name,
            type=mujoco.mjtTexture.mjTEXTURE_2D,
            width=image.shape[1],
            height=image.shape[0],
            nchannel=3,
        )
        # MuJoCo's v axis points up in the image, ours points down.
        texture.data = np.ascontiguousarray(image[::-1]).tobytes()
        material = self.spec.add_material(name=name, specular=0.0, shininess=0.0)
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name

    def show(
        self,
        name: str,
        solid: Solid,
        *,
        material: str,
        class_id: int,
        tile_m: tuple[float, float],
        body: Any = None,
    ) -> None:
        """Add a visible solid without contacts to a body or to the world."""
        self.show_mesh(
            name,
            lambda: solid.mesh(tile_m),
            centre_m=solid.centre_m,
            yaw_rad=solid.yaw_rad,
            material=material,
            class_id=class_id,
            body=body,
        )

    def show_mesh(
        self,
        name: str,
        make: Callable[[], Mesh],
        *,
        centre_m: tuple[float, float, float],
        yaw_rad: float,
        material: str,
        class_id: int,
        body: Any = None,
        shared: str | None = None,
    ) -> None:
        """Add a visible mesh without contacts.

        Args:
            name: of the geom.
            make: returns the mesh.
            centre_m: place of its origin.
            yaw_rad: its yaw, counter-clockwise.
            material: name of its texture.
            class_id: its class.
            body: what carries it; default: the world.
            shared: name of the mesh, if several geoms show it.
        """
        if not self.drawn:
            return
        asset = shared or name
        if self.spec.mesh(asset) is None:
            vertices, faces, coordinates = make()
            mesh = self.spec.add_mesh(name=asset)
            mesh.uservert = vertices.ravel()
            mesh.userface = faces.ravel()
            mesh.usertexcoord = coordinates.ravel()
            mesh.userfacetexcoord = faces.ravel()
        (body or self.spec.worldbody).add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=asset,
            pos=centre_m,
            quat=yaw_quaternion(yaw_rad),
            material=material,
            group=_SEEN_GROUP,
            contype=0,
            conaffinity=0,
        )
        self._classes[name] = class_id

    def hit(self, name: str, solid: Solid, body: Any = None) -> None:
        """Add an invisible geom with contacts to a body or to the world."""
        radius, _, half_height = solid.half_m
        kinds = mujoco.mjtGeom
        (body or self.spec.worldbody).add_geom(
            name=name,
            type=kinds.mjGEOM_CYLINDER if solid.round else kinds.mjGEOM_BOX,
            size=(radius, half_height, 0.0) if solid.round else solid.half_m,
            pos=solid.centre_m,
            quat=yaw_quaternion(solid.yaw_rad),
            group=HIT_GROUP,
        )

    def hit_hull(
        self,
        name: str,
        vertices: NDArray[np.float64],
        *,
        shared: str,
        centre_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
        yaw_rad: float = 0.0,
        body: Any = None,
    ) -> None:
        """Add an invisible geom with contacts: the convex hull of vertices, (N, 3)."""
        if self.spec.mesh(shared) is None:
            self.spec.add_mesh(name=shared).uservert = vertices.astype(np.float32).ravel()
        (body or self.spec.worldbody).add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=shared,
            pos=centre_m,
            quat=yaw_quaternion(yaw_rad),
            group=HIT_GROUP,
        )
