"""Facts and files in a flight's record beside its ticks, written and read again.

`app.fly(tree, record="flight.mcap")` does all of the writing.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from pydantic import TypeAdapter, ValidationError
from pydantic_core import to_jsonable_python

import uav_bt
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.scene_file import scene_text
from uav_bt.app import provenance
from uav_bt.app.assembly import Flight
from uav_bt.app.site import Site
from uav_bt.errors import FileError
from uav_bt.files import parse_json, reading, writing
from uav_bt.lab.lab import Lab
from uav_bt.mission.flight_report import FlightReport
from uav_bt.mission.judge import JudgeConfig
from uav_bt.mission.limits import Limits
from uav_bt.mission.runner import RunnerConfig
from uav_bt.protocols import Drone
from uav_bt.record import Quality
from uav_bt.record.reader import RecordReader
from uav_bt.record.record_file import Attachment, RecordFile
from uav_bt.record.recorder import FlightRecorder
from uav_bt.tree.loading.parameters import Plain
from uav_bt.types import Airframe
from uav_bt.types.area import Polygon

_TREE_FOLDER: Final = "tree/"
SCENE_FILE: Final = "scene.yaml"


def begin_record(path: Path, flight: Flight[Drone]) -> FlightRecorder:
    """Open the record of a flight whose tree is set up."""
    file, referee = RecordFile(path), flight.drone.referee
    try:
        with writing(path):
            return FlightRecorder(
                file,
                flight.mission,
                flight.context,
                flight.drone.camera,
                _flight_facts(flight),
                attachments=[*_attachments(flight)],
                ground=None if referee is None else referee.ground(),
                start_ns=time.time_ns(),
                quality=flight.options.record_quality,
                # The clock of a simulation waits for the disk.
                wait=not (flight.drone.live or flight.options.realtime),
            )
    except FileError:
        file.abandon()
        path.unlink(missing_ok=True)
        raise


def end_record(report: FlightReport, *, recorder: FlightRecorder, path: Path) -> None:
    """Close a record with how the flight ended; FileError if it is incomplete."""
    end = {"outcome": report.outcome, "reason": report.reason}
    failure = recorder.finish({**end, "report": json.dumps(report.to_json())})
    if failure is not None:
        raise FileError(path, failure)


def _flight_facts(flight: Flight[Drone]) -> dict[str, str]:
    """Return the facts of a connected flight that are known before it begins."""
    mission, drone, options, held = flight.mission, flight.drone, flight.options, flight.held
    site = options.place
    if site is not None and site.lab is not None:  # the scene may have another mark than its lab
        site = replace(site, mark=held.mark, mark_pose=held.mark_pose, take_off_pose=held.take_off)
    first = mission.variables.snapshot().items()  # that have a value before the first tick
    values = {
        **{each.name: getattr(options, each.name) for each in fields(options)},
        "judge": held.judge,
        "limits": held.limits,
        "area": None if held.area is None else held.area.polygons,
        "uav_bt": uav_bt.__version__,
        "started": datetime.now(tz=UTC).isoformat(timespec="seconds"),
        "tree": mission.origin,
        "tree_name": mission.name,
        "scene": flight.scene_name,
        "lab": None if held.lab is None else held.lab.name,
        "site": site,
        "replaced": mission.replaced,
        "ports": options.parameters.ports,
        "variables": {name: value for name, value in first if isinstance(value, Plain)},
        "policies": options.policy_names,
        "drone": options.drone_name,
        "drone_config": repr(options.drone) if is_dataclass(options.drone) else None,
        "classes": [*held.classes],
        "airframe": drone.airframe,
        "simulated": drone.referee is not None,
        "imageless": flight.context.sight is not None,
        "outputs": flight.outputs is not None,
        "versions": provenance.package_versions(),
        "platform": provenance.hardware(),
        "git": provenance.commit(),
        "weights": provenance.weights_of(mission),
    }
    del values["record"], values["params"]
    return {
        name: value if isinstance(value, str) else json.dumps(value, default=to_jsonable_python)
        for name, value in values.items()
    }


def _attachments(flight: Flight[Drone]) -> Iterator[Attachment]:
    """Yield the files of a flight: one with all trees and places, scene and lab."""
    mission, scene, lab = flight.mission, flight.drone.scene, flight.options.lab
    xml, yaml = "application/xml", "application/yaml"
    if mission.sources:
        name = f"{_TREE_FOLDER}{mission.path.name}"
        yield Attachment(name=name, media_type=xml, data=mission.whole())
    if isinstance(scene, Scene):
        text = scene_text(scene)
        yield Attachment(name=SCENE_FILE, media_type=yaml, data=text.encode())
    if isinstance(lab, Lab):
        with reading(lab.file):
            yield Attachment(name="lab.yaml", media_type=yaml, data=lab.file.read_bytes())


def recorded_tree(reader: RecordReader) -> str | None:
    """Return the text of a record's tree with all that it includes; None without one."""
    file = reader.attachments.get(f"{_TREE_FOLDER}{reader.metadata.get('tree', '')}")
    return None if file is None else file.data.decode("utf-8-sig", errors="replace")


@dataclass(frozen=True, kw_only=True)
class RecordedOptions:
    """Options in a record, for replays and views."""

    scene: str | None
    drone: str
    seed: int
    inference_threads: int
    exact_masks: bool
    imageless: bool  # whether the frames show nothing
    outputs: bool  # whether leaves could write files
    record_quality: Quality
    site: Site | None
    limits: Limits
    runner: RunnerConfig
    judge: JudgeConfig  # with the mission's rules
    area: tuple[Polygon, ...] | None  # relative to the take-off pose
    airframe: Airframe
    # Attributes that nodes had instead of those of the tree file, policies among them.
    replaced: dict[str, dict[str, str]]
    variables: dict[str, Plain]  # before the first tick


def recorded_options(reader: RecordReader) -> RecordedOptions:
    """Return the options that a recorded flight was flown with."""
    values: dict[str, Any] = {}
    with reader.intact("the metadata"):
        for each in fields(RecordedOptions):
            text = reader.metadata.get(each.name)
            if text is not None:
                # Texts stand there as they are, everything else as JSON.
                plain = each.type in {"str", "str | None", "Quality"} and text != "null"
                values[each.name] = text if plain else parse_json(text)
    try:
        return TypeAdapter(RecordedOptions).validate_python(values)
    except ValidationError as error:
        first = error.errors()[0]
        why = f"{'.'.join(map(str, first['loc']))}: {first['msg']}"
        raise FileError(reader.path, f"the record's metadata is damaged: {why}") from error
