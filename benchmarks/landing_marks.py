"""Measure landing marks: errors of tags by distance and tilt, and errors of landings by kind.

    python -m benchmarks.landing_marks views --views 12
    python -m benchmarks.landing_marks flights --flights 4 --out runs/landing-marks
    python -m benchmarks.landing_marks flights --drone plain --flights 24 --out runs/marks-plain

`views` renders tags through the twin's camera, with its noise. `flights` takes off at random places
2 m and more from the mark, flies to it on exact masks and lands; tags are landed on with heading 0.
A flight is a line of DIR/flights.jsonl, and those that are there are not flown again.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks.mission_text import in_flight
from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.objects import Helipad
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene import Scene, TakeOffSpec
from sim_bridge.twin.scene_file import scene_text
from sim_bridge.twin.views import render_views
from uav_bt import app
from uav_bt.landing_marks import MarkSighting, MarkView
from uav_bt.mission.tick import TickRecord
from uav_bt.plugins import make_mark_finder
from uav_bt.types import Frame, LandingMark, Pose

SIDE_M: Final = 0.5  # of the mark's top
CENTRE_M: Final = (1.2, 0.3)  # of the mark in the scene's drawing
YAW_DEG: Final = 25.0
RANGES_M: Final = (0.7, 1.5, 2.0, 3.0, 4.0, 5.0)
DEPRESSIONS_DEG: Final = (90, 60, 45, 30, 20, 15)
FLIGHTS: Final = "flights.jsonl"
OPTIONS: Final[Mapping[str, tuple[str, dict[str, Any]]]] = {
    "helipad": ("helipad", {}),
    "region": ("region", {}),
    "apriltag": ("apriltag", {"id": 7, "size_m": 0.38}),
    "aruco": ("aruco", {"id": 7, "size_m": 0.36}),
    "board": (
        "apriltag",
        {
            "tags": [
                {"id": 2 * row + column, "size_m": 0.19, "at_m": [x_m, y_m]}
                for row, y_m in enumerate((0.12, -0.12))
                for column, x_m in enumerate((-0.12, 0.12))
            ]
        },
    ),
}
MARKS: Final = (
    *("helipad-0", "helipad-0.2", "helipad-0.4", "helipad-0.6"),
    *("apriltag-0", "apriltag-0.4", "aruco-0.2", "board-0", "region-0", "region-0.6"),
)


def mark_of(name: str) -> LandingMark:
    """Return the landing mark of a name such as `apriltag-0.4`: kind and height in metres."""
    kind, _, height = name.partition("-")
    registered, options = OPTIONS[kind]
    return LandingMark(
        kind=registered,
        length_m=SIDE_M,
        width_m=SIDE_M,
        height_m=float(height or 0.0),
        options=options,
    )


def pad_of(mark: LandingMark) -> Helipad:
    """Return the mark as it stands in the scenes of this benchmark."""
    return Helipad(
        position_m=CENTRE_M,
        yaw_deg=YAW_DEG,
        size_m=mark.size_m,
        kind=mark.kind,
        options=mark.options,
    )


# --- views ----------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Sightings:
    """Sightings of one distance and tilt.

    Attributes:
        views: Number of views.
        range_m: Signed errors of the distance along the line of sight.
        heading_deg: Signed errors of the heading.
    """

    views: int
    range_m: tuple[float, ...]
    heading_deg: tuple[float, ...]

    def row(self) -> str:
        """Return share found, mean and 95 % range error in cm, and mean heading error in deg."""
        if not self.range_m:
            return f"{0:4d} %" + 5 * "      -"
        range_cm, heading_deg = 100.0 * np.array(self.range_m), np.array(self.heading_deg)
        values = (
            range_cm.mean(),
            np.abs(range_cm).mean(),
            np.percentile(np.abs(range_cm), 95),
            np.abs(heading_deg).mean(),
            np.percentile(np.abs(heading_deg), 95),
        )
        share = round(100 * len(self.range_m) / self.views)
        return f"{share:4d} %" + "".join(f"{value:7.1f}" for value in values)


def sightings(mark: LandingMark, range_m: float, below_deg: float, views: int) -> Sightings:
    """Look at a mark from random directions, at one distance and depression of the line of sight.

    Args:
        mark: The landing mark.
        range_m: Distance of the lens from the mark's middle.
        below_deg: Depression of the line of sight, 90 from straight above.
        views: Number of views.
    """
    generator = np.random.default_rng([round(10 * range_m), round(below_deg)])
    pad, finder, poses, errors = pad_of(mark), make_mark_finder(mark), [], []
    level_m = range_m * math.cos(math.radians(below_deg))
    camera_m = mark.height_m + range_m * math.sin(math.radians(below_deg))
    for turn in generator.uniform(-math.pi, math.pi, views):
        aside = generator.normal(0.0, math.radians(3.0))  # the mark is not in the image's middle
        pitch_deg = max(-90.0, -below_deg + generator.normal(0.0, 2.0))
        x_m = CENTRE_M[0] - level_m * math.cos(turn)
        y_m = CENTRE_M[1] - level_m * math.sin(turn)
        yaw_rad, pitch_rad = turn + aside, math.radians(pitch_deg)
        poses.append(
            CameraPose(x_m=x_m, y_m=y_m, z_m=camera_m, yaw_rad=yaw_rad, pitch_rad=pitch_rad)
        )
    scene = Scene(name="mark", helipad=pad)
    rendered = render_views(scene, poses, profile=Profile(), vary_light=True)
    camera = anafi_camera(640, 360)
    for index, (pose, view) in enumerate(zip(poses, rendered, strict=True)):
        frame = Frame(
            image=view.image,
            index=index,
            captured_s=0.0,
            gimbal_pitch_rad=pose.pitch_rad,
            height_above_ground_m=camera_m,
        )
        seen = finder.find(MarkView(frame=frame, camera=camera))
        if seen is not None:
            errors.append(_errors(seen, pose, camera.forward_offset_m))
    return Sightings(
        views=views,
        range_m=tuple(error for error, _ in errors),
        heading_deg=tuple(error for _, error in errors),
    )


def _errors(seen: MarkSighting, pose: CameraPose, offset_m: float) -> tuple[float, float]:
    """Return the error of the place (signed as that of the distance) and of the heading."""
    east_m, north_m = CENTRE_M[0] - pose.x_m, CENTRE_M[1] - pose.y_m
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    forward_m, right_m = cos * east_m + sin * north_m, sin * east_m - cos * north_m
    found_m = (seen.forward_m - offset_m, seen.right_m)
    apart_m = math.dist(found_m, (forward_m, right_m))
    farther = math.hypot(*found_m) >= math.hypot(forward_m, right_m)
    heading_deg = YAW_DEG + 90.0 - math.degrees(pose.yaw_rad)
    turned_deg = math.remainder((seen.heading_deg or 0.0) - heading_deg, 360.0)
    return apart_m if farther else -apart_m, turned_deg


def print_views(names: list[str], views: int) -> None:
    """Print a table for each mark."""
    for name in names:
        print(f"{name}: found, error of the place in cm (bias, mean, 95 %), of the heading in deg")
        for below_deg in DEPRESSIONS_DEG:
            for range_m in RANGES_M:
                found = sightings(mark_of(name), range_m, below_deg, views)
                print(f"  {below_deg:3d} deg {range_m:4.1f} m {found.row()}", flush=True)


# --- flights --------------------------------------------------------------------------------------


class LastPose:
    """Keeps the true pose of the last tick."""

    def __init__(self) -> None:
        self.pose: Pose | None = None

    def on_tick(self, record: TickRecord) -> None:
        """Take note of a tick."""
        if record.truth is not None:
            self.pose = record.truth.pose


def mission_text(mark: LandingMark) -> str:
    """Return the text of a tree that flies to the mark and lands, on a tag with heading 0."""
    heading = ' heading_deg="0"' if make_mark_finder(mark).shows_heading else ""
    attempt = f"<Sequence><ReturnToBase/><HelipadCenter{heading}/></Sequence>"
    work = f'<RetryUntilSuccessful num_attempts="5">{attempt}</RetryUntilSuccessful><Land/>'
    return in_flight(work, gimbal_deg=-30)


def scene_of(mark: LandingMark, seed: int) -> Scene:
    """Return a scene with the mark and a take-off place 2 m and more from it."""
    generator, scene = np.random.default_rng(seed), Scene(name="mark", helipad=pad_of(mark))
    while True:
        x_m, y_m = (float(v) for v in generator.uniform((-2.2, -1.7), (2.2, 1.7)))
        if math.dist((x_m, y_m), CENTRE_M) >= 2.0:
            break
    yaw_deg = float(generator.uniform(-180.0, 180.0))
    return replace(scene, take_off=TakeOffSpec(position_m=(x_m, y_m), yaw_deg=yaw_deg))


def fly(name: str, seed: int, given: argparse.Namespace) -> dict[str, Any]:
    """Fly to a mark, land, and return the flight's line."""
    mark, last = mark_of(name), LastPose()
    scene_file = given.out / f"{name}-{seed}.yaml"
    scene_file.write_text(scene_text(scene_of(mark, seed)))
    report = app.fly(
        mission_text(mark),
        scene=str(scene_file),
        seed=seed,
        drone=given.drone,
        exact_masks=True,
        listeners=[lambda _: [last]],
    )
    pose = last.pose
    yaw_deg = math.nan if pose is None else math.degrees(pose.yaw_rad)
    return {
        "mark": name,
        "seed": seed,
        "outcome": report.outcome,
        "reason": report.reason,
        "duration_s": report.duration_s,
        "error_m": report.landing_error_m,
        "heading_deg": math.remainder(YAW_DEG + 90.0 - yaw_deg, 360.0),
    }


