"""How a mission is flown: the options of one flight, declared once for Python and command line."""

from __future__ import annotations

import dataclasses
import inspect
import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field, fields, replace
from functools import cache, cached_property
from numbers import Integral
from pathlib import Path
from typing import Annotated, Any, Final, Self

from annotated_types import Ge, Gt, Le
from pydantic import (
    BeforeValidator,
    ConfigDict,
    GetCoreSchemaHandler,
    ModelWrapValidatorHandler,
    TypeAdapter,
    ValidationError,
    model_validator,
)
from pydantic.dataclasses import dataclass
from pydantic_core import CoreSchema, core_schema

from sim_bridge.twin.scene import MAX_MOVERS
from uav_bt.app.option_values import (
    as_file,
    check_drone,
    check_policies,
    class_name,
    common_seed,
    expect,
    fault_texts,
    files,
    port_values,
    refuse,
    refuse_unusable,
    variable_values,
)
from uav_bt.app.site import Site, load_site, site_of_lab
from uav_bt.brief import brief_repr
from uav_bt.errors import InputError, UnknownNameError
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import lab_address, load_lab
from uav_bt.mission.judge import JudgeConfig
from uav_bt.mission.limits import Limits
from uav_bt.mission.runner import RunnerConfig
from uav_bt.option import Option, option_of, pairs
from uav_bt.protocols import Drone, DroneConfig, LeafPolicy
from uav_bt.record.config import Quality
from uav_bt.tree.loading.lookup import Folders, TreeFolders, TreeId
from uav_bt.tree.loading.parameter_file import ParameterFile, read_parameters
from uav_bt.tree.loading.parameters import PARAMS, Parameters, Ports, Variables
from uav_bt.tree.registry import OwnLeaves, OwnParts, parts_of_files


@dataclasses.dataclass(frozen=True)
class _Checked:
    """A function of the option's name and value checks it, whatever its type, and returns it."""

    check: Callable[[str, Any], Any]

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        del source
        name = str(handler.field_name)
        return core_schema.no_info_plain_validator_function(lambda value: self.check(name, value))


def _written(name: str, value: object) -> Path | None:
    path, suffix = as_file(name, value), option_of(FlightOptions, name).suffix
    if path is not None and path.suffix.lower() != suffix:
        refuse(name, f"a file whose name ends in {suffix}", str(path))
    return path


def _scene(name: str, value: object) -> str | None:
    expected = "the name or file of a scene (a Scene belongs to the drone, as PlainConfig(scene=))"
    return None if as_file(name, value, expected) is None else str(value)


def _loaded(kind: type, load: Callable[[Any], Any], expected: str) -> _Checked:
    """Return a check that takes an object, and loads that of a file or a name."""

    def check(name: str, value: object) -> Any:
        if value is None or isinstance(value, kind):
            return value
        as_file(name, value, expected)
        return load(value)

    return _Checked(check)


def _whole(value: object) -> object:
    """Return an integer of NumPy as `int`; others are checked after this."""
    return int(value) if isinstance(value, Integral) and not isinstance(value, bool) else value


def _size(value: object) -> object:
    sides = tuple(value) if isinstance(value, Iterable) else ()
    if len(sides) != 2:
        refuse("image_size_px", "width and height in pixels, such as (640, 360)", value)
    return tuple(_whole(side) for side in sides)


def _size_of_text(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"([1-9]\d{0,4})[xX]([1-9]\d{0,4})", text)
    if match is None:
        raise InputError(f"expected a size such as 640x360, got '{text}'")
    return int(match[1]), int(match[2])


def _policies_of_texts(texts: Iterable[str]) -> dict[str, str]:
    # The last sign counts: a path of a tree may hold others.
    found = pairs(texts, "node", "NODE=NAME, such as Explore=segmentation", last=True)
    for node, policy in found.items():
        if not policy:
            raise InputError(f"expected NODE=NAME, such as Explore=segmentation, got '{node}='")
    return found


def _judge(
    *,
    judge: Annotated[
        float | None,
        Gt(0),
        Option(
            "End the flight as a timeout this long after the take-off command. Default: as the "
            "mission's Rules say, else 300 s.",
            "--time-limit SECONDS",
            "Mission",
        ),
    ] = None,
) -> JudgeConfig:
    return JudgeConfig(time_limit_s=judge)


Seed = Annotated[
    int,
    BeforeValidator(_whole),
    Ge(0),
    Option("Seed of everything random.", "", "Simulated room", of_drone=True),
]
Policies = Annotated[
    Mapping[str, str | LeafPolicy],
    _Checked(lambda _, value: check_policies(value)),
    Option(
        "Let a node, by name or path, use another leaf policy. Repeatable.",
        "--policy NODE=NAME",
        "Mission",
        read=_policies_of_texts,
    ),
]
Profile = Annotated[
    str,
    Option(
        "How imperfect the twin is: ideal, lab or harsh; lab-instant and harsh-instant have "
        "telemetry without delay.",
        "NAME",
        "Simulated room",
        of_drone=True,
    ),
]
ImageSize = Annotated[
    tuple[Annotated[int, Ge(1)], Annotated[int, Ge(1)]],
    BeforeValidator(_size),
    Option(
        "Size of the camera's frames, 16:9.",
        "--image-size WxH",
        "Simulated room",
        of_drone=True,
        read=_size_of_text,
        write="{0[0]}x{0[1]}".format,
    ),
]
Threads = Annotated[
    int,
    BeforeValidator(_whole),
    Ge(1),
    Option(
        "Threads of the networks' inference. With one, a flight does not depend on the machine's "
        "load.",
        "--threads",
        "Options",
    ),
]


