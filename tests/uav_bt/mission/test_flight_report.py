"""The flight report: start and end of its quantities, and null for those not reached."""

from __future__ import annotations

import html
import json
import math
import re
from pathlib import Path

import pytest

from sim_bridge.anafi import anafi_camera
from tests.worlds import values
from uav_bt.errors import FileError
from uav_bt.mission.covered_ground import CoveredGround
from uav_bt.mission.flight_log import FlightLog
from uav_bt.mission.flight_report import FlightReport, Percentiles, write_report
from uav_bt.mission.judge import Outcome, Verdict
from uav_bt.mission.safety import Override
from uav_bt.mission.tick import TickRecord
from uav_bt.tree import Status
from uav_bt.types import (
    BodyVelocity,
    Command,
    DroneState,
    FlyingState,
    Hover,
    Movement,
    Observation,
    Pose,
    TakeOff,
)
from uav_bt.types.ground import Ground

LANDED = Verdict(outcome=Outcome.SUCCESS, reason="landed")


class Tale:
    """Writes a flight into a log, tick by tick; a tick is 0.5 s."""

    tick_s = 0.5

    def __init__(
        self, start_s: float = 2.0, *, referee: bool = True, coverage: CoveredGround | None = None
    ) -> None:
        self.log = FlightLog(coverage)
        self.referee = referee
        self.now_s = start_s
        self.x_m = 0.0
        self.y_m = 0.0
        self._index = 0

    def tick(
        self,
        phase: str = "",
        *,
        movement: Movement | None = None,
        dx_m: float = 0.0,
        dy_m: float = 0.0,
        motors_on: bool = True,
        clearance_m: float = math.inf,
        error_m: float | None = 3.0,
        on_mark: bool = False,
        compute_s: float = 0.001,
        status: Status = Status.RUNNING,
        override: Override | None = None,
        warnings: tuple[str, ...] = (),
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
        self.log.on_tick(
            TickRecord(
                index=self._index,
                time_s=self.now_s,
                observation=Observation(frame=None, state=state),
                tree_status=status,
                phase=phase,
                active=(),
                command=Command(movement=movement or Hover()),
                proposed_by=None,
                override=override,
                compute_s=compute_s,
                warnings=warnings,
                truth=truth if self.referee else None,
            )
        )
        self._index += 1
        self.now_s += self.tick_s

    def take_off(self) -> None:
        """Log a second on the ground and the take-off command."""
        for _ in range(2):
            self.tick(motors_on=False)
        self.tick("take-off", movement=TakeOff(), motors_on=False)

    def report(self, verdict: Verdict = LANDED) -> FlightReport:
        """Return the report."""
        stages: dict[str, list[float]] = {"segmentation": [0.002], "mark": []}
        return values.report(
            self.log,
            policies={"Mission/Explore": "segmentation"},
            outcome=verdict.outcome.value,
            reason=verdict.reason,
            perception_ms={name: Percentiles.of_seconds(each) for name, each in stages.items()},
        )


def whole_flight(*, referee: bool = True) -> Tale:
    """Return a flight through all phases; each tick of a phase has the same displacement."""
    tale = Tale(referee=referee)
    tale.take_off()  # command at 3 s
    for _ in range(6):
        tale.tick("explore", dx_m=0.3, clearance_m=0.8)  # 3.5 to 6 s, 1.8 m
    for _ in range(4):
        tale.tick("search", dy_m=0.2, clearance_m=0.6)  # 6.5 to 8 s, 0.8 m
    for _ in range(3):
        tale.tick("approach", dx_m=-0.3, dy_m=-0.4)  # 8.5 to 9.5 s, 1.5 m
    tale.tick("land")  # 10 s
    tale.tick("land", motors_on=False, error_m=0.0678912)  # 10.5 s
    tale.tick("land", motors_on=False, error_m=0.0678912)  # 11 s
    return tale


def test_a_flight_that_explores_up_to_the_mark_has_found_it_at_once() -> None:
    """Without a search and an approach the time to find the mark is 0."""
    tale = Tale()
    tale.take_off()
    for _ in range(6):
        tale.tick("explore", dx_m=0.3)
    tale.tick("center")  # 6.5 s
    tale.tick("land", motors_on=False)  # 7 s
    report = tale.report()
    assert report.time_to_find_mark_s == 0.0
    assert report.search_distance_m == 0.0
    assert report.time_to_land_s == 0.5


def test_a_flight_that_never_explored_searched_for_nothing() -> None:
    tale = Tale()
    tale.take_off()
    tale.tick("center")
    tale.tick("land", motors_on=False)
    report = tale.report()
    assert report.time_to_find_mark_s is None
    assert report.time_to_land_s is None


def test_a_whole_flight_is_measured_from_mark_to_mark() -> None:
    report = whole_flight().report()
    assert report.duration_s == 8.0  # 3 to 11 s: not from the start of the program
    assert report.total_distance_m == pytest.approx(4.1)
    assert report.explore_distance_m == pytest.approx(4.1)  # all within the first 90 s
    assert report.search_distance_m == pytest.approx(0.6 + 0.5)  # from 6.5 s to 8.5 s
    assert report.time_to_find_mark_s == 2.0
    assert report.time_to_land_s == 2.0  # from 8.5 s until the motors stopped at 10.5 s
    assert report.landing_error_m == 0.0679
    assert report.min_clearance_m == 0.6
    assert report.ticks == 19


def test_the_report_has_the_values_given() -> None:
    report = whole_flight().report(Verdict(outcome=Outcome.LEFT_AREA, reason="over the edge"))
    assert (report.outcome, report.reason) == ("left_area", "over the edge")
    assert (report.scene, report.seed, report.tree) == ("test-a", 7, "mission.xml")
    assert (report.drone, report.profile) == ("twin", "lab")
    assert report.policies == {"Mission/Explore": "segmentation"}


def test_a_prompt_and_a_notebook_show_what_was_reached() -> None:
    tale = Tale()
    tale.take_off()
    report = tale.report(Verdict(outcome=Outcome.TIMEOUT, reason="<1 s"))
    lines = str(report).splitlines()
    assert lines[:2] == ["outcome: timeout", "reason: <1 s"]
    assert "seed: 7" in lines
    assert not any(line.startswith("time_to_land_s") for line in lines)
    rows = re.findall("<tr><th>(.*?)</th><td>(.*?)</td></tr>", report._repr_html_())
    assert [": ".join(map(html.unescape, row)) for row in rows] == lines
    assert "<td>&lt;1 s</td>" in report._repr_html_()


def test_what_was_not_reached_is_none() -> None:
    """A flight that ends in the exploration has no times of search and landing."""
    tale = Tale()
    tale.take_off()
    tale.tick("explore", dx_m=0.5)
    report = tale.report()
    assert report.duration_s == 0.5
    assert report.total_distance_m == pytest.approx(0.5)
    assert report.search_distance_m is None
    assert report.time_to_find_mark_s is None
    assert report.time_to_land_s is None
    assert report.landing_error_m is None
    assert report.min_clearance_m is None  # a scene without boxes


def test_a_search_without_a_find_has_no_time_to_find() -> None:
    tale = Tale()
    tale.take_off()
    tale.tick("search", dx_m=0.5)
    tale.tick("search", motors_on=False, error_m=1.5)
    report = tale.report()
    assert report.time_to_find_mark_s is None
    assert report.search_distance_m is None
    assert report.time_to_land_s is None
    assert report.landing_error_m == 1.5


@pytest.mark.parametrize(
    ("motors_on", "error_m", "on_mark", "expected"),
    [
        (False, 0.09, True, True),
        (False, 1.5, False, False),
        (True, 0.09, True, None),
        (False, None, False, None),
    ],
)
def test_a_drone_stands_on_the_mark_or_elsewhere_once_its_motors_are_off(
    *, motors_on: bool, error_m: float | None, on_mark: bool, expected: bool | None
) -> None:
    """In the air, and in a scene without a mark, neither is known."""
    tale = Tale()
    tale.take_off()
    tale.tick("land", motors_on=motors_on, error_m=error_m, on_mark=on_mark)
    assert tale.report().on_mark is expected


def test_a_pad_that_is_in_view_from_the_first_has_no_search() -> None:
    tale = Tale()
    tale.take_off()
    tale.tick("explore", dx_m=1.0)
    tale.tick("approach", dx_m=1.0)
    report = tale.report()
    assert report.search_distance_m == 0.0
    assert report.time_to_find_mark_s == 0.0


def test_a_pad_that_is_lost_again_was_found_the_first_time() -> None:
    tale = Tale()
    tale.take_off()
    for phase in ("search", "search", "approach", "search", "approach"):
        tale.tick(phase)
    assert tale.report().time_to_find_mark_s == 1.0


def test_without_a_take_off_there_is_nothing_to_measure() -> None:
    tale = Tale()
    for _ in range(3):
        tale.tick("explore", dx_m=1.0, motors_on=False, clearance_m=0.1)
    report = tale.report()
    assert report.ticks == 3
    for name in ("duration_s", "explore_distance_m", "total_distance_m", "min_clearance_m"):
        assert getattr(report, name) is None, name
    assert report.landing_error_m is None


def test_a_flight_of_no_ticks_has_a_report() -> None:
    report = Tale().report(Verdict(outcome=Outcome.ERROR, reason="at once"))
    assert report.ticks == 0
    assert report.tick_ms is None
    assert report.duration_s is None


def test_the_way_explored_ends_90_s_after_the_take_off_command() -> None:
    tale = Tale()
    tale.take_off()
    for _ in range(240):
        tale.tick("explore", dx_m=0.1)
    report = tale.report()
    assert report.explore_distance_m == pytest.approx(18.0)
    assert report.total_distance_m == pytest.approx(24.0)


def test_a_patrol_counts_as_no_exploring() -> None:
    tale = Tale()
    tale.take_off()
    for _ in range(200):
        tale.tick("to the door", dx_m=0.1)  # 100 s
    assert tale.report().explore_distance_m is None
    tale.tick("explore", dx_m=0.1)  # begins after the first 90 s
    assert tale.report().explore_distance_m is None
    assert tale.report().total_distance_m == pytest.approx(20.1)


def test_the_median_tick_time_counts_ticks_of_the_tree_only() -> None:
    tale = Tale()
    tale.take_off()
    for _ in range(5):
        tale.tick("explore", compute_s=0.020)
    for _ in range(20):
        tale.tick("explore", compute_s=0.0, override=Override.MANUAL)
    for _ in range(50):
        tale.tick("explore", compute_s=0.0, status=Status.IDLE, override=Override.ABORT)
    report = tale.report()
    assert report.ticks == 3 + 5 + 20 + 50
    assert report.tick_ms is not None
    assert report.tick_ms.p50 == 20.0  # of three ticks with 1 ms and five with 20 ms


def test_what_happens_before_the_take_off_is_not_flown() -> None:
    """Carrying the drone to its start adds no distance."""
    tale = Tale()
    tale.tick(dx_m=1.0, motors_on=False)
    tale.take_off()
    tale.tick("explore", dx_m=0.5)
    assert tale.report().total_distance_m == pytest.approx(0.5)


def test_each_warning_is_reported_once() -> None:
    tale = Tale()
    tale.take_off()
    for warnings in ((), ("it drifts",), ("it drifts",), (), ("it drifts", "it drifts more")):
        tale.tick("explore", warnings=warnings)
    assert tale.report().warnings == ["it drifts", "it drifts more"]
    assert "warnings: ['it drifts'," in str(tale.report())
    assert "warnings" not in str(whole_flight().report())


def test_a_second_take_off_command_starts_nothing_anew() -> None:
    tale = Tale()
    tale.take_off()
    tale.tick("take-off", movement=TakeOff())
    tale.tick("explore")
    assert tale.report().duration_s == 1.0


def test_climbing_is_no_distance() -> None:
    """The logged flight climbs all the time, both in truth and in telemetry."""
    for referee in (True, False):
        tale = Tale(referee=referee)
        tale.take_off()
        tale.tick("explore")
        assert tale.report().total_distance_m == 0.0


def test_without_a_referee_the_distance_comes_from_the_speed() -> None:
    """The landing comes from the telemetry; quantities that need the truth are None."""
    report = whole_flight(referee=False).report()
    assert report.total_distance_m == pytest.approx(4.1)
    assert report.search_distance_m == pytest.approx(1.1)
    assert report.time_to_land_s == 2.0
    assert report.landing_error_m is None
    assert report.min_clearance_m is None


def test_a_descent_that_is_not_over_is_no_landing() -> None:
    for referee in (True, False):
        tale = Tale(referee=referee)
        tale.take_off()
        tale.tick("approach")
        tale.tick("land")
        assert tale.report().time_to_land_s is None


# --- durations ------------------------------------------------------------------------------------


def test_durations_become_milliseconds() -> None:
    summary = Percentiles.of_seconds([0.001 * value for value in range(101)])
    assert summary == Percentiles(p50=50.0, p99=99.0, max=100.0)


def test_no_durations_have_no_summary() -> None:
    assert Percentiles.of_seconds([]) is None


def test_coverage_counts_from_the_take_off_command_and_at_90_s() -> None:
    tale = Tale(coverage=CoveredGround(Ground(size_m=(5.0, 4.0)), anafi_camera(640, 360)))
    tale.x_m = -2.0
    for _ in range(40):
        tale.tick(dy_m=0.05, motors_on=False)  # carried before the command
    tale.y_m = 0.0
    tale.take_off()
    disc = math.pi * 0.25 / 20.0
    for _ in range(190):  # 95 s in one place
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


def test_a_flight_of_less_than_90_s_has_no_coverage_of_then() -> None:
    tale = Tale(coverage=CoveredGround(Ground(size_m=(5.0, 4.0)), anafi_camera(640, 360)))
    tale.take_off()
    tale.tick("explore")
    report = tale.report()
    assert report.coverage_passed_90s is None
    assert report.coverage_seen_90s is None
    assert report.coverage_passed is not None


def test_without_a_referee_there_is_no_coverage() -> None:
    tale = Tale(referee=False)
    tale.take_off()
    report = tale.report()
    assert (report.coverage_passed, report.coverage_seen, report.coverage_curve) == (None, None, [])


def test_ticks_and_stages_are_summarised() -> None:
    tale = Tale()
    for compute_s in (0.001, 0.002, 0.009):
        tale.tick(compute_s=compute_s)
    report = tale.report()
    assert report.tick_ms is not None
    assert (report.tick_ms.p50, report.tick_ms.max) == (2.0, 9.0)
    assert report.perception_ms == {
        "segmentation": Percentiles(p50=2.0, p99=2.0, max=2.0),
        "mark": None,
    }


# --- the file -------------------------------------------------------------------------------------

FIELDS = {
    "scene", "lab", "seed", "tree", "policies", "ports", "variables", "movers", "vary_room",
    "faults", "drone", "profile", "outcome", "reason",
    "duration_s",
    "explore_distance_m", "total_distance_m", "search_distance_m", "time_to_find_mark_s",
    "time_to_land_s", "landing_error_m", "on_mark", "min_clearance_m",
    "coverage_passed_90s", "coverage_passed", "coverage_seen_90s", "coverage_seen",
    "coverage_curve",
    "objects_found", "objects_total", "object_errors_m", "false_objects",
    "map_drift_90s_m", "map_drift_180s_m", "map_drift_m", "map_restarts",
    "objects", "photos", "events",
    "ticks", "tick_ms", "perception_ms", "slow_leaves", "warnings",
    "airborne_at_end",
    "lost_outputs",
}  # fmt: skip


def test_the_file_is_one_json_object_with_every_field_and_null_for_none(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    tale = Tale()
    tale.take_off()
    write_report(tale.report(), path)
    text = path.read_text(encoding="utf-8")
    told = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))
    assert set(told) == FIELDS
    assert told["time_to_land_s"] is None
    assert told["tick_ms"] == {"p50": 1.0, "p99": 1.0, "max": 1.0}
    assert text.endswith("}\n")


def test_a_report_replaces_the_old_one_and_leaves_nothing_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    path.write_text("old", encoding="utf-8")
    write_report(whole_flight().report(), path)
    assert json.loads(path.read_text(encoding="utf-8"))["outcome"] == "success"
    assert [file.name for file in tmp_path.iterdir()] == ["report.json"]


def test_a_report_that_cannot_be_written_leaves_the_old_one_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "report.json"
    path.write_text("old", encoding="utf-8")
    whole = Path.write_bytes

    def full_disk(self: Path, data: bytes) -> int:
        whole(self, data[:20])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full_disk)
    with pytest.raises(FileError, match="No space left"):
        write_report(whole_flight().report(), path)
    assert path.read_text(encoding="utf-8") == "old"
