"""A recorded flight through perception and tree again."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, Final, Literal, get_args

from uav_bt.app.assembly import Flight
from uav_bt.app.flight_record import RecordedOptions, recorded_options, recorded_tree
from uav_bt.app.loading import Mission, is_text, read_mission
from uav_bt.app.option_values import Policies, refuse
from uav_bt.app.options import FlightOptions
from uav_bt.app.place import conditions_of
from uav_bt.app.replay.differences import Comparison, ReplayReport
from uav_bt.app.replay.recorded_drone import RecordedDrone
from uav_bt.board import CLASS_MAP, FRAME
from uav_bt.board.context import FlightFolder
from uav_bt.errors import FileError, InputError, NodeFailedError
from uav_bt.mission.judge import Judge, JudgeConfig, Outcome, Verdict
from uav_bt.mission.runner import MissionRunner
from uav_bt.mission.safety import Override
from uav_bt.mission.tick import TickRecord
from uav_bt.option import Option
from uav_bt.record import channels
from uav_bt.record.reader import RecordReader
from uav_bt.tree import MissionTree, NodeRegistry, Status
from uav_bt.tree.loading.lookup import Folders, TreeFolders
from uav_bt.tree.registry import OwnLeaves
from uav_bt.types.area import Area

Masks = Literal["network", "recorded"]

_AS_FLOWN: Final = ("seed", "inference_threads", "record_quality", "site", "limits", "runner")
_OVER: Final = frozenset({"SUCCESS", "FAILURE"})
_STOPPED: Final = frozenset({Override.ABORT, Override.BATTERY})
_AS_RECORDED: Final = "stopped, as in the recording"


@dataclass(frozen=True, kw_only=True)
class ReplayOptions:
    """Changes of a replay, and values that are not in the record.

    In Python `tree` may also be a mission that was composed there, and a policy an object with
    `decide`. `registry` has the nodes that may occur; None: all installed.

    Options:
        tree: Replay this mission, not the recorded one.
        masks: Where class maps come from; default: the tree's network, or the record if the flight
            flew on exact masks.
    """

    tree: Annotated[Mission | None, Option(form="TREE")] = None
    tree_folders: Folders = field(default_factory=TreeFolders)
    leaves: OwnLeaves = ()
    policies: Policies = field(default_factory=dict)
    masks: Masks | None = None
    registry: NodeRegistry | None = None

    def __post_init__(self) -> None:
        if self.tree is None and self.tree_folders != TreeFolders():
            raise InputError(
                "a record has its own tree files: folders are for another --tree (tree in Python)"
            )


def replay(record: str | Path, options: ReplayOptions | None = None) -> ReplayReport:
    """Feed a recorded flight through perception and tree again, and compare.

    Args:
        record: the MCAP file.
        options: Changes, and values that are not in the record.

    Raises:
        FileError: the record cannot be read or replayed.
        TreeError: the tree was refused.
        InputError: a policy, a network or something else is not there.
    """
    changes = options or ReplayOptions()
    reader = RecordReader(record)
    flight, masks = assemble_recorded(reader, changes)
    drone, lossless = flight.drone, flight.options.record_quality == "lossless"
    tree = reader.metadata.get("tree", "")
    if changes.tree is not None:
        named = isinstance(changes.tree, str | Path) and not is_text(changes.tree)
        tree = str(changes.tree) if named else flight.mission.origin
    outcome = (reader.end or {}).get("outcome")
    report = ReplayReport(
        record=str(record), tree=tree, outcome=outcome, exact=lossless, masks=masks
    )
    comparison = Comparison(report, reader.tree, flight.mission, drone)
    try:
        with TemporaryDirectory(prefix="uav-bt-replay-") as folder:
            # The replay's files are dropped; leaves must answer as in the flight.
            keeps_files = recorded_options(reader).outputs
            flight.outputs = FlightFolder(Path(folder)) if keeps_files else None
            with flight.connected():
                flight.runner([comparison]).run()
    except NodeFailedError as error:
        report.ended = str(error)  # a replayed change may fail
    report.missing_images, report.damages = drone.missing_images, reader.damages
    report.exact = lossless and not drone.missing_images and not reader.damages
    return report


def assemble_recorded(
    reader: RecordReader, changes: ReplayOptions
) -> tuple[Flight[RecordedDrone], Masks]:
    """Return a recorded flight, and whose class maps it gets."""
    recorded = recorded_options(reader)
    if recorded.imageless:
        raise FileError(
            reader.path,
            "was flown without images, and shows nothing to perceive: fly it again with its seed",
        )
    drone = RecordedDrone(reader, recorded.airframe)
    if drone.moment.tick.index > 0:
        at_s = drone.now() - reader.timeline.start_s
        raise FileError(reader.path, f"begins {at_s:.1f} s into its flight: give the whole record")
    masks = changes.masks or ("recorded" if recorded.exact_masks else "network")
    if masks not in get_args(Masks):
        refuse("masks", "network or recorded, or None", masks)
    flown = {name: getattr(recorded, name) for name in _AS_FLOWN}
    options = FlightOptions(
        **flown, policies=changes.policies, leaves=changes.leaves, tree_folders=changes.tree_folders
    )
    if changes.tree is None:
        mission = _recorded_mission(reader, recorded, options, changes)
    else:
        # Attributes and variables that the recorded mission had may name none of this one.
        mission = read_mission(changes.tree, options, changes.registry)
    _check_complete(reader, mission, masks)
    area = None if recorded.area is None else Area(recorded.area)
    held = conditions_of(options, mission, drone, recorded=True)
    held = replace(held, classes=reader.classes, area=area)
    segmenter = drone if masks == "recorded" else None
    judge = _ReplayJudge(drone, recorded.judge)
    return Flight(mission, drone, options, held, judge, segmenter, _ReplayRunner), masks


def _check_complete(reader: RecordReader, mission: MissionTree, masks: Masks) -> None:
    """Refuse a record that lacks the tree's frames or class maps."""
    perceives = any(FRAME in leaf.reads for leaf in mission.leaves())
    segments = any(CLASS_MAP in leaf.writes for leaf in mission.leaves())
    for topic, what, needed in (
        (channels.CAMERA_FRAME.topic, "frames", perceives),
        (channels.CAMERA_IMAGE.topic, "frames", perceives),
        (channels.CLASS_MAP.topic, "class maps", segments and masks == "recorded"),
    ):
        if needed and next(reader.messages([topic]), None) is None:
            raise FileError(
                reader.path, f"has no {what} (no message on {topic}); give it as it was flown"
            )