@dataclass(
    frozen=True,
    kw_only=True,
    repr=False,
    config=ConfigDict(strict=True, extra="forbid", arbitrary_types_allowed=True),
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
    leaves: Annotated[OwnLeaves, _Checked(lambda _, value: files(value))] = ()
    ports: Annotated[Ports, _Checked(lambda _, value: port_values(value))] = field(
        default_factory=dict
    )
    variables: Annotated[Variables, _Checked(lambda _, value: variable_values(value))] = field(
        default_factory=dict
    )
    params: Annotated[
        str | Path | ParameterFile | None,
        _loaded(ParameterFile, lambda file: read_parameters(Path(file)), "a parameter file"),
        PARAMS,
    ] = None
    policies: Policies = field(default_factory=dict)
    judge: Annotated[
        JudgeConfig,
        Option("When a flight is over, and what counts as a success.", "", "Mission", parts=_judge),
    ] = field(default_factory=JudgeConfig)
    record: Annotated[
        str | Path | None,
        _Checked(_written),
        Option(
            "Keep the flight's record: an MCAP file, for viewers and for replay.",
            "",
            "Outputs",
            path="written",
            suffix=".mcap",
        ),
    ] = None
    record_quality: Annotated[
        Quality,
        Option(
            "Quality of the record's images: lossless, which replays exactly, high or small. At "
            "640x360 a minute takes about 240, 35 or 14 MB.",
            "--quality",
            "Outputs",
        ),
    ] = "lossless"
    scene: Annotated[
        str | Path | None,
        _Checked(_scene),
        Option(
            "The twin's lab: a shipped scene or a YAML file.",
            "SCENE",
            "Simulated room",
            of_drone=True,
        ),
    ] = None
    seed: Seed = 0
    profile: Profile = "lab"
    movers: Annotated[
        int,
        BeforeValidator(_whole),
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
    vary_room: Annotated[
        bool,
        Option(
            "Place and size the scene's boxes by the seed.", "", "Simulated room", of_drone=True
        ),
    ] = False
    faults: Annotated[
        Sequence[str],
        _Checked(lambda _, value: fault_texts(value)),
        Option(
            "A fault of the drone, such as video-lost@explore+1~3, or `random`: room, movers and "
            "faults are drawn from the seed. Repeatable.",
            "KIND[=LEVEL][@PHASE[+S]][~S]",
            "Simulated room",
        ),
    ] = ()
    exact_masks: Annotated[
        bool,
        Option("Fly on exact masks instead of a network's.", "", "Simulated room"),
    ] = False
    realtime: Annotated[
        bool,
        Option("Fly the twin no faster than real time.", "", "Simulated room", of_drone=True),
    ] = False
    image_size_px: ImageSize = (640, 360)
    lab: Annotated[
        str | Path | Lab | None,
        _loaded(Lab, lambda path: load_lab(str(path)), "the name of a lab, its folder, or a Lab"),
        Option(
            "The lab that is flown in, real or simulated: a shipped lab, a folder of labs/, or a "
            "path. Its lab file has all keys of a site file.",
            "NAME",
            "Place",
        ),
    ] = None
    drone: Annotated[
        str | DroneConfig | Drone,
        _Checked(lambda _, value: check_drone(value)),
        Option(
            "The drone that flies: twin, plain (the twin without images), anafi[:HOST[:PORT]], "
            "sphinx[:HOST[:PORT]], or another that is installed.",
            "NAME[:ADDRESS]",
            "Real drone",
        ),
    ] = "twin"
    site: Annotated[
        str | Path | Site | None,
        _loaded(Site, lambda file: load_site(Path(file)), "a site file or a Site"),
        Option(
            "A site file: heights, camera, classes and limits of the place.",
            "",
            "Real drone",
            path="read",
        ),
    ] = None
    camera: Annotated[
        str | Path | None,
        _Checked(as_file),
        Option(
            "A camera file of `uav-bt lab calibrate`: frames are undistorted with it.",
            "",
            "Real drone",
            path="read",
        ),
    ] = None
    rehearse: Annotated[
        bool,
        Option(
            "Motors off: perception and tree see the live video, and show what would be sent.",
            "",
            "Real drone",
        ),
    ] = False
    inference_threads: Threads = 1
    limits: Annotated[
        Limits | None,
        Option(
            "Limits that no command exceeds; None: those of site or lab. Where both state limits, "
            "the smaller ones hold."
        ),
    ] = None
    runner: Annotated[
        RunnerConfig, Option("Length of a tick, and how long a landing may take.")
    ] = field(default_factory=RunnerConfig)

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
