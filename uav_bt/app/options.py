"""How a mission is flown: by names, files or objects, checked when they are given."""

from __future__ import annotations

import inspect
import operator
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from types import UnionType
from typing import Final, NoReturn, get_args

from uav_bt.app.site import Site, load_site
from uav_bt.brief import brief_repr
from uav_bt.errors import InputError
from uav_bt.mission.judge import JudgeConfig
from uav_bt.mission.limits import Limits
from uav_bt.mission.runner import RunnerConfig
from uav_bt.protocols import Drone, DroneConfig, LeafPolicy
from uav_bt.record.channels import Quality
from uav_bt.tree.loading.folders import TreeFolders
from uav_bt.types import LandingMark


@dataclass(frozen=True, kw_only=True)
class FlightOptions:
    """How a mission is flown. Every value is checked here; files are given as `str` or `Path`.

        FlightOptions(scene="val-a", seed=3, judge=JudgeConfig(time_limit_s=600.0))

    Attributes:
        scene: name or file of the scene that a simulated drone flies in; None: its default.
        seed: of everything random, 0 or more. It does not reach a drone given as an object. A
            named drone without a seed, such as anafi, refuses any but 0.
        drone: what flies: NAME or NAME:ADDRESS of an installed drone, a configuration such as
            `TwinConfig(scene="val-a")`, or a `Drone`. An object is flown as it is; of a
            configuration, the site's values replace those of the same name.
        profile: how imperfect the twin is: ideal, lab or harsh.
        policies: leaf policies by the node's name or path: an installed policy's name, or an
            object with `decide`.
        image_size_px: width and height of the drone's frames; 16:9 for twin and ANAFI.
        realtime: fly the twin no faster than real time.
        inference_threads: threads of the networks' inference; with one, a flight does not depend
            on the machine's load.
        camera: camera file in place of the drone's own intrinsics; frames are undistorted by it.
        movers: how many people and carts, drawn from the seed, move in the scene beside its own.
        exact_masks: simulated drones fly on the referee's masks instead of a network's.
        record: MCAP file that the flight's record is written to; None: no record.
        record_quality: of the record's images: lossless, which replays exactly, high or small.
        tree_id: which of a tree file's trees is flown; None: the one that the file names, or the
            only one that no other uses.
        tree_folders: where else trees and included files are that the tree file does not hold.
        site: the place: heights, camera, classes and limits; a site file or a `Site`.
        rehearse: perceive and decide, but let the drone stand: it flies in numbers only.
        limits: what no command may exceed; those of the site, where there is one.
        runner: length of a tick, and how long a landing may take.
        judge: when a flight is over, and what counts as a success.

    Raises:
        InputError: a value cannot be used, or the site file cannot be read.
    """

    scene: str | Path | None = None
    seed: int = 0
    drone: str | DroneConfig | Drone = "twin"
    profile: str = "lab"
    policies: Mapping[str, str | LeafPolicy] = field(default_factory=dict)
    image_size_px: tuple[int, int] = (640, 360)
    realtime: bool = False
    inference_threads: int = 1
    camera: str | Path | None = None
    movers: int = 0
    exact_masks: bool = False
    record: str | Path | None = None
    record_quality: Quality = "lossless"
    tree_id: str | None = None
    tree_folders: TreeFolders = field(default_factory=TreeFolders)
    site: str | Path | Site | None = None
    rehearse: bool = False
    limits: Limits = field(default_factory=Limits)
    runner: RunnerConfig = field(default_factory=RunnerConfig)
    judge: JudgeConfig = field(default_factory=JudgeConfig)

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        for name in ("camera", "record"):
            self._set(name, as_file(name, getattr(self, name)))
        if isinstance(self.record, Path) and self.record.suffix.lower() != ".mcap":
            _refuse("record", "a file whose name ends in .mcap", str(self.record))
        scene = as_file("scene", self.scene)
        self._set("scene", None if scene is None else str(self.scene))
        if not isinstance(self.site, Site):
            file = as_file("site", self.site, "a site file or a Site")
            self._set("site", None if file is None else load_site(file))
        for name, least in (("seed", 0), ("inference_threads", 1), ("movers", 0)):
            self._set(name, _whole(name, getattr(self, name), least))
        self._set("image_size_px", _size(self.image_size_px))
        for name in ("realtime", "exact_masks", "rehearse"):
            _expect(name, getattr(self, name), bool, "True or False")
        for name, kind in (("limits", Limits), ("runner", RunnerConfig), ("judge", JudgeConfig)):
            _expect(name, getattr(self, name), kind, f"a {kind.__name__}")
        _expect("tree_id", self.tree_id, str | None, "the ID of a tree, or None")
        _expect("tree_folders", self.tree_folders, TreeFolders, "a TreeFolders")
        _expect("profile", self.profile, str, "the name of a profile: ideal, lab or harsh")
        if self.record_quality not in get_args(Quality):
            _refuse("record_quality", " or ".join(get_args(Quality)), self.record_quality)
        check_policies(self.policies)
        _check_drone(self.drone)
        if not isinstance(self.drone, str):
            who = f"{type(self.drone).__name__} is flown as it is and"
            refuse_unusable(self, who, {"seed"}, remedy=": set it there")

    def _set(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)  # as the class is frozen for all others

    @property
    def drone_name(self) -> str:
        """What reports and records call the drone: its name, or its class."""
        return self.drone if isinstance(self.drone, str) else class_name(self.drone)

    @cached_property
    def policy_objects(self) -> dict[str, LeafPolicy]:
        """The policies that were given as objects, by the names that trees and reports have.

        That is the class; the second object of one class gets `#2`.
        """
        found: dict[str, LeafPolicy] = {}
        for policy in self.policies.values():
            if not isinstance(policy, str) and all(policy is not known for known in found.values()):
                name = class_name(policy)
                alike = sum(known.partition("#")[0] == name for known in found)
                found[f"{name}#{alike + 1}" if alike else name] = policy
        return found

    @property
    def policy_names(self) -> dict[str, str]:
        """The names of the policies by node."""
        names = {id(policy): name for name, policy in self.policy_objects.items()}
        return {
            node: policy if isinstance(policy, str) else names[id(policy)]
            for node, policy in self.policies.items()
        }


