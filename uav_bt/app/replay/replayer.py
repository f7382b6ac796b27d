"""A recorded flight through perception and tree again."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any, Literal

from uav_bt import app
from uav_bt.app.flight_record import TREE_FOLDER
from uav_bt.app.replay.differences import LOSSY_NUMBERS, Comparison, ReplayReport
from uav_bt.app.replay.recorded_drone import RecordedDrone, RecordedSegmenter
from uav_bt.app.replay.replay_runner import ComparingListener, ReplayJudge, ReplayRunner
from uav_bt.board import MISSION_KEYS
from uav_bt.board.blackboard import Blackboard
from uav_bt.board.context import MissionContext
from uav_bt.board.proposals import Proposals
from uav_bt.errors import FileError, NodeFailedError, TreeError
from uav_bt.mission.arbiter import Limits
from uav_bt.mission.runner import RunnerConfig
from uav_bt.record.reader import RecordReader
from uav_bt.tree import MissionTree, load_tree
from uav_bt.tree.policy_check import unknown_policies

__all__ = ["ReplayOptions", "replay"]


@dataclass(frozen=True, kw_only=True)
class ReplayOptions:
    """What is different this time."""

    tree: str | Path | None = None  # another mission; None: the recorded one
    policies: Mapping[str, str] = field(default_factory=dict)  # node's name or path -> policy
    # Whose class maps the tree gets; None: a network's, unless the flight flew on exact masks.
    masks: Literal["network", "recorded"] | None = None


def replay(record: Path, options: ReplayOptions | None = None) -> ReplayReport:
    """Feed a recorded flight through perception and tree again, and compare.

    Args:
        record: the MCAP file.
        options: what is different this time.

    Raises:
        FileError: the record cannot be read or replayed.
        TreeError: the tree was refused.
        InputError: a policy, a network or something else is not there.
    """
    options = options or ReplayOptions()
    reader = RecordReader(record)
    _check_beginning(reader)
    told = _Told(reader)
    tree = _load(reader, told, options)
    drone = RecordedDrone(reader)
    exact_masks = told.value("exact_masks", False)
    masks = options.masks or ("recorded" if exact_masks else "network")
    context = MissionContext(
        board=Blackboard(drone.clock, MISSION_KEYS),
        clock=drone.clock,
        proposals=Proposals(),
        policy=app.make_policy,
        seed=told.value("seed", 0),
        inference_threads=told.value("inference_threads", 1),
        segmenter=RecordedSegmenter(drone) if masks == "recorded" else None,
    )
    tree.setup(context)
    lossless = told.value("record_quality", "lossless") == "lossless"
    comparison = Comparison(
        reader.tree, tree, drone.ids, tolerance=0.0 if lossless else LOSSY_NUMBERS
    )
    runner = ReplayRunner(
        drone,
        tree,
        context,
        ReplayJudge(drone),
        limits=Limits(**told.value("limits", {})),
        config=RunnerConfig(**told.value("runner", {})),
        listeners=[ComparingListener(drone, comparison)],
    )
    runner.recorded = drone
    ended = None
    try:
        runner.run()
    except NodeFailedError as error:
        ended = str(error)  # a replayed change may well fail; that is what it is tried for
    end = reader.end
    return ReplayReport(
        record=str(record),
        tree=str(options.tree or reader.metadata.get("tree", "")),
        outcome=None if end is None else end.get("outcome"),
        exact=lossless and not drone.missing_pictures and not reader.damages,
        masks=masks,
        ticks=comparison.ticks,
        status_ticks=comparison.status_ticks,
        command_ticks=comparison.command_ticks,
        differing_ticks=comparison.differing_ticks,
        differences=tuple(comparison.differences),
        nodes=dict(comparison.nodes.most_common()),
        only_recorded=comparison.only_recorded,
        only_replayed=comparison.only_replayed,
        missing_pictures=drone.missing_pictures,
        damages=reader.damages,
        ended=ended,
    )


class _Told:
    """The flight's options as the record tells them."""

    def __init__(self, reader: RecordReader) -> None:
        self._reader = reader

    def value(self, name: str, default: Any) -> Any:
        text = self._reader.metadata.get(name)
        if text is None:
            return default
        if isinstance(default, str):
            return text
        try:
            return json.loads(text)
        except ValueError as error:
            raise FileError(
                self._reader.path, f"the record's metadata is damaged: '{name}' is '{text:.80}'"
            ) from error


def _check_beginning(reader: RecordReader) -> None:
    first = next(reader.moments(), None)
    if first is not None and first.tick.index > 0:
        begins_s = first.tick.time_s - reader.timeline.start_s
        raise FileError(
            reader.path,
            f"begins {begins_s:.1f} s into its flight; what tree and perception remember by then "
            "is not in it: replay the whole record",
        )


def _load(reader: RecordReader, told: _Told, options: ReplayOptions) -> MissionTree:
    recorded: dict[str, str] = told.value("policies", {})
    if options.tree is not None:
        path = app.resolve_tree(options.tree)
        return _checked(path, dict(options.policies))
    with TemporaryDirectory(prefix="uav-bt-replay-") as folder:
        path = _unpack(reader, Path(folder))
        return _checked(path, {**recorded, **options.policies})


def _checked(path: Path, policies: Mapping[str, str]) -> MissionTree:
    overrides = {node: {"policy": policy} for node, policy in policies.items()}
    tree = load_tree(path, overrides=overrides)
    unknown = unknown_policies(tree, path)
    if unknown:
        raise TreeError(path, [str(finding) for finding in unknown])
    return tree


def _unpack(reader: RecordReader, folder: Path) -> Path:
    """Write the recorded tree files into a folder; return the mission's own."""
    for name, attachment in reader.attachments.items():
        if not name.startswith(TREE_FOLDER):
            continue
        inside = PurePosixPath(name.removeprefix(TREE_FOLDER))
        if inside.is_absolute() or ".." in inside.parts:
            raise FileError(reader.path, f"its tree file '{inside}' lies outside its folder")
        target = folder / inside
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(attachment.data)
    path = folder / reader.metadata.get("tree", "")
    if not path.is_file():
        raise FileError(reader.path, "the record lacks its tree file; give one with --tree")
    return path
