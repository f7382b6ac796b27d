"""Reduction of a failed flight to the fewest objects, movers and faults that still fail.

The parts are removed by delta debugging (Zeller and Hildebrandt, 2002): larger groups first, then
single ones, until no part can be left out.
"""

from __future__ import annotations

import json
import re
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar

from sim_bridge.twin.scene import Scene
from sim_bridge.twin.scene_file import load_scene, scene_text
from sim_bridge.twin.variation import varied
from uav_bt import app
from uav_bt.app.drone_of_flight import is_simulated
from uav_bt.app.flying_process import interruptible
from uav_bt.app.options import FlightOptions
from uav_bt.errors import InputError
from uav_bt.mission.judge import Outcome

Part = TypeVar("Part")

_DETAILS: Final = "details"  # key of a line whose flight did not end by itself
# Options as they were flown.
_OF_THE_LINE: Final = ("drone", "profile", "ports", "variables", "exact_masks")
_BOX: Final = "box"
_OBJECT: Final = "object"
_MOVER: Final = "mover"
_FAULT: Final = "fault"
_NUMBER: Final = re.compile(r"-?\d+(\.\d+)?")


class Ending(NamedTuple):
    """How a flight ended: the outcome and the reason."""

    outcome: str
    reason: str

    def __str__(self) -> str:
        return f"{self.outcome}: {self.reason}"

    def agrees(self, other: Ending) -> bool:
        """Return whether two flights ended for the same cause; numbers may differ."""
        reasons = {_NUMBER.sub("#", ending.reason) for ending in (self, other)}
        return self.outcome == other.outcome and len(reasons) == 1


@dataclass(frozen=True, kw_only=True)
class FailedFlight:
    """A flight of a campaign that failed, with everything drawn for it.

    Attributes:
        tree: The mission: a file or the name of a shipped one.
        scene: The scene with the room and the movers that were drawn.
        options: How it was flown; without scene, movers and faults.
        faults: The faults of the drone.
        ending: How it ended.
    """

    tree: str
    scene: Scene
    options: FlightOptions
    faults: tuple[str, ...]
    ending: Ending

    @classmethod
    def of(
        cls, flight: Mapping[str, Any], tree: str, scene: str, options: FlightOptions
    ) -> FailedFlight:
        """Return a flight from its line.

        Args:
            flight: The line.
            tree: The mission that was flown.
            scene: The scene file or the name of the scene.
            options: How the campaign was flown.

        Raises:
            InputError: The flight did not fail, it cannot be flown again, or its scene cannot be
                read.
        """
        if flight["outcome"] == Outcome.SUCCESS.value:
            raise InputError(
                f"the flight of {flight['tree']} in {flight['scene']}, seed {flight['seed']}, "
                "succeeded; there is nothing to shrink"
            )
        if _DETAILS in flight:
            raise InputError(
                "the process of this flight hung or crashed, which a shrunk flight would do, too; "
                f"expected a flight that ended by itself, got: {flight.get('reason')}"
            )
        room, movers = bool(flight.get("vary_room")), int(flight.get("movers") or 0)
        seed = int(flight["seed"])
        flown = {name: flight[name] for name in _OF_THE_LINE if flight.get(name)}
        options = replace(options, **flown, seed=seed, movers=0, vary_room=False, faults=())
        if "faults" not in flight or not is_simulated(options):
            raise InputError(
                "expected a flight of a simulated drone whose line states its faults, as "
                f"`uav-bt campaign` writes it; got drone {options.drone_name!r} and "
                f"{'no ' if 'faults' not in flight else ''}faults"
            )
        return cls(
            tree=tree,
            scene=varied(load_scene(scene), seed, room=room, movers=movers),
            options=options,
            faults=tuple(flight.get("faults") or ()),
            ending=Ending(flight["outcome"], str(flight.get("reason") or "")),
        )

    def parts(self) -> list[tuple[str, int]]:
        """Return everything that may be left out: its kind and its number."""
        scene = self.scene
        counted = (
            (_FAULT, self.faults),
            (_MOVER, scene.movers),
            (_BOX, scene.boxes),
            (_OBJECT, scene.objects),
        )
        return [(kind, number) for kind, some in counted for number in range(len(some))]

    def with_parts(self, kept: Sequence[tuple[str, int]]) -> FailedFlight:
        """Return the flight with these parts only."""
        parts = set(kept)
        scene = replace(
            self.scene,
            name=f"{self.scene.name}-shrunk",
            boxes=_kept(self.scene.boxes, _BOX, parts),
            movers=_kept(self.scene.movers, _MOVER, parts),
            objects=_kept(self.scene.objects, _OBJECT, parts),
        )
        return replace(self, scene=scene, faults=_kept(self.faults, _FAULT, parts))

    def fly(self, drone: str | None = None) -> Ending:
        """Fly it; return how it ends.

        Args:
            drone: The simulated drone; None: the one that flew it.

        Raises:
            KeyboardInterrupt: Ctrl-C or SIGTERM stopped it.
        """
        with tempfile.TemporaryDirectory(prefix="uav-bt-shrink-") as folder:
            file = Path(folder) / "scene.yaml"
            file.write_text(scene_text(self.scene), encoding="utf-8")
            options = replace(self.options, scene=file, faults=self.faults)
            if drone is not None:
                options = replace(options, drone=drone)
            report = Path(folder) / "report.json"
            try:
                # With an output folder, as in the campaign: leaves that write files need one.
                flown = app.fly(
                    self.tree,
                    options,
                    out=Path(folder) / "outputs",
                    report=report,
                    controls=lambda _: interruptible(),
                )
            except Exception:
                if not report.exists():  # nothing flew
                    raise
                line = json.loads(report.read_text(encoding="utf-8"))
                return Ending(line["outcome"], line["reason"])
            return Ending(flown.outcome, flown.reason)


def _kept(parts: Sequence[Part], kind: str, kept: set[tuple[str, int]]) -> tuple[Part, ...]:
    return tuple(part for number, part in enumerate(parts) if (kind, number) in kept)


def shrink(
    flight: FailedFlight, on_try: Callable[[int, Ending], None] = lambda _count, _ending: None
) -> FailedFlight:
    """Return a flight with the fewest parts that still ends as the original did.

    Args:
        flight: The failed flight.
        on_try: Called after each flight with the number of its parts, and how it ended.

    Raises:
        InputError: The flight does not fail any more.
        KeyboardInterrupt: Ctrl-C or SIGTERM stopped it.
    """

    def fails(parts: Sequence[tuple[str, int]]) -> bool:
        ending = flight.with_parts(parts).fly()
        on_try(len(parts), ending)
        return ending.agrees(flight.ending)

    parts = flight.parts()
    if not fails(parts):
        raise InputError(
            f"the flight does not end with '{flight.ending}' any more: code, networks or machine "
            "differ from those that flew it"
        )
    return flight.with_parts(least(parts, fails))


def least(parts: Sequence[Part], fails: Callable[[Sequence[Part]], bool]) -> list[Part]:
    """Return the parts that cannot be left out, one by one, without losing the failure.

    Args:
        parts: All parts, with which it fails.
        fails: Returns whether some of the parts still fail.
    """
    kept, groups = list(parts), 2
    while kept:
        size = -(-len(kept) // groups)
        chunks = [kept[start : start + size] for start in range(0, len(kept), size)]
        for chunk in chunks:
            rest = [part for part in kept if part not in chunk]
            if fails(rest):
                kept, groups = rest, max(2, groups - 1)
                break
        else:
            if size == 1:
                break
            groups = min(len(kept), 2 * groups)
    return kept
