"""A mission flown: from a tree file to its report."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, closing, nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Final

from uav_bt.app import flight_outputs
from uav_bt.app.assembly import Flight, Listeners, frame_judge, join
from uav_bt.app.drone_of_flight import drawn
from uav_bt.app.film import end_film, facts_of_flight
from uav_bt.app.flight_outputs import FlownMission, PathLog, fetch_photos
from uav_bt.app.flying_process import landing_on_signals, short_collections
from uav_bt.app.loading import Mission, load_mission
from uav_bt.app.option_values import as_file, expect, refuse
from uav_bt.app.options import FlightOptions, given_options
from uav_bt.app.place import check_area
from uav_bt.app.reload import TreeReload, reloadable_file
from uav_bt.app.site import Site
from uav_bt.board import SITE_MAP
from uav_bt.display.video.video import FlightVideo, open_film
from uav_bt.errors import TreeError, UavBtError
from uav_bt.lab.lab import Lab
from uav_bt.mission.covered_ground import CoveredGround
from uav_bt.mission.flight_log import FlightLog
from uav_bt.mission.flight_report import FlightChanges, FlightReport, Percentiles, write_report
from uav_bt.mission.judge import Outcome, Verdict
from uav_bt.mission.map_check import MapCheck
from uav_bt.mission.preflight import Check, check_drone, refuse_faults
from uav_bt.mission.runner import MissionRunner, NextTree
from uav_bt.mission.tick import TickListener
from uav_bt.plugins import need
from uav_bt.protocols import Drone
from uav_bt.tree import MissionTree, NodeRegistry
from uav_bt.tree.loading.before_flight import findings_at, refused_by_lab
from uav_bt.tree.loading.uses import Uses

STILL_IN_THE_AIR: Final = (
    "THE DRONE IS STILL IN THE AIR, as far as is known: take its remote control and land it"
)
Controls = Callable[[MissionRunner], AbstractContextManager[None]]


def check(tree: Mission, registry: NodeRegistry | None = None, **how: Any) -> MissionTree:
    """Load a mission, refuse it where `fly` would, and return its tree. No drone is made.

        app.check("patrol.xml", variables={"laps": 3}, ports={"TakeOff.height_m": 1.2})

    Args:
        tree: a shipped mission's name, a tree file, or a tree file's text; a `MissionTree` is
            returned as it is.
        registry: the nodes that may occur; default: all installed.
        how: Fields of `FlightOptions`; the tree gets the values that they replace in it.

    Raises:
        TreeError: the file was refused; the error holds all findings.
        InputError: `tree` is not a mission, flew before, or does not fit its site or lab.
    """
    options = given_options(None, how)
    mission = load_mission(tree, options, registry)
    check_area(mission, options.place or Site())
    if isinstance(lab := options.lab, Lab):
        uses = Uses(mission)
        if found := list(findings_at(uses, refused_by_lab(uses, lambda: lab))):
            raise TreeError(mission.path, found)
    return mission


def fly(
    tree: Mission,
    options: FlightOptions | None = None,
    *,
    registry: NodeRegistry | None = None,
    out: str | Path | None = None,
    report: str | Path | None = None,
    video: str | Path | None = None,
    listeners: Sequence[Listeners] = (),
    on_check: Callable[[Check], None] = lambda _: None,
    controls: Controls = lambda _: nullcontext(),
    watch: Callable[[str], None] | None = None,
    **how: Any,
) -> FlownMission:
    """Fly a mission and return its report, with the flown path and the map as arrays.

        flown = app.fly("land_only", scene="val-a", seed=3)
        print(flown.outcome, flown.path[-1], flown.site_map)

    Before a real drone takes off it is checked: battery, link, telemetry, video.

    Args:
        tree: a shipped mission's name, a tree file, a tree file's text, or a tree that was built
            in Python: a `MissionTree`, or its root, a node or a behaviour of py_trees. It flies
            once, is not taken by `watch`, and a replay is given it again.
        options: Options that several flights share.
        registry: the nodes that may occur; default: all installed. Own leaves fly without a
            package with `NodeRegistry.installed().with_nodes(Peek)`.
        out: output folder of the flight, new or empty: report, objects of the map, and the files
            that leaves such as `TakePhoto` write.
        report: where to write the report as JSON, also of a mission that fails. Default:
            `report.json` in `out`.
        video: where to write a film of the flight, an mp4 file.
        listeners: Functions that make tick listeners of the flight (displays, logs).
        on_check: called with each line of the check before take-off.
        controls: Controls of a person while the mission flies, such as a keyboard.
        watch: Read the tree file again whenever it is edited while it flies, and call this with
            the result. For simulated drones, and without out, record, report and video;
            listeners that hold the tree itself go on showing the first one.
        how: Fields of `FlightOptions`. They replace those of `options`.

    Raises:
        InputError: tree, scene, weights, policy or drone cannot be used; nothing was flown.
        DroneError: the drone cannot be reached, or is not ready to take off.
        NodeFailedError: a leaf raised; the drone was landed and the report written, as it is when
            the drone raises. A listener or a file that fails ends no flight: the report's
            `lost_outputs` name it.
    """
    if not isinstance(listeners, Sequence) or not all(map(callable, listeners)):
        refuse("listeners", "a list of functions, such as [lambda flight: [notes]]", listeners)
    options = drawn(given_options(options, how))
    mission = load_mission(tree, options, registry)
    out = as_file("out", out, "a folder")
    report = as_file("report", report) or (out and out / flight_outputs.REPORT_FILE)
    video, record = as_file("video", video), as_file("record", options.record)
    outputs = {"report": report, "record": record, "video": video}
    folder = flight_outputs.flight_folder(out, outputs)
    flight_outputs.check_outputs(mission, options, outputs, folder)
    flight = join(mission, options, folder)
    next_tree = None
    if watch is not None:
        watched = reloadable_file(tree, flight.drone, outputs)
        next_tree = TreeReload(flight, watched, registry, watch)
    if record is not None:
        need("record", "a flight record")
    with ExitStack() as stack:
        stack.enter_context(flight.connected())
        if flight.drone.live:
            stack.enter_context(short_collections())
            _check_before_take_off(flight, on_check)
        followers: list[Listeners] = []
        keep: dict[str, Callable[[FlightReport], None]] = {}  # the report last: it names losses
        if folder is not None and flight.context.stills is not None:
            camera = flight.context.stills  # first, while the drone waits on the ground
            keep["camera photographs"] = partial(fetch_photos, camera=camera, folder=folder)
        if video is not None:
            file = stack.enter_context(closing(open_film(video)))
            film = FlightVideo(file, flight.context.board, facts_of_flight(flight))
            followers.append(lambda _: [film])
            keep["video"] = partial(end_film, film=film, file=file, mark=flight.held.mark)
        if record is not None:
            from uav_bt.app import flight_record  # noqa: PLC0415  (an extra)

            recorder = stack.enter_context(flight_record.begin_record(record, flight))
            followers.append(lambda _: [recorder])
            keep["record"] = partial(flight_record.end_record, recorder=recorder, path=record)
        if folder is not None:
            keep["objects"] = partial(flight_outputs.write_objects, folder=folder)
        if report is not None:
            keep["report"] = partial(write_report, path=report, new_folders=folder is not None)
        return _run(flight, [*followers, *listeners], keep, controls, next_tree)


def changes_of(options: FlightOptions) -> FlightChanges:
    """Return the changes to tree and scene for a flight, and its faults."""
    given = options.parameters
    return FlightChanges(
        ports=dict(given.ports),
        variables=dict(given.variables),
        movers=options.movers,
        vary_room=options.vary_room,
        faults=list(options.faults),
    )


def _check_before_take_off(flight: Flight[Drone], on_check: Callable[[Check], None]) -> None:
    drone = flight.drone
    checks = check_drone(drone, flight.held.site.preflight, judge_frame=frame_judge(drone))
    for each in checks:
        on_check(each)
    if not flight.options.rehearse:  # nothing takes off: faults are only shown
        refuse_faults(checks)


def _run(
    flight: Flight[Drone],
    listeners: Sequence[Listeners],
    keep: Mapping[str, Callable[[FlightReport], None]],
    controls: Controls,
    next_tree: NextTree | None,
) -> FlownMission:
    """Fly a connected flight to its end, and report whatever happened."""
    drone, board = flight.drone, flight.context.board
    ground = None if drone.referee is None else drone.referee.ground()
    coverage = None if ground is None else CoveredGround(ground, drone.camera)
    accuracy = None if ground is None else MapCheck(ground, lambda: board.read(SITE_MAP).value)
    log, path = FlightLog(coverage, accuracy), PathLog()
    followers: list[TickListener] = [log, path]
    for make in listeners:
        made = make(flight)
        expect("listeners", made, Sequence, "functions that return a list, as lambda _: [notes]")
        followers += made
    runner = flight.runner(followers, next_tree)

    def finish(verdict: Verdict) -> FlownMission:
        result = _result(flight, runner, log, path, verdict)
        for what, write in keep.items():
            try:
                write(result)
            except Exception as fault:  # noqa: BLE001  # no output may lose the report
                lost = {**result.lost_outputs, what: _words(fault)}
                result = replace(result, lost_outputs=lost)
        return result

    try:
        with landing_on_signals(runner), controls(runner):
            verdict = runner.run()
    except Exception as error:
        flown = finish(Verdict(outcome=Outcome.ERROR, reason=_words(error)))
        if flown.airborne_at_end:
            error.add_note(STILL_IN_THE_AIR)
        raise
    return finish(verdict)


def _result(
    flight: Flight[Drone], runner: MissionRunner, log: FlightLog, path: PathLog, verdict: Verdict
) -> FlownMission:
    options, context, referee = flight.options, flight.context, flight.drone.referee
    simulation = options if isinstance(options.drone, str) else options.drone
    profile = None if referee is None else getattr(simulation, "profile", None)
    leaves, stages = flight.mission.leaves(), context.stage_times_s.items()
    choosing = [leaf for leaf in leaves if any(port.name == "policy" for port in leaf.ports)]
    site_map, _ = context.board.snapshot().get(SITE_MAP.name, (None, None))  # of any age
    return FlownMission(
        **vars(changes_of(options)),
        **log.fields(),
        scene=flight.scene_name,
        lab=None if flight.held.lab is None else flight.held.lab.name,
        seed=options.seed,
        tree=flight.mission.origin,
        policies={leaf.path: str(leaf.port_value("policy")) for leaf in choosing},
        drone=options.drone_name,
        profile=profile if isinstance(profile, str) else None,
        perception_ms={name: Percentiles.of_seconds(times) for name, times in stages},
        photos=list(context.notes.photos),
        events=list(context.notes.events),
        outcome=verdict.outcome.value,
        reason=verdict.reason,
        slow_leaves={leaf: round(1e3 * s, 1) for leaf, s in runner.budgets.worst_s.items()},
        warnings=[*log.warnings, *flight.missed_faults()],
        # The runner knows only its own descents.
        airborne_at_end=runner.descent.airborne
        or (referee is not None and referee.truth().motors_on),
        lost_outputs=dict(runner.listeners.lost),
        objects=flight_outputs.objects_of(site_map),
        path=path.array(),
        site_map=site_map,
    )


def _words(error: Exception) -> str:
    return str(error) if isinstance(error, UavBtError) else f"{type(error).__name__}: {error}"