def missing_flights(
    names: list[str], flights: int, flown: list[dict[str, Any]]
) -> Iterator[tuple[str, int]]:
    """Yield mark and seed of the flights that are not in the file yet."""
    done = {(each["mark"], each["seed"]) for each in flown}
    for name in names:
        yield from ((name, seed) for seed in range(flights) if (name, seed) not in done)


def print_flights(flown: list[dict[str, Any]]) -> None:
    """Print landing errors by mark."""
    print("mark          success  error cm: mean   95 %   largest   heading deg: mean")
    for name in dict.fromkeys(each["mark"] for each in flown):
        lines = [each for each in flown if each["mark"] == name]
        landed = [each for each in lines if each["outcome"] == "success"]
        errors_cm = 100.0 * np.array([each["error_m"] for each in landed])
        row = f"{name:14s}{len(landed):3d} of {len(lines)}"
        if landed:
            heading_deg = np.abs([each["heading_deg"] for each in landed]).mean()
            shown = f"{heading_deg:17.1f}" if name.startswith(("april", "aruco", "board")) else ""
            row += f"{errors_cm.mean():17.1f}{np.percentile(errors_cm, 95):7.1f}"
            row += f"{errors_cm.max():10.1f}{shown}"
        print(row)
    for each in flown:
        if each["outcome"] != "success":
            print(f"  {each['mark']} {each['seed']}: {each['outcome']}, {each['reason']}")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", choices=("views", "flights"))
    parser.add_argument("--marks", help="such as apriltag-0,helipad-0.4")
    parser.add_argument("--views", type=int, default=12, help="for each distance and tilt")
    parser.add_argument("--flights", type=int, default=4, help="for each mark")
    parser.add_argument("--drone", default="twin")
    parser.add_argument("--out", type=Path, default=Path("runs/landing-marks"))
    given = parser.parse_args()
    if given.what == "views":
        print_views((given.marks or "apriltag-0,aruco-0,board-0").split(","), given.views)
        return
    given.out.mkdir(parents=True, exist_ok=True)
    path = given.out / FLIGHTS
    flown = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    names = given.marks.split(",") if given.marks else list(MARKS)
    for name, seed in missing_flights(names, given.flights, flown):
        flown.append(fly(name, seed, given))
        with path.open("a") as file:
            file.write(json.dumps(flown[-1]) + "\n")
    print_flights(flown)


if __name__ == "__main__":
    main()
