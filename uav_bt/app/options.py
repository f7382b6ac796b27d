"""The options of one flight, declared once for Python and command line."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, fields, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Annotated, Any, Final, Self

from annotated_types import Ge, Le
from pydantic import AfterValidator, ConfigDict, TypeAdapter, ValidationError, model_validator
from pydantic.dataclasses import dataclass

from sim_bridge.twin.layout import MAX_MOVERS
from uav_bt.app import option_values as values
from uav_bt.app.site import Site, load_site, site_of_lab
from uav_bt.errors import InputError, UnknownNameError
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import lab_address, load_lab
from uav_bt.mission.judge import JudgeConfig
from uav_bt.mission.limits import Limits
from uav_bt.mission.runner import RunnerConfig
from uav_bt.option import Option, option_of
from uav_bt.protocols import Drone, DroneConfig, LeafPolicy
from uav_bt.record import Quality
from uav_bt.settings import brief_repr
from uav_bt.tree.loading.lookup import Folders, TreeFolders, TreeId
from uav_bt.tree.loading.parameter_file import ParameterFile, read_parameters
from uav_bt.tree.loading.parameters import PARAMS, Parameters, Ports, Variables
from uav_bt.tree.registry import OwnLeaves, OwnParts, parts_of_files

_CONFIG: Final = ConfigDict(
    strict=True, extra="forbid", arbitrary_types_allowed=True, use_attribute_docstrings=True
)


@dataclass(frozen=True, kw_only=True, repr=False, config=_CONFIG)
class FlightOptions:
    """How a mission is flown; every value is checked here.

        FlightOptions(scene="val-a", seed=3, judge=JudgeConfig(time_limit_s=600.0))

    In Python `drone` may also be a configuration such as `TwinConfig(scene="val-a")`, or a `Drone`,
    which the seed does not reach. Values of site or lab replace those of a configuration. A policy
    may also be an object with `decide`, a site also a `Site`, a lab also a `Lab`. A drone without a
    seed, such as anafi, refuses any but 0.

    Raises:
        InputError: A value cannot be used, lab or site file cannot be read, or both are given.
    """

    tree_id: TreeId = None
    tree_folders: Folders = field(default_factory=TreeFolders)
    leaves: Annotated[OwnLeaves, AfterValidator(lambda given: tuple(map(Path, given)))] = ()
    ports: Annotated[Ports, values.PORTS] = field(default_factory=dict)
    variables: Annotated[Variables, values.VARIABLES] = field(default_factory=dict)
    params: Annotated[
        str | Path | ParameterFile | None,
        values.loaded_by(lambda file: read_parameters(Path(file)), ParameterFile),
        PARAMS,
    ] = None
    policies: values.Policies = field(default_factory=dict)
    judge: Annotated[
        JudgeConfig, Option(group="Mission", parts=JudgeConfig, only=("time_limit_s",))
    ] = field(default_factory=JudgeConfig)
    """When a flight is over, and what counts as a success."""
    record: Annotated[values.File, Option(group="Outputs", path="written", suffix=".mcap")] = None
    """Keep the flight's record: an MCAP file, for viewers and for replay."""
    record_quality: Annotated[Quality, Option("", "--quality", "Outputs")] = "lossless"
    """Quality of the record's images: lossless, which replays exactly, high or small. At 640x360 a
    minute takes about 240, 35 or 14 MB."""
    scene: Annotated[
        values.File,
        AfterValidator(lambda scene: None if scene is None else str(scene)),
        Option("", "SCENE", "Simulated room", of_drone=True),
    ] = None
    """The twin's lab: a shipped scene, one of a lab in labs/, or a YAML file."""
    seed: values.Seed = 0
    profile: values.Profile = "lab"
    movers: Annotated[
        values.Whole,
        Ge(0),
        Le(MAX_MOVERS),
        Option(
            "Number of people and carts, drawn from the seed, that are added to the movers of the "
            f"twin's scene; {MAX_MOVERS} together at most.",
            "N",
            "Simulated room",
            of_drone=True,
        ),
    ] = 0
    vary_room: Annotated[bool, Option(group="Simulated room", of_drone=True)] = False
    """Place and size the scene's boxes by the seed."""
    faults: Annotated[
        Sequence[str],
        AfterValidator(values.fault_texts),
        Option("", "KIND[=LEVEL][@PHASE[+S]][~S]", "Simulated room"),
    ] = ()
    """A fault of the drone, such as video-lost@explore+1~3, or `random`: room, movers and faults
    are drawn from the seed. Repeatable."""
    exact_masks: Annotated[bool, Option(group="Simulated room")] = False
    """Fly on exact masks instead of a network's."""
    realtime: Annotated[bool, Option(group="Simulated room", of_drone=True)] = False
    """Fly the twin no faster than real time."""
    image_size_px: values.ImageSize = (640, 360)
    lab: Annotated[
        str | Path | Lab | None, values.loaded_by(load_lab, Lab), Option("", "NAME", "Place")
    ] = None
    """The lab that is flown in, real or simulated: a shipped lab, a folder of labs/, or a path. Its
    lab file has all keys of a site file."""
    drone: Annotated[
        str | DroneConfig | Drone,
        values.checked_by(values.check_drone),
        Option("", "NAME[:ADDRESS]", "Real drone"),
    ] = "twin"
    """The drone that flies: twin, plain (the twin without images), anafi[:HOST[:PORT]],
    sphinx[:HOST[:PORT]], or another that is installed."""
    site: Annotated[
        str | Path | Site | None,
        values.loaded_by(load_site, Site),
        Option(group="Real drone", path="read"),
    ] = None
    """A site file: heights, camera, classes and limits of the place."""
    camera: Annotated[values.File, Option(group="Real drone", path="read")] = None
    """A camera file of `uav-bt lab calibrate`: frames are undistorted with it."""
    rehearse: Annotated[bool, Option(group="Real drone")] = False
    """Motors off: perception and tree see the live video, and show what would be sent."""
    inference_threads: values.Threads = 1
    limits: Annotated[Limits | None, Option()] = None
    """Limits that no command exceeds; None: those of site or lab. Where both state limits, the
    smaller ones hold."""
    runner: Annotated[RunnerConfig, Option()] = field(default_factory=RunnerConfig)
    """Length of a tick, and how long a landing may take."""

    __repr__ = brief_repr

    @model_validator(mode="wrap")
    @classmethod
    def _refusing(cls, given: Any, handler: Callable[[Any], Self]) -> Self:
        try:
            return handler(given)
        except ValidationError as error:
            raise InputError(_refusal(error)) from error

    def __post_init__(self) -> None:
        if self.lab is not None and self.site is not None:
            raise InputError(
                "--lab and --site (lab, site in Python) both say how the place is flown: give one"
            )
        if isinstance(self.record, Path) and self.record.suffix.lower() != ".mcap":
            values.refuse("record", "a file whose name ends in .mcap", str(self.record))
        if isinstance(self.drone, str):
            return
        kind = type(self.drone).__name__
        values.refuse_unusable(self, f"{kind} is flown as it is and", {"seed"}, "set it there")
        own = getattr(self.drone, "seed", 0) if values.is_drone_config(self.drone) else 0
        if own and self.seed not in {0, own}:
            raise InputError(
                f"seed: expected one seed, got {self.seed} for the flight and {own} in the "
                f"drone's {kind}: leave out the drone's"
            )
        object.__setattr__(self, "seed", own or self.seed)  # frozen for all others

    def shared_json(self) -> dict[str, Any]:
        """Return the fields in `SHARED` as JSON values that hold in any folder."""
        plain = _adapter().dump_python(self, mode="json", include={*SHARED} - {"lab"})
        lab = lab_address(self.lab) if isinstance(self.lab, Lab) else None
        folders = self.tree_folders.to_json()
        return {**plain, "lab": lab, "policies": self.policy_names, "tree_folders": folders}

    @classmethod
    def of_json(cls, stored: Mapping[str, Any]) -> FlightOptions:
        """Return options with the values that `shared_json` wrote."""
        return _adapter().validate_json(json.dumps(stored))

    @cached_property
    def place(self) -> Site | None:
        """The site of these options, or that of their lab; None without both."""
        if isinstance(self.lab, Lab):
            return site_of_lab(self.lab)
        return self.site if isinstance(self.site, Site) else None

    @property
    def drone_name(self) -> str:
        """Name of the drone in reports and records: its name, or its class."""
        return self.drone if isinstance(self.drone, str) else values.class_name(self.drone)

    @property
    def parameters(self) -> Parameters:
        """Ports and variables of the options, before those of the parameter file."""
        own = Parameters(ports=self.ports, variables=self.variables)
        return own if not isinstance(self.params, ParameterFile) else own.over(self.params.common)

    @cached_property
    def own_parts(self) -> OwnParts:
        """Leaves, policies and drones that the files of `leaves` define."""
        return parts_of_files([Path(file) for file in self.leaves])

    @cached_property
    def policy_objects(self) -> dict[str, LeafPolicy]:
        """Policies that were given as objects, by their names in trees and reports.

        The name is the class; the second object of one class gets `#2`.
        """
        found: dict[str, LeafPolicy] = {}
        for policy in self.policies.values():
            if not isinstance(policy, str) and all(policy is not known for known in found.values()):
                name = values.class_name(policy)
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