# These options set up the drone.
_OF_THE_DRONE: Final = frozenset(
    {"scene", "seed", "profile", "image_size_px", "realtime", "movers"}
)
_ABSENT: Final = object()


def given_options(options: FlightOptions | None) -> FlightOptions:
    """Return options, by default all as they are without any.

    Raises:
        InputError: it is something else.
    """
    if options is None:
        return FlightOptions()
    _expect("options", options, FlightOptions, "FlightOptions(...)")
    return options


def refuse_unusable(
    options: FlightOptions, drone: str, usable: Collection[str], *, remedy: str = ""
) -> None:
    """Refuse options that set up the drone in a way that this drone has not.

    Args:
        options: of a flight; one at its default is not asked for.
        drone: the drone, as the message's subject.
        usable: names of the options that the drone can use.
        remedy: the end of the message: what to do instead.

    Raises:
        InputError: an option cannot be used.
    """
    for each in fields(options):
        value = getattr(options, each.name)
        if each.name in _OF_THE_DRONE.difference(usable) and value != each.default:
            raise InputError(f"{drone} takes no {each.name}, got {value!r}{remedy}")


def class_name(value: object) -> str:
    """Return the full name of an object's class."""
    return f"{type(value).__module__}.{type(value).__qualname__}"


def site_of(options: FlightOptions) -> Site | None:
    """Return the site, which options hold read."""
    return options.site if isinstance(options.site, Site) else None


def limits_of(options: FlightOptions) -> Limits:
    """Return what no command may exceed: the site's limits, where there is one."""
    site = site_of(options)
    return options.limits if site is None else site.limits


def mark_of(options: FlightOptions) -> LandingMark:
    """Return the size of the landing mark: the site's, where there is one."""
    site = site_of(options)
    return LandingMark() if site is None or site.mark is None else site.mark


def is_drone_config(drone: object) -> bool:
    """Return whether it makes a drone rather than is one."""
    return callable(getattr(drone, "create", None))


def as_file(name: str, value: object, expected: str = "a file") -> Path | None:
    """Return a file's path; None for None.

    Args:
        name: what it is, for the message.
        value: what was given.
        expected: what should have been.

    Raises:
        InputError: it is neither text nor path, or empty.
    """
    if value is None or isinstance(value, Path):
        return value
    if not isinstance(value, str) or not value:
        _refuse(name, f"{expected}, as str or Path", value)
    return Path(value)


def check_policies(policies: object) -> None:
    """Refuse what cannot be leaf policies by node.

    Raises:
        InputError: it is no mapping, or one of them has no `decide`.
    """
    if not isinstance(policies, Mapping):
        _refuse("policies", "policies by node, such as {'Explore': 'corridor'}", policies)
    for node, policy in policies.items():
        _expect("policies", node, str, "the name or path of a node")
        usable = isinstance(policy, LeafPolicy) and not isinstance(policy, type)
        if not usable and not isinstance(policy, str):
            _refuse(f"policies['{node}']", "a policy's name, or an object with `decide`", policy)


def _check_drone(drone: object) -> None:
    expected = "a drone's name, a configuration with `create`, or a Drone"
    if isinstance(drone, str) and drone:
        return
    if isinstance(drone, str | type):
        _refuse("drone", expected, drone)
    if not is_drone_config(drone):
        refuse_incomplete(drone, expected)


def refuse_incomplete(drone: object, expected: str = "a Drone") -> None:
    """Refuse a drone that lacks members of the protocol.

    Args:
        drone: the object.
        expected: for the message.

    Raises:
        InputError: it lacks some; the message lists them.
    """
    missing = list(_missing(Drone, drone))
    if missing:
        remedy = ": add `airframe = uav_bt.types.Airframe()`" if missing == ["airframe"] else ""
        raise InputError(
            f"drone: expected {expected}; {class_name(drone)} lacks {', '.join(missing)}{remedy}"
        )


def _missing(protocol: type, value: object) -> Iterator[str]:
    """Yield the members that an object lacks; none is read: an unconnected drone has no camera."""
    for name in vars(protocol):
        if not name.startswith("_") and inspect.getattr_static(value, name, _ABSENT) is _ABSENT:
            yield name


def _whole(name: str, value: object, least: int) -> int:
    try:
        number = operator.index(value)  # type: ignore[arg-type]  # that is what is asked
    except TypeError:
        number = least - 1
    if number < least or isinstance(value, bool):
        _refuse(name, f"a whole number from {least}", value)
    return number


def _size(value: object) -> tuple[int, int]:
    sides = tuple(value) if isinstance(value, Iterable) else ()
    if len(sides) != 2:
        _refuse("image_size_px", "width and height in pixels, such as (640, 360)", value)
    width, height = (_whole("image_size_px", side, 1) for side in sides)
    return width, height


def _expect(name: str, value: object, kind: type | UnionType, expected: str) -> None:
    if not isinstance(value, kind):
        _refuse(name, expected, value)


def _refuse(name: str, expected: str, value: object) -> NoReturn:
    got = f"{value!r:.80}"
    if isinstance(value, type):
        got = f"the class {value.__name__}: write {value.__name__}(...)"
    raise InputError(f"{name}: expected {expected}, got {got}")
