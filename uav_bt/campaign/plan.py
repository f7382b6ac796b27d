"""Plan of a campaign: plain values that are stored and compared on resuming."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from itertools import product
from typing import Any

from pydantic import ConfigDict, TypeAdapter

from uav_bt.app.drone_of_flight import is_simulated
from uav_bt.app.options import SHARED, FlightOptions
from uav_bt.errors import InputError
from uav_bt.settings import check_numbers
from uav_bt.tree.loading.parameters import Plain

FlightKey = tuple[str, str | None, int]
"""Tree, scene and seed, which identify a flight of a campaign."""


@dataclass(frozen=True, kw_only=True)
class PlannedFile:
    """A tree or a scene, and its content when the campaign was planned.

    A variant of the campaign's parameters is a separate tree: `patrol[fast].xml`.
    """

    name: str  # what flights and reports call it
    path: str  # absolute, so that workers find it from any folder; or what it ships as
    sha256: str = ""  # of its text and of all that it includes
    ports: dict[str, str] = field(default_factory=dict)  # before those of the plan's options
    variables: dict[str, Plain] = field(default_factory=dict)  # likewise

    def options(self, shared: FlightOptions) -> FlightOptions:
        """Return how this tree is flown, from what all flights have in common."""
        return replace(
            shared,
            ports={**shared.ports, **self.ports},
            variables={**shared.variables, **self.variables},
        )


@dataclass(frozen=True, kw_only=True)
class FlightTask:
    """One flight of a campaign, as it travels to the process that flies it."""

    tree: str  # the name in flights and reports
    tree_path: str  # file, or a shipped mission's name
    scene: str  # the name in flights and reports
    options: FlightOptions  # with the scene's file, the seed and the record
    folder: str | None = None  # its output folder

    @property
    def key(self) -> FlightKey:
        """Key that identifies it."""
        return self.tree, self.scene, self.options.seed


@dataclass(frozen=True, kw_only=True)
class CampaignPlan:
    """Every tree in every scene with every seed, all flown the same way."""

    __pydantic_config__ = ConfigDict(extra="forbid")

    trees: tuple[PlannedFile, ...]
    scenes: tuple[PlannedFile, ...]
    flights: int  # of each tree in each scene, one seed each
    seed_from: int = 0
    # How all are flown, by the fields in `SHARED`. The tree folders are absolute.
    options: FlightOptions = field(default_factory=FlightOptions)
    record: bool = False  # whether each flight's record is kept
    timeout_s: float = 900.0  # wall time of a hung flight
    weights: dict[str, str] = field(default_factory=dict)  # SHA-256 of networks, by file
    leaves_sha256: dict[str, str] = field(default_factory=dict)  # of files with leaves
    lab_sha256: dict[str, str] = field(default_factory=dict)  # of labs' files
    versions: dict[str, str] = field(default_factory=dict)  # of packages

    def __post_init__(self) -> None:
        _check_shared(self.options)
        check_numbers(self, {"seed_from": 0})
        for what, files in (("tree", self.trees), ("scene", self.scenes)):
            names = [file.name for file in files]
            if not names:
                raise InputError(f"a campaign needs at least one {what}")
            if twice := [name for name in names if names.count(name) > 1]:
                raise InputError(
                    f"two {what}s are called '{twice[0]}': give each once, under its own name, "
                    "and values as variants of --params"
                )

    def __len__(self) -> int:
        return len(self.trees) * len(self.scenes) * self.flights

    def tasks(self) -> Iterator[FlightTask]:
        """Return all flights, seeds outermost, so that any beginning of them is balanced."""
        seeds = range(self.seed_from, self.seed_from + self.flights)
        for seed, scene, tree in product(seeds, self.scenes, self.trees):
            how = replace(tree.options(self.options), scene=scene.path, seed=seed)
            yield FlightTask(tree=tree.name, tree_path=tree.path, scene=scene.name, options=how)

    def differences(self, before: CampaignPlan) -> list[str]:
        """Return in what way this plan would not go on where another left off.

        More flights than before go on; fewer do not.
        """
        found = []
        if self.flights < before.flights:
            found.append(f"flights: {before.flights} were planned, now {self.flights}")
        now, then = (dict(flattened(_compared(plan))) for plan in (self, before))
        for what in sorted({*now, *then}):
            old, new = (text.get(what, "none") for text in (then, now))
            if old != new and len(old) == len(new) == 64:
                found.append(f"{what} has changed (SHA-256 {old[:8]}, now {new[:8]})")
            elif old != new:
                found.append(f"{what}: was {old}, now {new}")
        return found

    def to_json(self) -> dict[str, Any]:
        """Return the plan as plain JSON values, those of the options beside the others."""
        others = _PLAN.dump_python(self, mode="json", exclude={"options"})
        return {**self.options.shared_json(), **others}

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> CampaignPlan:
        """Return the plan that `to_json` wrote, by default options where it states none."""
        others = dict(values)
        shared = {name: others.pop(name) for name in SHARED if name in others}
        options = FlightOptions.of_json(shared)
        return _PLAN.validate_python({**others, "options": options})


_PLAN = TypeAdapter(CampaignPlan)


def _check_shared(options: FlightOptions) -> None:
    """Refuse options that a plan does not keep, and policies that are objects."""
    if not is_simulated(options):
        raise InputError(
            f"drone '{options.drone_name}' cannot fly a campaign, only simulated ones can: "
            "twin, plain, or another that is installed and takes a scene"
        )
    default = FlightOptions()
    others = [each.name for each in fields(options) if each.name not in SHARED]
    refused = [name for name in others if getattr(options, name) != getattr(default, name)]
    if refused:
        only = ", ".join(SHARED)
        raise InputError(f"a campaign takes no {refused[0]}, only {only}; fly with app.fly(...)")
    if options.policy_objects:
        raise InputError(
            "a campaign's policies are names of installed policies, as each flight has its own "
            f"process; got {next(iter(options.policy_objects))}"
        )


def _compared(plan: CampaignPlan) -> dict[str, Any]:
    """Return what flights depend on: not folders, and not what was only planned."""
    left_out = {"flights", "record", "timeout_s", "record_quality", "lab", "leaves", "tree_folders"}
    values = {name: value for name, value in plan.to_json().items() if name not in left_out}
    for what in ("trees", "scenes"):
        values[what] = {file.pop("name"): {**file, "path": ""} for file in values[what]}
    return values


def flattened(value: object, name: str = "") -> Iterator[tuple[str, str]]:
    """Yield the texts in nested values, with the words that lead there, if not empty."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from flattened(inner, f"{name} {key}".strip())
    elif isinstance(value, list) and value and isinstance(value[0], Mapping):
        for inner in value:
            yield from flattened(inner, name)
    elif value not in (None, "", []) and value is not False:
        yield name, str(value)