_ABOUT: Final = {each.name: option_of(FlightOptions, each.name) for each in fields(FlightOptions)}
# Each attribute is described where it is declared, and `help` shows it.
_ATTRIBUTES: Final = "\n".join(f"    {name}: {about.help}" for name, about in _ABOUT.items())
FlightOptions.__doc__ = (
    f"{inspect.cleandoc(str(FlightOptions.__doc__))}\n\nAttributes:\n{_ATTRIBUTES}\n"
)

IN_COMMANDS: Final = tuple(name for name, about in _ABOUT.items() if about.group)
"""Fields that `uav-bt fly` has as options; the others are for Python."""
OF_DRONE: Final = tuple(name for name, about in _ABOUT.items() if about.of_drone)
"""Fields that a drone's configuration gets if it has fields of these names."""
_OF_ONE_FLIGHT: Final = {
    *("scene", "seed", "record", "params"),
    *("realtime", "site", "camera", "rehearse", "inference_threads"),
}
SHARED: Final = tuple(name for name in IN_COMMANDS if name not in _OF_ONE_FLIGHT)
"""Fields of `FlightOptions` that all flights of a campaign have in common."""


def _refusal(error: ValidationError) -> str:
    """Return the first thing that is wrong: what was expected, what was given."""
    first = error.errors(include_url=False)[0]
    if first["type"] == "value_error":
        return str(first["ctx"]["error"])
    if first["type"] == "unexpected_keyword_argument":
        names = [each.name for each in fields(FlightOptions)]
        return str(UnknownNameError("flight option", str(first["loc"][0]), names))
    number = "a number " if "than" in first["type"] else ""
    words = first["msg"].replace("Input should be ", f"expected {number}")
    return f"{first['loc'][0]}: {words}, got {first['input']!r:.80}"


@cache
def _adapter() -> TypeAdapter[FlightOptions]:
    return TypeAdapter(FlightOptions)


def given_options(options: FlightOptions | None, how: Mapping[str, Any]) -> FlightOptions:
    """Return the options of an object, some of them replaced by `how`."""
    values.expect("options", options, FlightOptions | None, "FlightOptions(...)")
    return replace(options, **how) if options else FlightOptions(**how)
