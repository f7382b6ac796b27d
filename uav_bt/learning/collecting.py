"""Collection of training flights: rule or student flies, and the rule labels each view.

plan = CollectionPlan("explore_and_land_advised", flights=96)
collect(plan, Path("runs/collected"))
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, field
from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np
from annotated_types import Ge

from sim_bridge.twin.scene_file import load_scene, scene_text
from sim_bridge.twin.variation import varied_scene
from uav_bt import app
from uav_bt import campaign as campaigns
from uav_bt.app.option_values import ImageSize, Policies, Seed
from uav_bt.board import ADVICE
from uav_bt.campaign.runner import Backend, Progress
from uav_bt.errors import InputError
from uav_bt.files import write_whole
from uav_bt.learning.views import TRAINING_SCENES
from uav_bt.option import Option
from uav_bt.tree.loading.attributes import POLICY_PORT

_Profile = Literal["ideal", "lab", "harsh"]
_TIMEOUT_S: Final = 1800.0  # of one flight, wall time


@dataclass(frozen=True)
class CollectionPlan:
    """Plan of a collection; the flights are distributed evenly over scenes and profiles.

    Options:
        flights: Minimum in all, shared evenly over scenes and profiles.
        scenes: Scene to begin with, by name or file. Repeatable.
        profiles: How imperfect the twin is. Repeatable.
        layouts: Vary the boxes, too, in all flights but the first of each scene; light always
            varies.
    """

    tree: str
    _: KW_ONLY
    flights: Annotated[int, Ge(1)] = 96
    scenes: Annotated[tuple[str, ...], Option(form="--scene SCENE")] = TRAINING_SCENES
    profiles: Annotated[tuple[_Profile, ...], Option(form="--profile")] = ("lab", "harsh")
    layouts: bool = True  # so that the network does not memorise a few layouts
    seed: Seed = 0
    image_size_px: ImageSize = (640, 360)
    policies: Policies = field(default_factory=dict)

    @property
    def each(self) -> int:
        """Number of flights per scene and profile."""
        return -(-self.flights // (len(self.scenes) * len(self.profiles)))

    def __len__(self) -> int:
        return self.each * len(self.scenes) * len(self.profiles)


def collect(
    plan: CollectionPlan,
    folder: Path,
    *,
    backend: Backend | None = None,
    on_flight: Progress = lambda _flight, _now: None,
    on_note: Callable[[str], None] = lambda _: None,
) -> list[Path]:
    """Fly the flights of a plan that are missing in its folder, and return the records."""
    if not any(ADVICE in leaf.writes for leaf in app.check(plan.tree).leaves()):
        raise InputError(
            f"no leaf of '{plan.tree}' writes '{ADVICE.name}', so its records have no labels: put "
            '<RememberViews/> and <Advise policy="corridor"/> behind <BuildCorridor/>, as '
            "explore_and_land_advised has it"
        )
    scenes = _scenes(plan, folder / "scenes")
    records: list[Path] = []
    for profile in plan.profiles:
        flown = campaigns.make_plan(
            [plan.tree],
            scenes=scenes[profile],
            flights=1,
            policies=plan.policies,
            seed_from=plan.seed,
            profile=profile,
            image_size_px=plan.image_size_px,
            record=True,
            record_quality="small",
            timeout_s=_TIMEOUT_S,
        )
        home = folder / profile
        result = campaigns.run(flown, home, backend=backend, on_flight=on_flight, on_note=on_note)
        # A flight whose process crashed may have left no record or a partial one.
        whole = [one for one in result.flights if one["outcome"] != "error"]
        records += [home / one["record"] for one in whole if one.get("record")]
    return [record for record in records if record.is_file()]


def nodes_under_policy(tree: str) -> list[str]:
    """Return the names of a tree's leaves that fly by a policy, not only advise by it."""
    return [
        leaf.name
        for leaf in app.check(tree).leaves()
        if ADVICE not in leaf.writes and any(port.name == POLICY_PORT for port in leaf.ports)
    ]


def _scenes(plan: CollectionPlan, folder: Path) -> dict[str, list[str]]:
    """Return the scenes of each profile; random ones are written to files."""
    folder.mkdir(parents=True, exist_ok=True)
    found: dict[str, list[str]] = {profile: [] for profile in plan.profiles}
    for name in plan.scenes:
        scene = load_scene(name)
        for profile, scenes in found.items():
            scenes.append(name)
            for number in range(1, plan.each):
                called = f"{scene.name}-{profile}-{plan.seed}-{number}"
                # Seeded by name, so that a scene does not depend on the others.
                rng = np.random.default_rng(zlib.crc32(called.encode()))
                drawn = varied_scene(scene, rng, name=called, layout=plan.layouts)
                path = folder / f"{called}.yaml"
                write_whole(path, scene_text(drawn))
                scenes.append(str(path))
    return found
