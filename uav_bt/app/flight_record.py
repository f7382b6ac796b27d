"""Facts in a flight's record beside its ticks, written and read again.

`app.fly(tree, record="flight.mcap")` does all of the writing.
"""

from __future__ import annotations

import json
import platform
import time
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from pydantic import TypeAdapter, ValidationError

import uav_bt
from uav_bt.app import provenance
from uav_bt.app.assembly import Flight
from uav_bt.app.recorded_files import attachments_of
from uav_bt.app.site import Site
from uav_bt.errors import FileError, InputError
from uav_bt.files import parse_json, writing
from uav_bt.mission.flight_report import FlightReport
from uav_bt.mission.judge import JudgeConfig
from uav_bt.mission.limits import Limits
from uav_bt.mission.runner import RunnerConfig
from uav_bt.plugins import need
from uav_bt.protocols import Drone
from uav_bt.record import Quality
from uav_bt.record.reader import RecordReader
from uav_bt.record.record_file import RecordFile
from uav_bt.record.recorder import FlightFacts, FlightRecorder
from uav_bt.tree.loading.parameters import Plain
from uav_bt.types import Airframe
from uav_bt.types.area import Polygon


def flight_facts(flight: Flight[Drone]) -> FlightFacts:
    """Return the facts of a flight that are known before it begins; its drone is connected."""
    mission, drone, options, held = flight.mission, flight.drone, flight.options, flight.held
    site = options.place
    if site is not None and site.lab is not None:  # the scene may have another mark than its lab
        site = replace(site, mark=held.mark, mark_pose=held.mark_pose, take_off_pose=held.take_off)
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
        "variables": {  # that have a value before the first tick
            name: value
            for name, value in mission.variables.snapshot().items()
            if isinstance(value, Plain)
        },
        "policies": options.policy_names,
        "policy_objects": list(options.policy_objects),
        "drone": options.drone_name,
        "drone_config": repr(options.drone) if is_dataclass(options.drone) else None,
        "classes": [asdict(each) for each in held.classes],
        "airframe": drone.airframe,
        "simulated": drone.referee is not None,
        "imageless": flight.context.sight is not None,
        "outputs": flight.outputs is not None,
        "stills": flight.context.stills is not None,
        "versions": provenance.package_versions(),
        "platform": f"{platform.platform()}, Python {platform.python_version()}",
        "git": provenance.commit(),
        "weights": provenance.weights_of(mission),
    }
    del values["record"], values["params"]
    referee = flight.drone.referee
    return FlightFacts(
        values={
            name: value if isinstance(value, str) else json.dumps(value, default=_plain)
            for name, value in values.items()
        },
        attachments=[*attachments_of(mission, drone.scene, options.lab)],
        ground=None if referee is None else referee.ground(),
    )


def _plain(value: object) -> object:
    return str(value) if isinstance(value, Path) else asdict(value)  # type: ignore[call-overload]


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
    stills: bool  # whether the drone's camera took photographs
    record_quality: Quality
    site: Site | None
    limits: Limits
    runner: RunnerConfig
    judge: JudgeConfig  # with the mission's rules
    area: tuple[Polygon, ...] | None  # relative to the take-off pose
    airframe: Airframe
    policy_objects: tuple[str, ...]  # policies that only the recorded program had
    # Attributes that nodes had instead of those of the tree file, policies among them.
    replaced: dict[str, dict[str, str]]
    variables: dict[str, Plain]  # before the first tick


def recorded_options(reader: RecordReader) -> RecordedOptions:
    """Return the options that a recorded flight was flown with."""
    values: dict[str, Any] = {}
    try:
        for each in fields(RecordedOptions):
            text = reader.metadata.get(each.name)
            if text is not None:
                # Texts stand there as they are, everything else as JSON.
                plain = each.type in {"str", "str | None", "Quality"} and text != "null"
                values[each.name] = text if plain else parse_json(text)
        return TypeAdapter(RecordedOptions).validate_python(values)
    except InputError as error:
        why = f"expected JSON, got '{text:.80}'"
        raise FileError(reader.path, f"the record's metadata is damaged: {why}") from error
    except ValidationError as error:
        first = error.errors()[0]
        why = f"{'.'.join(map(str, first['loc']))}: {first['msg']}"
        raise FileError(reader.path, f"the record's metadata is damaged: {why}") from error


class FlightRecord:
    """The record of one flight: begun when the tree is set up, closed whatever happens."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._recorder: FlightRecorder | None = None

    def begin(self, flight: Flight[Drone]) -> tuple[FlightRecorder]:
        """Open the file for a flight whose tree is set up; return the tick listener."""
        options = flight.options
        # A simulation's clock stands still meanwhile: it waits for the disk, and nothing is lost.
        stands_still = not (flight.drone.live or options.realtime)
        file = RecordFile(self._path)
        try:
            with writing(self._path):
                self._recorder = FlightRecorder(
                    file,
                    flight.mission,
                    flight.context,
                    flight.drone.camera,
                    flight_facts(flight),
                    start_ns=time.time_ns(),
                    quality=options.record_quality,
                    wait=stands_still,
                )
        except FileError:
            file.abandon()
            raise
        return (self._recorder,)

    def conclude(self, report: FlightReport) -> None:
        """Close the file with how the flight ended; FileError if it is not written to its end."""
        recorder, self._recorder = self._recorder, None
        if recorder is None:
            return
        end = {"outcome": report.outcome, "reason": report.reason}
        failure = recorder.finish({**end, "report": json.dumps(report.to_json())})
        if failure is not None:
            raise FileError(self._path, failure)

    def __enter__(self) -> Self:
        """Return itself; raises MissingDependencyError without the extra `record`."""
        need("record", "a flight record")
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the file, with the fault if there was one."""
        if self._recorder is not None:
            fault = {"outcome": "error", "reason": f"{type(error).__name__}: {error}"}
            self._recorder.finish({} if error is None else fault)
