"""How a mission is flown: the options of one flight, declared once for Python and command line."""

from __future__ import annotations

import inspect
import json
from collections.abc import Mapping, Sequence
from dataclasses import field, fields, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Annotated, Any, Final, Self

from annotated_types import Ge, Le
from pydantic import (
    BeforeValidator,
    ConfigDict,
    ModelWrapValidatorHandler,
    TypeAdapter,
    ValidationError,
    model_validator,
)
from pydantic.dataclasses import dataclass

from sim_bridge.twin.scene import MAX_MOVERS
from uav_bt.app.option_values import (
    MISSION,
    OUTPUTS,
    REAL,
    RECORD_SUFFIX,
    ROOM,
    Checked,
    ImageSize,
    Policies,
    Profile,
    Seed,
    Threads,
    as_file,
    check_drone,
    class_name,
    common_seed,
    expect,
    fault_texts,
    files,
    judge_of,
    loaded,
    port_values,
    record_file,
    refuse_unusable,
    scene_text,
    variable_values,
    whole,
)
from uav_bt.app.site import Site, load_site, site_of_lab
from uav_bt.brief import brief_repr
from uav_bt.errors import InputError, UnknownNameError
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import lab_address, load_lab
from uav_bt.mission.judge import JudgeConfig
from uav_bt.mission.limits import Limits
from uav_bt.mission.runner import RunnerConfig
from uav_bt.option import Option, option_of
from uav_bt.protocols import Drone, DroneConfig, LeafPolicy
from uav_bt.record import Quality
from uav_bt.tree.loading.lookup import Folders, TreeFolders, TreeId
from uav_bt.tree.loading.parameter_file import ParameterFile, read_parameters
from uav_bt.tree.loading.parameters import PARAMS, Parameters, Ports, Variables
from uav_bt.tree.registry import OwnLeaves, OwnParts, parts_of_files


