"""Reduction of a failed flight to the fewest objects, movers and faults that still fail.

The parts are removed by delta debugging (Zeller and Hildebrandt, 2002): larger groups first,
then single ones, until no part can be left out.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, TypeVar

from sim_bridge.twin.scene import Scene
from sim_bridge.twin.scene_file import load_scene, scene_text
from sim_bridge.twin.variation import varied
from uav_bt.app.drone_of_flight import is_simulated
from uav_bt.app.flying_process import interruptible
from uav_bt.app.options import FlightOptions
from uav_bt.campaign.workers import reported
from uav_bt.errors import InputError
from uav_bt.files import write_whole

T = TypeVar("T")
Part = tuple[str, int]
"""A thing that may be left out: its kind and its number."""

# Options as they were flown.
_OF_THE_LINE: Final = ("drone", "profile", "ports", "variables", "exact_masks", "faults")
_NUMBER: Final = re.compile(r"-?\d+(\.\d+)?")


def same_cause(one: str, other: str) -> bool:
    """Return whether two endings have the same outcome and reason; numbers may differ."""
    return _NUMBER.sub("#", one) == _NUMBER.sub("#", other)


def _ending(line: Mapping[str, Any]) -> str:
    return f"{line['outcome']}: {line.get('reason') or ''}"


@dataclass(frozen=True, kw_only=True)
class FailedFlight:
    """A flight of a campaign that failed, with everything drawn for it."""

    tree: str  # a file or the name of a shipped mission
    scene: Scene  # with the room and the movers that were drawn
    options: FlightOptions  # without scene and movers
    ending: str  # outcome and reason

    @classmethod
    def of(
        cls, flight: Mapping[str, Any], tree: str, scene: str, options: FlightOptions
    ) -> FailedFlight:
        """Return a flight from the line of its failure, its files and its campaign's options.

        An InputError says why it cannot be flown again.
        """
        flown = {name: flight[name] for name in _OF_THE_LINE if flight.get(name)}
        flown = {"faults": (), **flown, "seed": flight["seed"], "movers": 0, "vary_room": False}
        options = replace(options, **flown)
        if "details" in flight or "faults" not in flight or not is_simulated(options):
            raise InputError(
                "expected a flight of a simulated drone that ended by itself, not by a crash, and "
                "whose line states its faults, as `uav-bt campaign` writes it; got drone "
                f"{options.drone_name!r}: {flight.get('reason')}"
            )
        room, movers = bool(flight.get("vary_room")), flight.get("movers") or 0
        return cls(
            tree=tree,
            scene=varied(load_scene(scene), options.seed, room=room, movers=movers),
            options=options,
            ending=_ending(flight),
        )

    def things(self) -> dict[str, Sequence[Any]]:
        """Return everything that may be left out, by its kind."""
        kinds = ("movers", "objects")
        return {"faults": self.options.faults, **{one: getattr(self.scene, one) for one in kinds}}

    def parts(self) -> list[Part]:
        """Return the parts that may be left out."""
        return [(kind, n) for kind, some in self.things().items() for n in range(len(some))]

    def with_parts(self, kept: Sequence[Part]) -> FailedFlight:
        """Return the flight with these parts only."""
        left: dict[str, Any] = {
            kind: tuple(each for n, each in enumerate(some) if (kind, n) in kept)
            for kind, some in self.things().items()
        }
        options = replace(self.options, faults=left.pop("faults"))
        scene = replace(self.scene, name=f"{self.scene.name}-shrunk", **left)
        return replace(self, scene=scene, options=options)

    def fly(self, drone: str | None = None) -> str:
        """Fly it, with another simulated drone if one is given; return how it ends."""
        with tempfile.TemporaryDirectory(prefix="uav-bt-shrink-") as folder:
            file = Path(folder) / "scene.yaml"
            write_whole(file, scene_text(self.scene))
            options = replace(self.options, scene=file, drone=drone or self.options.drone)
            out = Path(folder) / "outputs"  # as in the campaign: some leaves need one
            return _ending(
                reported(self.tree, options, out=out, controls=lambda _: interruptible())
            )


def shrink(flight: FailedFlight, on_try: Callable[[int, str], None]) -> FailedFlight:
    """Return a flight with the fewest parts that still ends as the original did.

    `on_try` is called after each flight with the number of its parts, and how it ended. An
    InputError says that the flight does not fail any more; Ctrl-C and SIGTERM stop it.
    """

    def fails(parts: Sequence[Part]) -> bool:
        ending = flight.with_parts(parts).fly()
        on_try(len(parts), ending)
        return same_cause(ending, flight.ending)

    parts = flight.parts()
    if not fails(parts):
        raise InputError(
            f"the flight does not end with '{flight.ending}' any more: code, networks or "
            "machine differ from those that flew it"
        )
    return flight.with_parts(least(parts, fails))


def least(parts: Sequence[T], fails: Callable[[Sequence[T]], bool]) -> list[T]:
    """Return the parts that cannot be left out, one by one, without losing the failure."""
    kept, size = list(parts), len(parts)
    while size:
        before = len(kept)
        for start in reversed(range(0, len(kept), size)):
            rest = kept[:start] + kept[start + size :]
            if fails(rest):
                kept = rest
        # Single parts are tried again until none can be left out.
        if size > 1 or len(kept) == before:
            size //= 2
    return kept
