"""Flights that random rooms, movers and faults have found, with the causes that are left."""

from __future__ import annotations

import pytest

from uav_bt import app

SHORT_MS = 30_000


def fly(
    tree: str,
    scene: str,
    seed: int,
    *faults: str,
    vary_room: bool = True,
    movers: int = 0,
    explores_ms: int = SHORT_MS,
) -> app.FlownMission:
    options = app.FlightOptions(
        scene=scene,
        seed=seed,
        drone="plain",
        vary_room=vary_room,
        movers=movers,
        faults=faults,
        ports={"ExploreFor.duration_ms": str(explores_ms)},
    )
    return app.fly(tree, options)


def test_a_step_that_is_broken_off_does_not_deflect_the_next() -> None:
    """The speed of the braking drone was learned as a drift, and the next step was aimed at it."""
    flown = fly("explore_and_land_depth", "val-a", 20030)
    assert flown.outcome == "success"


def test_a_wrong_speed_in_the_telemetry_turns_with_the_drone() -> None:
    """The drone turned away from the ground, and flew off by the error of the former heading."""
    flown = fly(
        "explore_and_land_depth", "val-b", 1, "velocity-bias=-0.2@take-off+1", vary_room=False
    )
    assert flown.outcome == "success"


def test_a_frozen_image_does_not_displace_the_map() -> None:
    """Equal images of a moving drone were taken for a drift until the video was back."""
    flown = fly("survey_and_land", "train-b", 20014, "frozen@explore+17.9~10.5")
    assert flown.outcome == "success"
    assert flown.map_drift_m is not None
    assert flown.map_drift_m < 0.15


def test_an_outage_of_telemetry_does_not_displace_the_map() -> None:
    """The last velocity was integrated over the 9 s in which the drone hovered: 1.6 m."""
    flown = fly("survey_and_land", "val-b", 24003, "height-nan@explore+12~9")
    assert flown.outcome == "success"
    assert flown.map_drift_m is not None
    assert flown.map_drift_m < 0.15


def test_on_the_way_home_it_stays_above_a_mover() -> None:
    """Only leaves that give way flew higher; the others descended, and a person walked into it."""
    flown = fly("survey_and_land", "train-b", 5005, vary_room=False, movers=1)
    assert flown.outcome == "success"


def test_a_hover_without_telemetry_is_held_against_the_drift_measured_before() -> None:
    """It drifted for 10 s until the landing, which ended on a box."""
    faults = "drift=0.065@take-off+0.4", "velocity-nan@explore+15.4"
    flown = fly("explore_and_land_segmentation", "train-c", 28009, *faults)
    assert flown.outcome == "aborted"
    assert flown.min_clearance_m is not None
    assert flown.min_clearance_m > 0.05


def test_a_box_beside_the_take_off_whose_base_is_never_seen_is_not_touched() -> None:
    """Its vertical edge was taken for a base farther away, so that its range counted as known."""
    flown = fly("explore_and_land_segmentation", "val-b", 28005, explores_ms=90_000)
    assert flown.outcome == "success"


@pytest.mark.parametrize(
    ("tree", "seed", "scene", "error_mps", "movers"),
    [
        ("explore_and_land_depth", 27002, "val-a", -0.15, 1),
        ("explore_and_land_segmentation", 31004, "train-a", -0.2, 0),
    ],
)
def test_at_an_edge_the_drone_sees_enough_ground_to_measure_its_drift(
    tree: str, seed: int, scene: str, error_mps: float, movers: int
) -> None:
    """Turning at the edge it saw ground for a third of the time, and drifted over the edge."""
    fault = f"velocity-bias={error_mps}@explore+15.5"
    flown = fly(tree, scene, seed, fault, movers=movers, explores_ms=90_000)
    assert flown.outcome == "success"


@pytest.mark.parametrize(
    ("tree", "seed", "faults"),
    [
        ("survey_and_land", 33009, ["wind=0.24@explore+21.6~1.7"]),
        ("explore_and_land_depth", 33011, []),
    ],
)
def test_a_slow_mover_that_comes_below_the_view_after_few_views_is_evaded(
    tree: str, seed: int, faults: list[str]
) -> None:
    """Its speed was not certain yet when its base left the view, and the drone flew on."""
    flown = fly(tree, "train-b", seed, *faults, movers=1)
    assert flown.outcome == "success"


@pytest.mark.parametrize("scene", ["train-b", "val-b"])
def test_a_slow_mover_is_no_standing_obstacle_that_drifts(scene: str) -> None:
    """A standing point was allowed to move by 0.3 m, and new points moved on with the mover."""
    flown = fly("survey_and_land", scene, 820, movers=1)
    assert flown.outcome == "success"