@dataclass(
    frozen=True,
    kw_only=True,
    repr=False,
    config=ConfigDict(
        strict=True, extra="forbid", arbitrary_types_allowed=True, use_attribute_docstrings=True
    ),
)
class FlightOptions:
    """How a mission is flown. Every value is checked here; files are given as `str` or `Path`.

        FlightOptions(scene="val-a", seed=3, judge=JudgeConfig(time_limit_s=600.0))

    In Python `drone` may also be a configuration such as `TwinConfig(scene="val-a")`, or a `Drone`.
    An object is flown as it is; the values of site or lab replace those of the same name in a
    configuration. A policy may also be an object with `decide`, a site also a `Site`, a lab also a
    `Lab`. The seed does not reach a drone given as an object. A named drone without a seed, such as
    anafi, refuses any but 0.

    Raises:
        InputError: A value cannot be used, lab or site file cannot be read, or both are given.
    """

    tree_id: TreeId = None
    tree_folders: Folders = field(default_factory=TreeFolders)
    leaves: Annotated[OwnLeaves, Checked(lambda _, value: files(value))] = ()
    ports: Annotated[Ports, Checked(lambda _, value: port_values(value))] = field(
        default_factory=dict
    )
    variables: Annotated[Variables, Checked(lambda _, value: variable_values(value))] = field(
        default_factory=dict
    )
    params: Annotated[
        str | Path | ParameterFile | None,
        loaded(ParameterFile, lambda file: read_parameters(Path(file)), "a parameter file"),
        PARAMS,
    ] = None
    policies: Policies = field(default_factory=dict)
    judge: Annotated[JudgeConfig, Option(group=MISSION, parts=judge_of)] = field(
        default_factory=JudgeConfig
    )
    """When a flight is over, and what counts as a success."""
    record: Annotated[
        str | Path | None,
        Checked(record_file),
        Option(group=OUTPUTS, path="written", suffix=RECORD_SUFFIX),
    ] = None
    """Keep the flight's record: an MCAP file, for viewers and for replay."""
    record_quality: Annotated[Quality, Option("", "--quality", OUTPUTS)] = "lossless"
    """Quality of the record's images: lossless, which replays exactly, high or small. At 640x360 a
    minute takes about 240, 35 or 14 MB."""
    scene: Annotated[
        str | Path | None, Checked(scene_text), Option("", "SCENE", ROOM, of_drone=True)
    ] = None
    """The twin's lab: a shipped scene or a YAML file."""
    seed: Seed = 0
    profile: Profile = "lab"
    movers: Annotated[
        int,
        BeforeValidator(whole),
        Ge(0),
        Le(MAX_MOVERS),
        Option(
            "Number of people and carts, drawn from the seed, that are added to the movers of the "
            f"twin's scene; {MAX_MOVERS} together at most.",
            "N",
            ROOM,
            of_drone=True,
        ),
    ] = 0
    vary_room: Annotated[bool, Option(group=ROOM, of_drone=True)] = False
    """Place and size the scene's boxes by the seed."""
    faults: Annotated[
        Sequence[str],
        Checked(lambda _, value: fault_texts(value)),
        Option("", "KIND[=LEVEL][@PHASE[+S]][~S]", ROOM),
    ] = ()
    """A fault of the drone, such as video-lost@explore+1~3, or `random`: room, movers and faults
    are drawn from the seed. Repeatable."""
    exact_masks: Annotated[bool, Option(group=ROOM)] = False
    """Fly on exact masks instead of a network's."""
    realtime: Annotated[bool, Option(group=ROOM, of_drone=True)] = False
    """Fly the twin no faster than real time."""
    image_size_px: ImageSize = (640, 360)
    lab: Annotated[
        str | Path | Lab | None,
        loaded(Lab, lambda name: load_lab(str(name)), "the name of a lab, its folder, or a Lab"),
        Option("", "NAME", "Place"),
    ] = None
    """The lab that is flown in, real or simulated: a shipped lab, a folder of labs/, or a path. Its
    lab file has all keys of a site file."""
    drone: Annotated[
        str | DroneConfig | Drone,
        Checked(lambda _, value: check_drone(value)),
        Option("", "NAME[:ADDRESS]", REAL),
    ] = "twin"
    """The drone that flies: twin, plain (the twin without images), anafi[:HOST[:PORT]],
    sphinx[:HOST[:PORT]], or another that is installed."""
    site: Annotated[
        str | Path | Site | None,
        loaded(Site, lambda file: load_site(Path(file)), "a site file or a Site"),
        Option(group=REAL, path="read"),
    ] = None
    """A site file: heights, camera, classes and limits of the place."""
    camera: Annotated[str | Path | None, Checked(as_file), Option(group=REAL, path="read")] = None
    """A camera file of `uav-bt lab calibrate`: frames are undistorted with it."""
    rehearse: Annotated[bool, Option(group=REAL)] = False
    """Motors off: perception and tree see the live video, and show what would be sent."""
    inference_threads: Threads = 1
    limits: Annotated[Limits | None, Option()] = None
    """Limits that no command exceeds; None: those of site or lab. Where both state limits, the
    smaller ones hold."""
    runner: Annotated[RunnerConfig, Option()] = field(default_factory=RunnerConfig)
    """Length of a tick, and how long a landing may take."""

    __repr__ = brief_repr

    @model_validator(mode="wrap")
    @classmethod
    def _refusing(cls, given: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        try:
            return handler(given)
        except ValidationError as error:
            raise InputError(_refusal(error)) from error

    def __post_init__(self) -> None:
        if self.lab is not None and self.site is not None:
            raise InputError(
                "--lab and --site (lab and site in Python) both say how the place is flown: give "
                "one of them; a lab file has all keys of a site file"
            )
        if not isinstance(self.drone, str):
            who = f"{type(self.drone).__name__} is flown as it is and"
            refuse_unusable(self, who, {"seed"}, remedy="set it there")
            # The class is frozen for all others.
            object.__setattr__(self, "seed", common_seed(self.drone, self.seed))

    def shared_json(self) -> dict[str, Any]:
        """Return the fields in `SHARED` as plain JSON values that make them again in any folder."""
        plain = _adapter().dump_python(self, mode="json", include={*SHARED} - {"lab"})
        lab = lab_address(self.lab) if isinstance(self.lab, Lab) else None
        folders = self.tree_folders.to_json()
        return {**plain, "lab": lab, "policies": self.policy_names, "tree_folders": folders}

    @classmethod
    def of_json(cls, values: Mapping[str, Any]) -> FlightOptions:
        """Return options with the values that `shared_json` wrote."""
        judge = {each.name: values["judge"][each.name] for each in fields(JudgeConfig)}
        return _adapter().validate_json(json.dumps({**values, "judge": judge}))

    @cached_property
    def place(self) -> Site | None:
        """The site of these options, or that of their lab; None without both."""
        if isinstance(self.lab, Lab):
            return site_of_lab(self.lab)
        return self.site if isinstance(self.site, Site) else None

    @property
    def drone_name(self) -> str:
        """Name of the drone in reports and records: its name, or its class."""
        return self.drone if isinstance(self.drone, str) else class_name(self.drone)

    @property
    def parameters(self) -> Parameters:
        """Ports and variables of the options, and beneath them those of the parameter file."""
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


_ABOUT: Final = {each.name: option_of(FlightOptions, each.name) for each in fields(FlightOptions)}
# Each attribute is described where it is declared, and `help` shows it.
_ATTRIBUTES: Final = "\n".join(f"    {name}: {about.help}" for name, about in _ABOUT.items())
FlightOptions.__doc__ = (
    f"{inspect.cleandoc(str(FlightOptions.__doc__))}\n\nAttributes:\n{_ATTRIBUTES}\n"
)

IN_COMMANDS: Final = tuple(name for name, about in _ABOUT.items() if about.group)
"""Fields of `FlightOptions` that `uav-bt fly` has as options; the others are for Python."""
OF_DRONE: Final = tuple(name for name, about in _ABOUT.items() if about.of_drone)
"""Fields of `FlightOptions` that a drone's configuration gets if it has fields of these names."""
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
    words = first["msg"].removeprefix("Input should be ")
    number = "a number " if "than" in first["type"] else ""
    return f"{first['loc'][0]}: expected {number}{words}, got {first['input']!r:.80}"


@cache
def _adapter() -> TypeAdapter[FlightOptions]:
    return TypeAdapter(FlightOptions)


def given_options(options: FlightOptions | None, how: Mapping[str, Any]) -> FlightOptions:
    """Return the options of a flight: those of an object, some of them replaced by `how`."""
    expect("options", options, FlightOptions | None, "FlightOptions(...)")
    return replace(options, **how) if options else FlightOptions(**how)
