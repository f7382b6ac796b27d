"""How a mission is flown: the options of one flight, declared once for Python and command line."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final, get_args

from uav_bt.app.option_declaration import Declared, about
from uav_bt.app.option_values import (
    CHECKED,
    as_file,
    check_drone,
    check_policies,
    class_name,
    common_seed,
    expect,
    refuse_unusable,
)
from uav_bt.app.site import Site, load_site, site_of_lab
from uav_bt.brief import brief_repr
from uav_bt.errors import InputError, UnknownNameError
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import load_lab
from uav_bt.mission.judge import JudgeConfig
from uav_bt.mission.limits import Limits
from uav_bt.mission.runner import RunnerConfig
from uav_bt.protocols import Drone, DroneConfig, LeafPolicy
from uav_bt.record.config import Quality
from uav_bt.tree.loading.lookup import WHICH_TREE, TreeFolders
from uav_bt.tree.loading.parameter_file import ParameterFile, read_parameters
from uav_bt.tree.loading.parameters import (
    WHICH_PARAMS,
    WHICH_PORTS,
    WHICH_VARIABLES,
    Parameters,
    Plain,
)
from uav_bt.tree.registry import LEAVES_FLAG, WHICH_LEAVES, OwnParts, parts_of_files


def declared(name: str) -> tuple[Declared, Any]:
    """Return the declaration and the default of a field of `FlightOptions`."""
    one = FlightOptions.__dataclass_fields__[name]
    default = one.default if one.default_factory is MISSING else one.default_factory()
    return one.metadata["declared"], default


@dataclass(frozen=True, kw_only=True)
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

    scene: str | Path | None = field(
        default=None,
        metadata=about(
            "The twin's lab: a shipped scene or a YAML file.", "--scene", metavar="SCENE"
        ),
    )
    seed: int = field(default=0, metadata=about("Seed of everything random.", "--seed", least=0))
    drone: str | DroneConfig | Drone = field(
        default="twin",
        metadata=about(
            "The drone that flies: twin, plain (the twin without images), anafi[:HOST[:PORT]], "
            "sphinx[:HOST[:PORT]], or another that is installed.",
            "--drone",
            metavar="NAME[:ADDRESS]",
        ),
    )
    lab: str | Path | Lab | None = field(
        default=None,
        metadata=about(
            "The lab that is flown in, real or simulated: a shipped lab, a folder of labs/, or a "
            "path. Its lab file has all keys of a site file.",
            "--lab",
            metavar="NAME",
        ),
    )
    site: str | Path | Site | None = field(
        default=None,
        metadata=about(
            "A site file: heights, camera, classes and limits of the place.",
            "--site",
            metavar="FILE",
            file="read",
        ),
    )
    rehearse: bool = field(
        default=False,
        metadata=about(
            "Motors off: perception and tree see the live video, and show what would be sent.",
            "--rehearse",
        ),
    )
    profile: str = field(
        default="lab",
        metadata=about(
            "How imperfect the twin is: ideal, lab or harsh; lab-instant and harsh-instant have "
            "telemetry without delay.",
            "--profile",
            metavar="NAME",
        ),
    )
    movers: int = field(
        default=0,
        metadata=about(
            "Number of people and carts, drawn from the seed, that are added to the "
            "movers of the twin's scene; 8 together at most.",
            "--movers",
            metavar="N",
            least=0,
        ),
    )
    vary_room: bool = field(
        default=False,
        metadata=about("Place and size the scene's boxes by the seed.", "--vary-room"),
    )
    faults: Sequence[str] = field(
        default=(),
        metadata=about(
            "A fault of the drone, such as video-lost@explore+1~3, or `random`: room, movers and "
            "faults are drawn from the seed. Repeatable.",
            "--faults",
            metavar="KIND[=LEVEL][@PHASE[+S]][~S]",
        ),
    )
    policies: Mapping[str, str | LeafPolicy] = field(
        default_factory=dict,
        metadata=about(
            "Let a node, by name or path, use another leaf policy. Repeatable.",
            "--policy",
            metavar="NODE=NAME",
        ),
    )
    ports: Mapping[str, str] = field(
        default_factory=dict,
        metadata=about(WHICH_PORTS, "--set", metavar="NODE.PORT=VALUE"),
    )
    variables: Mapping[str, Plain] = field(
        default_factory=dict, metadata=about(WHICH_VARIABLES, "--var", metavar="NAME=VALUE")
    )
    params: str | Path | ParameterFile | None = field(
        default=None,
        metadata=about(WHICH_PARAMS, "--params", metavar="FILE.yaml"),
    )
    leaves: Sequence[str | Path] = field(
        default=(),
        metadata=about(WHICH_LEAVES, LEAVES_FLAG, metavar="FILE.py"),
    )
    camera: str | Path | None = field(
        default=None,
        metadata=about(
            "A camera file of `uav-bt lab calibrate`: frames are undistorted with it.",
            "--camera",
            metavar="FILE",
            file="read",
        ),
    )
    exact_masks: bool = field(
        default=False,
        metadata=about("Fly on exact masks instead of a network's.", "--exact-masks"),
    )
    record: str | Path | None = field(
        default=None,
        metadata=about(
            "Keep the flight's record: an MCAP file, for viewers and for replay.",
            "--record",
            metavar="FILE",
            file="written",
            suffix=".mcap",
        ),
    )
    record_quality: Quality = field(
        default="lossless",
        metadata=about(
            "Quality of the record's images: lossless, which replays exactly, high or small. At "
            "640x360 a minute takes about 240, 35 or 14 MB.",
            "--quality",
            choices=get_args(Quality),
        ),
    )
    realtime: bool = field(
        default=False,
        metadata=about("Fly the twin no faster than real time.", "--realtime"),
    )
    tree_id: str | None = field(
        default=None,
        metadata=about(WHICH_TREE),
    )
    tree_folders: TreeFolders = field(
        default_factory=TreeFolders,
        metadata=about("Folders of trees and included files that the tree file does not hold."),
    )
    image_size_px: tuple[int, int] = field(
        default=(640, 360),
        metadata=about("Size of the camera's frames, 16:9.", "--image-size", metavar="WxH"),
    )
    inference_threads: int = field(
        default=1,
        metadata=about(
            "Threads of the networks' inference. With one, a flight does not depend on the "
            "machine's load.",
            "--threads",
            least=1,
        ),
    )
    limits: Limits | None = field(
        default=None,
        metadata=about(
            "Limits that no command exceeds; None: those of site or lab. Where both state limits, "
            "the smaller ones hold."
        ),
    )
    runner: RunnerConfig = field(
        default_factory=RunnerConfig,
        metadata=about("Length of a tick, and how long a landing may take."),
    )
    judge: JudgeConfig = field(
        default_factory=JudgeConfig,
        metadata=about("When a flight is over, and what counts as a success.", "--time-limit"),
    )

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        if not isinstance(self.site, Site):
            site = as_file("site", self.site, "a site file or a Site")
            self._set("site", None if site is None else load_site(site))
        if not isinstance(self.lab, Lab):
            lab = as_file("lab", self.lab, "the name of a lab, its folder, or a Lab")
            self._set("lab", None if lab is None else load_lab(str(self.lab)))
        if self.lab is not None and self.site is not None:
            raise InputError(
                "--lab and --site (lab and site in Python) both say how the place is flown: give "
                "one of them; a lab file has all keys of a site file"
            )
        for each in fields(self):
            if each.name not in {"lab", "site"}:
                known, given = each.metadata["declared"], getattr(self, each.name)
                self._set(each.name, known.checked(each.name, given, each.default))
        if not isinstance(self.params, ParameterFile):
            params = as_file("params", self.params, "a parameter file")
            self._set("params", None if params is None else read_parameters(params))
        for name, (kind, expected) in _TYPES.items():
            expect(name, getattr(self, name), kind, expected)
        for name, checked in CHECKED.items():
            self._set(name, checked(getattr(self, name)))
        check_policies(self.policies)
        check_drone(self.drone)
        if not isinstance(self.drone, str):
            who = f"{type(self.drone).__name__} is flown as it is and"
            refuse_unusable(self, who, {"seed"}, remedy="set it there")
            self._set("seed", common_seed(self.drone, self.seed))

    def _set(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)  # as the class is frozen for all others

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


# Each attribute is described where it is declared, and `help` shows it.
_ATTRIBUTES: Final = "\n".join(
    f"    {each.name}: {each.metadata['declared'].help}" for each in fields(FlightOptions)
)
FlightOptions.__doc__ = (
    f"{inspect.cleandoc(str(FlightOptions.__doc__))}\n\nAttributes:\n{_ATTRIBUTES}\n"
)

_TYPES: Final[Mapping[str, tuple[Any, str]]] = {
    "limits": (Limits | None, "a Limits"),
    "runner": (RunnerConfig, "a RunnerConfig"),
    "judge": (JudgeConfig, "a JudgeConfig"),
    "tree_id": (str | None, "the ID of a tree, or None"),
    "tree_folders": (TreeFolders, "a TreeFolders"),
    "profile": (str, "the name of a profile: ideal, lab or harsh"),
}


def given_options(options: FlightOptions | None, how: Mapping[str, Any]) -> FlightOptions:
    """Return the options of a flight, from an object or from its fields.

    Args:
        options: Object with the options. None: defaults.
        how: Values by field name. They replace the object's.

    Raises:
        InputError: `options` has another type, or a field does not exist.
    """
    expect("options", options, FlightOptions | None, "FlightOptions(...)")
    names = [each.name for each in fields(FlightOptions)]
    for name in how:
        if name not in names:
            raise UnknownNameError("flight option", name, names)
    return replace(options or FlightOptions(), **how)
