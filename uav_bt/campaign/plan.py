"""What a campaign is going to fly: plain values that are written down and compared on resuming."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from uav_bt.campaign.flight_lines import FlightKey
from uav_bt.errors import InputError, ValueRangeError
from uav_bt.tree.loading.folders import TreeFolders


@dataclass(frozen=True, kw_only=True)
class PlannedFile:
    """A tree or a scene, and its content when the campaign was planned."""

    name: str  # what flights and reports call it
    path: str  # absolute, so that workers find it from any folder
    sha256: str  # of its text and of all that it includes


@dataclass(frozen=True, kw_only=True)
class FlightTask:
    """One flight of a campaign; travels to the process that flies it as JSON."""

    tree: str  # its name
    tree_path: str
    scene: str  # its name
    scene_path: str
    seed: int
    profile: str
    image_size_px: tuple[int, int]  # width, height
    exact_masks: bool
    policies: dict[str, str]  # by node
    movers: int = 0  # drawn from the seed
    tree_id: str | None = None  # which tree of the file; None: the one that it names
    tree_folders: TreeFolders = field(default_factory=TreeFolders)  # absolute
    record: str | None = None  # where to write the flight's record
    record_quality: str = "lossless"  # of its images

    @property
    def key(self) -> FlightKey:
        """What tells it apart from the others."""
        return self.tree, self.scene, self.seed

    def to_json(self) -> dict[str, Any]:
        """Return the task as plain JSON values."""
        return {**asdict(self), "tree_folders": self.tree_folders.to_json()}

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> FlightTask:
        """Return the task that `to_json` wrote."""
        width, height = values["image_size_px"]
        folders = TreeFolders(**values["tree_folders"])
        return cls(**{**values, "image_size_px": (width, height), "tree_folders": folders})


@dataclass(frozen=True, kw_only=True)
class CampaignPlan:
    """Every tree in every scene with every seed, all flown the same way."""

    trees: tuple[PlannedFile, ...]
    scenes: tuple[PlannedFile, ...]
    flights: int  # of each tree in each scene, one seed each
    seed_from: int = 0
    profile: str = "lab"  # how imperfect the twin is
    image_size_px: tuple[int, int] = (640, 360)  # width, height
    exact_masks: bool = False  # fly on the referee's masks instead of a network
    movers: int = 0  # drawn from each flight's seed, beside the scene's own
    tree_id: str | None = None  # which tree of every file; None: the one that each names
    # Where else trees and included files are, absolute; the trees' hashes are of those texts, too.
    tree_folders: TreeFolders = field(default_factory=TreeFolders)
    policies: dict[str, str] = field(default_factory=dict)  # by node
    record: bool = False  # keep a record of every flight
    record_quality: str = "lossless"  # of its images
    # Wall time of one flight. A flight of 300 s takes two minutes on a busy core; what takes longer
    # than this hangs.
    timeout_s: float = 900.0
    weights: dict[str, str] = field(default_factory=dict)  # SHA-256 by file of what the trees load
    versions: dict[str, str] = field(default_factory=dict)  # of packages that flights depend on

    def __post_init__(self) -> None:
        if self.movers < 0:
            raise ValueRangeError(f"movers: expected a whole number from 0, got {self.movers}")
        if self.flights < 1 or self.seed_from < 0:
            raise ValueRangeError(
                "a campaign needs at least one flight and seeds from 0, got "
                f"{self.flights} flights from seed {self.seed_from}"
            )
        if not self.timeout_s > 0.0:
            raise ValueRangeError(f"a flight's time limit must be positive, got {self.timeout_s} s")
        for what, files in (("tree", self.trees), ("scene", self.scenes)):
            names = [file.name for file in files]
            if not names:
                raise InputError(f"a campaign needs at least one {what}")
            for name in names:
                if names.count(name) > 1:
                    raise InputError(
                        f"two {what}s are called '{name}', and flights tell them apart by that; "
                        "give each once, under its own name"
                    )

    def __len__(self) -> int:
        return len(self.trees) * len(self.scenes) * self.flights

    def tasks(self) -> Iterator[FlightTask]:
        """Return all flights, seeds outermost, so that any beginning of them is balanced."""
        for seed in range(self.seed_from, self.seed_from + self.flights):
            for scene in self.scenes:
                for tree in self.trees:
                    yield FlightTask(
                        tree=tree.name,
                        tree_path=tree.path,
                        scene=scene.name,
                        scene_path=scene.path,
                        seed=seed,
                        profile=self.profile,
                        image_size_px=self.image_size_px,
                        exact_masks=self.exact_masks,
                        movers=self.movers,
                        tree_id=self.tree_id,
                        tree_folders=self.tree_folders,
                        policies=self.policies,
                        record_quality=self.record_quality,
                    )

    def differences(self, before: CampaignPlan) -> list[str]:
        """Return in what way this plan would not go on where another left off; empty when it would.

        More flights than before go on; fewer do not.
        """
        found = []
        if self.flights < before.flights:
            found.append(f"flights: {before.flights} were planned, now {self.flights}")
        for what in ("trees", "scenes"):
            now, then = ({f.name: f.sha256 for f in getattr(p, what)} for p in (self, before))
            found += _compared(what.removesuffix("s"), then, now)
        for what in ("weights", "versions", "policies"):
            found += _compared(what, getattr(before, what), getattr(self, what))
        for what in ("seed_from", "profile", "image_size_px", "exact_masks", "movers", "tree_id"):
            now, then = getattr(self, what), getattr(before, what)
            if now != then:
                found.append(f"{what}: was {then}, now {now}")
        return found

    def to_json(self) -> dict[str, Any]:
        """Return the plan as plain JSON values."""
        return {**asdict(self), "tree_folders": self.tree_folders.to_json()}

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> CampaignPlan:
        """Return the plan that `to_json` wrote.

        Raises:
            InputError: these are not the values of a plan.
        """
        try:
            width, height = values["image_size_px"]
            files = {
                what: tuple(PlannedFile(**one) for one in values[what])
                for what in ("trees", "scenes")
            }
            folders = TreeFolders(**values.get("tree_folders", {}))
            size = (int(width), int(height))
            return cls(**{**values, **files, "image_size_px": size, "tree_folders": folders})
        except (InputError, KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError(f"not a campaign's plan: {type(error).__name__}: {error}") from error


def _compared(what: str, then: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    found = []
    for name in sorted({*then, *now}):
        old, new = then.get(name), now.get(name)
        if old == new:
            continue
        if old is None:
            found.append(f"{what}: '{name}' is new")
        elif new is None:
            found.append(f"{what}: '{name}' is missing")
        elif len(old) == len(new) == 64:
            found.append(f"{what}: '{name}' has changed (SHA-256 {old[:8]}, now {new[:8]})")
        else:
            found.append(f"{what}: '{name}' was {old}, now {new}")
    return found
