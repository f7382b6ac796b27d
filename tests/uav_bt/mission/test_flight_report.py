"""The flight report: its quantities, null for those not reached, and the covered ground."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from sim_bridge.anafi import CAMERA_FORWARD_M, anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import render_views
from tests.paper_lab import CARPET
from tests.worlds import values
from tests.worlds.tables import cases
from uav_bt.mission.covered_ground import CoveredGround, GroundCells
from uav_bt.mission.flight_log import FlightLog
from uav_bt.mission.flight_report import FlightReport, Percentiles, write_report
from uav_bt.mission.safety import Override
from uav_bt.tree import Status
from uav_bt.types import BodyVelocity, DroneState, FlyingState, Pose, TakeOff, Truth, projection
from uav_bt.types.arrays import Flags
from uav_bt.types.ground import Footprint, Ground, Standing

CASES = cases("mission")["report"]


class Tale:
    """Writes a flight into a log, tick by tick; a tick is 0.5 s. It climbs all the time."""

    tick_s = 0.5

    def __init__(self, *, referee: bool = True, coverage: CoveredGround | None = None) -> None:
        self.log = FlightLog(coverage)
        self.referee = referee
        self.now_s = 2.0
        self.x_m = self.y_m = 0.0
        self._index = 0

    def tick(
        self,
        phase: str = "",
        *,
        dx_m: float = 0.0,
        dy_m: float = 0.0,
        motors_on: bool = True,
        clearance_m: float = math.inf,
        error_m: float | None = 3.0,
        on_mark: bool = False,
        **more: Any,
    ) -> None:
        """Log a tick, displaced from the last one by (`dx_m`, `dy_m`)."""
        self.x_m += dx_m
        self.y_m += dy_m
        state = DroneState(
            captured_s=self.now_s,
            flying=FlyingState.FLYING if motors_on else FlyingState.LANDED,
            velocity=BodyVelocity(
                forward_mps=dx_m / self.tick_s, right_mps=dy_m / self.tick_s, down_mps=9.0
            ),
        )
        truth = values.truth(
            Pose(x_m=self.x_m, y_m=self.y_m, z_m=float(self._index), yaw_rad=0.0),
            self.now_s,
            clearance_m=clearance_m,
            on_mark=on_mark,
            landing_error_m=error_m,
            motors_on=motors_on,
            gimbal_pitch_rad=-0.5,
        )
        movement = more.pop("movement", None)
        given = {"phase": phase, "truth": truth if self.referee else None, **more}
        self.log.on_tick(values.tick(state, movement, **given))
        self._index += 1
        self.now_s += self.tick_s

    def take_off(self) -> None:
        """Log a second on the ground and the take-off command."""
        for _ in range(2):
            self.tick(motors_on=False)
        self.tick("take-off", movement=TakeOff(), motors_on=False)

    def report(self, **more: Any) -> FlightReport:
        return values.report(self.log, **more)


def told(*ticks: Sequence[Any], referee: bool = True) -> FlightReport:
    """Return the report of a take-off at 3 s and of ticks: how many, their phase and more."""
    tale = Tale(referee=referee)
    tale.take_off()
    for count, phase, *more in ticks:
        for _ in range(count):
            tale.tick(phase, **dict(*more))
    return tale.report()


@pytest.mark.parametrize(("ticks", "expected"), CASES)
def test_a_flight_is_measured_from_mark_to_mark(ticks: list[Any], expected: dict[str, Any]) -> None:
    report = told(*ticks).to_json()
    assert {name: report[name] for name in expected} == {
        name: value if value is None else pytest.approx(value) for name, value in expected.items()
    }


def test_without_a_referee_the_distance_comes_from_the_speed() -> None:
    """The landing comes from the telemetry; quantities that need the truth are None."""
    report = told(*CASES[0][0], referee=False)
    assert (report.total_distance_m, report.search_distance_m) == pytest.approx((4.1, 1.1))
    assert report.time_to_land_s == 2.0
    assert (report.landing_error_m, report.min_clearance_m, report.coverage_passed) == (None,) * 3
    assert told((1, "approach"), (1, "land"), referee=False).time_to_land_s is None
    assert told((1, "explore"), referee=False).total_distance_m == 0.0


def test_without_a_take_off_there_is_nothing_to_measure() -> None:
    """Carrying the drone to its start adds no distance."""
    tale = Tale()
    assert (tale.report().ticks, tale.report().tick_ms) == (0, None)
    for _ in range(3):
        tale.tick("explore", dx_m=1.0, motors_on=False, clearance_m=0.1)
    report = tale.report().to_json()
    assert report["ticks"] == 3
    for name in ("duration_s", "explore_distance_m", "total_distance_m", "min_clearance_m"):
        assert report[name] is None, name
    assert report["landing_error_m"] is None
    tale.take_off()
    tale.tick("explore", dx_m=0.5)
    assert tale.report().total_distance_m == pytest.approx(0.5)


def test_the_median_tick_time_counts_ticks_of_the_tree_only() -> None:
    report = told(
        (5, "explore", {"compute_s": 0.020}),
        (20, "explore", {"compute_s": 0.0, "override": Override.MANUAL}),
        (50, "explore", {"compute_s": 0.0, "tree_status": Status.IDLE, "override": Override.ABORT}),
    )
    assert report.ticks == 3 + 5 + 20 + 50
    # Three ticks with 1 ms and five with 20 ms.
    assert report.tick_ms is not None
    assert (report.tick_ms.p50, report.tick_ms.max) == (20.0, 20.0)
    summary = Percentiles.of_seconds([0.001 * value for value in range(101)])
    assert summary == Percentiles(p50=50.0, p99=99.0, max=100.0)


def test_each_warning_is_reported_once() -> None:
    said = ((), ("it drifts",), ("it drifts",), (), ("it drifts", "it drifts more"))
    report = told(*((1, "explore", {"warnings": each}) for each in said))
    assert report.warnings == ["it drifts", "it drifts more"]
    assert "warnings: ['it drifts'," in str(report)
    assert "warnings" not in str(told())


def test_coverage_counts_from_the_take_off_command_and_at_90_s() -> None:
    tale = Tale(coverage=CoveredGround(Ground(size_m=(5.0, 4.0)), anafi_camera(640, 360)))
    tale.x_m = -2.0
    for _ in range(40):
        tale.tick(dy_m=0.05, motors_on=False)  # carried before the command
    tale.y_m = 0.0
    tale.take_off()
    disc = math.pi * 0.25 / 20.0
    for _ in range(179):  # in one place
        tale.tick("explore")
    early = tale.report()  # after 89.5 s
    assert (early.coverage_passed_90s, early.coverage_seen_90s) == (None, None)
    assert early.coverage_passed == pytest.approx(disc, rel=0.02)
    for _ in range(11):
        tale.tick("explore")
    for _ in range(20):
        tale.tick("explore", dx_m=0.1)  # 2 m on, 105 s
    report = tale.report()
    assert report.coverage_passed_90s == pytest.approx(disc, rel=0.02)
    assert report.coverage_passed == pytest.approx(disc + 2.0 / 20.0, rel=0.02)
    assert report.coverage_seen_90s is not None
    assert [point[0] for point in report.coverage_curve] == [10.0 * n for n in range(1, 11)]
    assert report.coverage_curve[8][1] == report.coverage_passed_90s
    assert "coverage_curve" not in str(report), "a curve is for programs"


# --- texts and the file ---------------------------------------------------------------------------


def test_the_file_is_one_json_object_with_every_field_and_null_for_none(tmp_path: Path) -> None:
    """It replaces the old one and leaves nothing beside it."""
    path = tmp_path / "report.json"
    path.write_text("old", encoding="utf-8")
    write_report(told(), path)
    text = path.read_text(encoding="utf-8")
    report = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))
    assert report["time_to_land_s"] is None
    assert report["tick_ms"] == {"p50": 1.0, "p99": 1.0, "max": 1.0}
    assert text.endswith("}\n")
    assert [file.name for file in tmp_path.iterdir()] == ["report.json"]


# --- covered and seen shares of the free ground, against areas and rendered images ----------------

CAMERA = anafi_camera(640, 360)
BARE = Ground(size_m=(5.0, 4.0))
TURNED = Footprint(x_m=1.0, y_m=0.5, half_x_m=0.5, half_y_m=0.25, yaw_rad=math.pi / 2)


def truth(x_m: float, y_m: float, yaw_rad: float = 0.0, pitch_rad: float | None = -0.5) -> Truth:
    return values.truth(
        Pose(x_m=x_m, y_m=y_m, z_m=1.5, yaw_rad=yaw_rad),
        clearance_m=math.inf,
        gimbal_pitch_rad=pitch_rad,
    )


def test_ground_under_what_stands_on_it_is_not_free() -> None:
    cells = GroundCells(
        Ground(size_m=(5.0, 4.0), standing=(Standing(footprint=TURNED, height_m=1),))
    )
    assert cells.free.shape == (80, 100)
    rows, columns = np.nonzero(~cells.free)
    assert cells.x_m[columns].min() == pytest.approx(0.775)
    assert cells.x_m[columns].max() == pytest.approx(1.225)
    assert cells.y_m[rows].min() == pytest.approx(0.025)
    assert cells.y_m[rows].max() == pytest.approx(0.975)
    assert cells.share(~cells.free) == 0.0
    assert cells.share(cells.free) == 1.0


def test_hovering_passes_a_disc_and_a_straight_way_a_band() -> None:
    hovering = CoveredGround(BARE, CAMERA)
    hovering.add(0.0, truth(0.0, 0.0))
    assert hovering.shares()[0] == pytest.approx(math.pi * 0.25 / 20.0, rel=0.02)
    along = CoveredGround(BARE, CAMERA)
    for step in range(51):
        along.add(step / 10, truth(-2.5 + step / 10, 0.0))
    assert along.shares()[0] == pytest.approx(0.25, abs=0.002)


def _seen_by_rendering(pose: CameraPose, ids: NDArray[np.uint8]) -> tuple[Flags, Flags]:
    """Return the mask of cells that an image shows as ground, and of cells away from edges."""
    height_px, width_px = ids.shape
    cells = GroundCells(load_scene("val-a").ground_plan)
    x, y = np.meshgrid(cells.x_m, cells.y_m)
    dx, dy = x - pose.x_m, y - pose.y_m
    c, s = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    level = np.stack([c * dx + s * dy, s * dx - c * dy, np.full_like(x, pose.z_m)], axis=-1)
    pixels = projection.project(level, anafi_camera(width_px, height_px), pose.pitch_rad)
    far = np.sqrt(dx**2 + dy**2 + pose.z_m**2) > 3.0
    shows = np.zeros(x.shape, np.bool_)
    sure = np.ones(x.shape, np.bool_)
    for place in np.ndindex(x.shape):
        column, row = pixels[place]
        inside = -0.5 <= column <= width_px - 0.5 and -0.5 <= row <= height_px - 0.5
        if not inside or far[place]:
            continue
        near = ids[
            max(0, round(row) - 2) : round(row) + 3, max(0, round(column) - 2) : round(column) + 3
        ]
        shows[place] = ids[round(row), round(column)] == CARPET
        sure[place] = bool((near == near[0, 0]).all())
    return shows & cells.free, sure & cells.free


@pytest.mark.parametrize(
    ("x_m", "y_m", "yaw_deg", "pitch_deg"),
    [(-1.2, -0.9, 40, -30), (1.4, 0.2, 150, -25), (0.4, -0.3, -100, -60), (0.9, 1.0, 200, -89)],
)
def test_the_seen_ground_is_what_an_image_shows_of_the_ground(
    x_m: float, y_m: float, yaw_deg: float, pitch_deg: float
) -> None:
    """The twin's exact masks are independent of the tested geometry."""
    scene = load_scene("val-a")
    body = truth(x_m, y_m, math.radians(yaw_deg), math.radians(pitch_deg))
    lens_x, lens_y = body.pose.to_world(CAMERA_FORWARD_M, 0.0)
    pose = CameraPose(
        x_m=lens_x,
        y_m=lens_y,
        z_m=1.5,
        yaw_rad=body.pose.yaw_rad,
        pitch_rad=math.radians(pitch_deg),
    )
    (view,) = render_views(scene, [pose])
    shows, sure = _seen_by_rendering(pose, view.ids)
    coverage = CoveredGround(scene.ground_plan, CAMERA)
    coverage.add(0.0, body)
    assert shows.sum() > 100
    disagree = (coverage.seen != shows) & sure
    assert (coverage.seen & sure).sum() > 100
    assert disagree.sum() == 0


def test_looks_are_taken_five_times_a_second() -> None:
    coverage = CoveredGround(BARE, CAMERA)
    coverage.add(0.0, truth(-2.0, 0.0))
    first = coverage.shares()[1]
    coverage.add(0.1, truth(-2.0, 0.0, math.pi / 4))
    assert coverage.shares()[1] == first
    coverage.add(0.2, truth(-2.0, 0.0, math.pi / 4))
    assert coverage.shares()[1] > first