def _recorded_mission(
    reader: RecordReader, recorded: RecordedOptions, options: FlightOptions, changes: ReplayOptions
) -> MissionTree:
    """Load the recorded tree, with the policies of the options."""
    tree = recorded_tree(reader)
    if tree is None:
        name = reader.metadata.get("tree", "")
        raise FileError(
            reader.path,
            f"the record lacks its tree file ({name}); give the tree with --tree, or with "
            "ReplayOptions(tree=...)",
        )
    options = replace(options, tree_id=reader.metadata.get("tree_name"))
    mission = read_mission(tree, options, changes.registry, replaced=recorded.replaced)
    for name, value in recorded.variables.items():
        mission.variables[name] = value
    return mission


class _ReplayJudge(Judge):
    """Ends the replay with the recording's last tick, whatever happens."""

    def __init__(self, drone: RecordedDrone, config: JudgeConfig) -> None:
        super().__init__(config)
        self._drone = drone

    def verdict(self, record: TickRecord, **_: Any) -> Verdict | None:
        """Return that the recording is over, None while it goes on."""
        del record
        over = Verdict(Outcome.SUCCESS, "the recording is over")
        return over if self._drone.at_end else None


class _ReplayRunner(MissionRunner):
    """Repeats an operator's stop in the tick in which it came."""

    def __init__(self, drone: RecordedDrone, *rest: Any, **named: Any) -> None:
        super().__init__(drone, *rest, **named)
        self._recorded = drone

    def _tick_tree(self) -> Status:
        # A stop that the runner does not come to by itself. One between two ticks keeps the tree
        # from being ticked; one within comes after.
        before, now = self._recorded.before, self._recorded.moment
        stopped = now.commands.override is Override.ABORT and (
            before is None
            or (before.commands.override not in _STOPPED and before.tick.tree_status not in _OVER)
        )
        if stopped and now.tick.tree_status == Status.IDLE.name:
            self.abort.request(_AS_RECORDED)
        status = super()._tick_tree()
        if stopped:
            self.abort.request(_AS_RECORDED)
        return status
