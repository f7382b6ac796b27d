"""Reports: their content and sources; they are self-contained."""

from __future__ import annotations

import csv
import datetime as dt
import json
from collections.abc import Sequence
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from uav_bt.app.options import FlightOptions
from uav_bt.campaign import make_plan
from uav_bt.campaign.plan import SHARED, CampaignPlan, PlannedFile, PlannedTree
from uav_bt.campaign.report.campaign_report import WrittenReport, write_campaign_report
from uav_bt.campaign.report.figures import densities
from uav_bt.campaign.report.lab_figures import scene_figure
from uav_bt.campaign.report.origin import origin_table
from uav_bt.campaign.report.repeat import repeat_command
from uav_bt.campaign.report.sources import FlightSet, Provenance, read_sources
from uav_bt.campaign.store import CampaignStore
from uav_bt.display.lab_map import LabMap, MapItem
from uav_bt.errors import FileError
from uav_bt.mission.judge import JudgeConfig

PAGE, FILES = "html", "campaign_report"  # modules that draw the pictures of the page and the files
LAB = LabMap(
    ground_size_m=(5.0, 4.0),
    boxes=(MapItem(x_m=1.0, y_m=1.0, size_m=(0.4, 0.4, 1.9)),),
    mark=MapItem(x_m=-1.0, y_m=-1.0, size_m=(0.5, 0.5, 0.4)),
)
COVERED = {
    "coverage_passed_90s": 0.4,
    "coverage_passed": 0.5,
    "coverage_seen": 0.75,
    "coverage_curve": [[10.0 * n, 0.05 * n, 0.08 * n] for n in range(1, 10)],
}
PATH = [[0.0, -1.0, -1.0, 0.4], [10.0, 1.0, -1.0, 1.5], [20.0, -1.0, -1.0, 0.4]]
TIMES = {"p50": 1.0, "p99": 2.0, "max": 30.0}


def flight(seed: int, tree: str = "one.xml", **fields: Any) -> dict[str, Any]:
    return {
        "tree": tree,
        "scene": "lab",
        "seed": seed,
        "outcome": "success",
        "reason": "landed",
        "profile": "lab",
        "duration_s": 100.0,
        "explore_distance_m": 7.0 + seed / 7,
        "search_distance_m": float(seed),
        "time_to_find_mark_s": 2.0 * seed,
        "time_to_land_s": 15.0,
        "path": PATH,
        "tick_ms": TIMES,
        "perception_ms": {"segmentation": TIMES, "never": None},
        "wall_s": 20.0,
        **fields,
    }


def jsonl(path: Path, *flights: dict[str, Any]) -> Path:
    path.write_text("".join(json.dumps(one) + "\n" for one in flights))
    return path


def campaign(folder: Path, *flights: dict[str, Any], **how: Any) -> Path:
    shared = {name: how.pop(name) for name in SHARED if name in how}
    plan = CampaignPlan(
        trees=(PlannedTree(name="one.xml", path="/missions/one.xml", sha256="0" * 64),),
        scenes=(PlannedFile(name="lab", path="/labs/my lab.yaml", sha256="1" * 64),),
        flights=how.pop("planned", len(flights)),
        options=FlightOptions(**shared),
        **how,
    )
    about = {"code": "abc", "hardware": "Chip 9, 2 cores, VNNI"}
    with CampaignStore.opened(folder, plan, about) as store:
        for one in flights:
            store.keep(one)
    return folder


def write(
    out: Path, *paths: Path, undrawn: Sequence[str] = (PAGE, FILES), **options: Any
) -> WrittenReport:
    """Write a report. Drawing takes long: pictures are drawn only for tests that look at them."""
    with pytest.MonkeyPatch.context() as patch:
        for module in undrawn:
            patch.setattr(f"uav_bt.campaign.report.{module}.drawn", lambda *_: b"undrawn")
        return write_campaign_report(
            read_sources(paths), out, maps={"lab": LAB}, today=dt.date(2026, 1, 2), **options
        )


def rows(written: WrittenReport, name: str) -> list[dict[str, str]]:
    (file,) = (path for path in written.tables if path.stem.endswith(f"-{name}"))
    with file.open(newline="") as stream:
        return list(csv.DictReader(stream))


class Page(HTMLParser):
    """Collects the references of a page, and checks the order of its closing tags."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.references: list[str] = []
        self.tags: list[str] = []
        self.open: list[str] = []
        self.texts: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.references += [value or "" for name, value in attrs if name in {"src", "href"}]
        if tag not in {"meta", "img", "br"}:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


def test_a_report_is_a_page_with_pictures_and_tables_beside_it(tmp_path: Path) -> None:
    folder = campaign(tmp_path / "c", *(flight(seed) for seed in range(6)))
    written = write(tmp_path / "r.html", folder, undrawn=[PAGE])
    assert [str(path.relative_to(tmp_path)) for path in written.images] == [
        *("r-figures/outcomes.png", "r-figures/densities.png", "r-figures/scene-lab.png")
    ]
    for path in written.images:
        picture = cv2.imread(str(path))
        assert picture is not None
        assert picture.std() > 5.0, "a picture shows something"
    assert {path.name for path in written.tables} == {
        f"r-{name}.csv"
        for name in (
            "outcomes",
            "scenes",
            "metrics",
            "rates",
            "failures",
            "timings",
            "flights",
            "map",
            "pairs",
        )
    }
    assert sorted(path.name for path in tmp_path.iterdir() if path.suffix == ".part") == []


def test_the_page_stands_alone(tmp_path: Path) -> None:
    page = Page(write(tmp_path / "r.html", campaign(tmp_path / "c", flight(0))).page.read_text())
    assert page.open == []
    assert len(page.references) == 3
    assert all(one.startswith("data:image/png;base64,") for one in page.references)
    assert not {"script", "link", "iframe"} & set(page.tags)


def test_the_page_names_the_machine(tmp_path: Path) -> None:
    page = Page(write(tmp_path / "r.html", campaign(tmp_path / "c", flight(0))).page.read_text())
    assert "Chip 9, 2 cores, VNNI" in page.texts


def test_the_page_says_that_a_machine_was_not_recorded(tmp_path: Path) -> None:
    folder = campaign(tmp_path / "c", flight(0))
    kept = json.loads((folder / "campaign.json").read_text())
    del kept["runs"][0]["hardware"]
    (folder / "campaign.json").write_text(json.dumps(kept))
    assert "not recorded" in Page(write(tmp_path / "r.html", folder).page.read_text()).texts


def test_the_same_flights_make_the_same_report(tmp_path: Path) -> None:
    folder = campaign(tmp_path / "c", *(flight(seed) for seed in range(6)))
    first = write(tmp_path / "r.html", folder, undrawn=[]).page.read_bytes()
    assert write(tmp_path / "r.html", folder, undrawn=[]).page.read_bytes() == first


@pytest.mark.parametrize(
    ("form", "begins", "date"),
    [("pdf", b"%PDF-", b"CreationDate"), ("svg", b"<?xml", b"dc:date")],
)
def test_the_same_flights_make_the_same_vector_figures(
    tmp_path: Path, form: str, begins: bytes, date: bytes
) -> None:
    folder = campaign(tmp_path / "c", *(flight(seed, **COVERED) for seed in range(6)))
    written = write(tmp_path / "r.html", folder, figures=form, undrawn=[PAGE])
    files = [path.read_bytes() for path in written.images]
    assert [path.name for path in written.images] == [
        f"{name}.{form}" for name in ("outcomes", "densities", "coverage", "scene-lab")
    ]
    assert all(one.startswith(begins) for one in files)
    assert not any(date in one for one in files)
    again = write(tmp_path / "r.html", folder, figures=form, undrawn=[PAGE])
    assert [path.read_bytes() for path in again.images] == files
    assert "data:image/png" in written.page.read_text()


def test_figures_stay_in_the_page_alone(tmp_path: Path) -> None:
    folder = campaign(tmp_path / "c", flight(0))
    written = write(tmp_path / "r.html", folder, figures=None, undrawn=[])
    assert written.images == ()
    assert not (tmp_path / "r-figures").exists()
    assert "data:image/png" in written.page.read_text()


def test_texts_of_others_cannot_become_part_of_the_page(tmp_path: Path) -> None:
    evil = '<script>alert("x")</script>&$\\alpha'
    one = flight(0, tree=f"{evil}.xml", scene=evil, outcome="collision", reason=evil, profile=evil)
    page = Page(write(tmp_path / "r.html", jsonl(tmp_path / "f.jsonl", one)).page.read_text())
    assert "script" not in page.tags
    assert evil in page.texts


def test_outcomes_come_with_their_intervals(tmp_path: Path) -> None:
    flights = [flight(seed, outcome="timeout" if seed == 0 else "success") for seed in range(20)]
    (row,) = rows(write(tmp_path / "r.html", campaign(tmp_path / "c", *flights)), "outcomes")
    assert row == {
        "tree": "one",
        "flights": "20",
        "successes": "19",
        "success, %": "95.0",
        "from, %": "76.4",
        "to, %": "99.1",
        "collision": "0",
        "left area": "0",
        "timeout": "1",
        "aborted": "0",
        "error": "0",
    }


def test_successes_of_a_few_flights_are_counted_and_not_given_in_percent(tmp_path: Path) -> None:
    """The Wilson interval of 2 of 2 begins at 2 / (2 + 1.96**2) = 34.2 %."""
    written = write(tmp_path / "r.html", campaign(tmp_path / "c", flight(0), flight(1)))
    page = Page(written.page.read_text())
    assert "2 of 2" in page.texts
    assert "34.2" in page.texts
    assert "success, %" not in page.texts
    (row,) = rows(written, "outcomes")
    assert (row["flights"], row["successes"], row["success, %"]) == ("2", "2", "")


def test_every_failure_has_its_reason_its_record_and_a_way_to_see_it_again(tmp_path: Path) -> None:
    folder = tmp_path / "c"
    lost = flight(3, outcome="collision", reason="touched box-4", record="records/a b.mcap")
    gone = flight(4, outcome="timeout", reason="too late", record="records/gone.mcap")
    campaign(folder, flight(0), lost, gone, policies={"Explore": "mine"}, profile="harsh")
    (folder / "records").mkdir()
    (folder / "records" / "a b.mcap").touch()
    written = write(tmp_path / "r.html", folder)
    first, second = rows(written, "failures")
    assert (first["outcome"], first["reason"]) == ("collision", "touched box-4")
    assert first["record"] == "c/records/a b.mcap"
    assert second["record"] == ""
    assert first["command to repeat"] == (
        "uav-bt fly /missions/one.xml --scene '/labs/my lab.yaml' --seed 3 --profile lab "
        "--policy Explore=mine --out one-lab-3"
    )
    assert 'href="c/records/a%20b.mcap"' in written.page.read_text()


def test_flights_on_exact_masks_are_seen_again_with_exact_masks(tmp_path: Path) -> None:
    one = flight(3, outcome="error", reason="crashed")
    folder = campaign(tmp_path / "c", one, exact_masks=True, image_size_px=(160, 90))
    (row,) = rows(write(tmp_path / "r.html", folder), "failures")
    assert row["command to repeat"] == (
        "uav-bt fly /missions/one.xml --scene '/labs/my lab.yaml' --seed 3 --exact-masks "
        "--profile lab --image-size 160x90 --out one-lab-3"
    )


def test_what_was_drawn_for_a_flight_is_in_the_command_that_repeats_it(tmp_path: Path) -> None:
    drawn = {"drone": "plain", "vary_room": True, "movers": 1, "faults": ["wind=0.1@explore~3"]}
    drawn["folder"] = "flights/one-lab-3"
    folder = campaign(tmp_path / "c", flight(3, outcome="collision", reason="touched", **drawn))
    (row,) = rows(write(tmp_path / "r.html", folder), "failures")
    assert (
        "--seed 3 --drone plain --profile lab --vary-room --movers 1 "
        "--faults 'wind=0.1@explore~3' --out one-lab-3"
    ) in row["command to repeat"]


def test_events_are_counted_per_hour_with_an_interval(tmp_path: Path) -> None:
    """One contact in half an hour: 2 per hour, and 0.05 to 11.1 by chi-squared."""
    flights = [flight(seed, duration_s=900.0, total_distance_m=90.0) for seed in range(1)]
    hit = flight(1, outcome="collision", reason="touched", duration_s=900.0, total_distance_m=90.0)
    folder = campaign(tmp_path / "c", *flights, hit)
    (row,) = rows(write(tmp_path / "r.html", folder), "rates")
    assert (row["hours"], row["metres per hour"]) == ("0.5", "360")
    assert (row["contacts"], row["contacts, rate"]) == ("1", "200.0")
    assert (row["contacts, from"], row["contacts, to"]) == ("5.1", "1114.3")
    assert (row["exits"], row["exits, to"]) == ("0", "599.1")


@pytest.mark.parametrize(
    ("fields", "count"),
    [
        ({"on_mark": False}, "1"),
        ({"on_mark": True}, "0"),
        ({"on_mark": None}, "0"),
        ({}, "0"),
        ({"on_mark": False, "outcome": "success"}, "0"),
    ],
)
def test_a_landing_elsewhere_is_one_beside_the_mark(
    tmp_path: Path, fields: dict[str, Any], count: str
) -> None:
    ended = {"outcome": "aborted", "reason": "critical battery: 6 %", "landing_error_m": 0.09}
    folder = campaign(tmp_path / "c", flight(0, **(ended | fields)))
    (row,) = rows(write(tmp_path / "r.html", folder), "rates")
    assert row["landings elsewhere"] == count


def test_the_page_has_the_events_per_hour_and_how_their_interval_is_made(tmp_path: Path) -> None:
    page = Page(write(tmp_path / "r.html", campaign(tmp_path / "c", flight(0))).page.read_text())
    assert "Events per 100 hours" in page.texts
    assert "landings elsewhere" in page.texts
    assert any("exact 95 % interval of the rate" in text for text in page.texts)


def test_trees_stand_side_by_side_also_under_one_name(tmp_path: Path) -> None:
    one = campaign(tmp_path / "one", *(flight(seed) for seed in range(3)))
    two = jsonl(tmp_path / "two.jsonl", flight(0), flight(1, tree="other.xml"))
    sources = read_sources([one, two, one])
    assert [item.label for item in sources.sets] == [f"one ({one})", f"one ({two})", "other"]
    written = write(tmp_path / "r.html", one, two)
    assert [row["flights"] for row in rows(written, "outcomes")] == ["3", "1", "1"]


def test_metrics_count_the_flights_that_came_so_far(tmp_path: Path) -> None:
    flights = [flight(seed, time_to_land_s=None if seed else 20.0) for seed in range(3)]
    written = write(tmp_path / "r.html", campaign(tmp_path / "c", *flights))
    (row,) = (row for row in rows(written, "metrics") if row["metric"] == "time_to_land_s")
    assert (row["flights"], row["mean"], row["least"], row["most"]) == ("1", "20.0", "20.0", "20.0")


DEPTH = "explore_and_land_depth.xml"


def test_the_paper_is_quoted_of_its_own_missions(tmp_path: Path) -> None:
    source = jsonl(tmp_path / "f.jsonl", flight(0, tree=DEPTH), flight(1, tree="one.xml"))
    written = write(tmp_path / "r.html", source)
    said = {(row["tree"], row["metric"]): row["paper"] for row in rows(written, "metrics")}
    assert said["explore_and_land_depth", "search_distance_m"] == "depth: up to 25 m"
    assert said["one", "search_distance_m"] == ""
    assert "30 real flights of explore_and_land_depth." in written.page.read_text()


def test_other_missions_have_nothing_of_the_paper(tmp_path: Path) -> None:
    flights = [flight(seed, tree="my_survey.xml") for seed in range(6)]
    written = write(tmp_path / "r.html", jsonl(tmp_path / "f.jsonl", *flights), undrawn=[PAGE])
    assert "paper" not in written.page.read_text()
    assert "paper" not in rows(written, "metrics")[0]
    theirs = [{**one, "tree": DEPTH} for one in flights]
    other = write(tmp_path / "d.html", jsonl(tmp_path / "d.jsonl", *theirs), undrawn=[PAGE])
    mine, depth = (cv2.imread(str(one.images[1])) for one in (written, other))
    assert yellow(mine) == 0
    assert yellow(depth) > 100


def yellow(picture: Any) -> int:
    """Return how many pixels have the colour of the paper's bands."""
    blue, green, red = (picture[..., channel].astype(int) for channel in range(3))
    return int(((red > 240) & (green > 200) & (blue < 180)).sum())


def test_scene_and_mission_are_named_above_the_maps(tmp_path: Path) -> None:
    page = Page(write(tmp_path / "r.html", campaign(tmp_path / "c", flight(0))).page.read_text())
    assert "Scene lab" in page.texts
    assert any(text.startswith("1 flight in lab, ") for text in page.texts)
    assert "Flights of one" in page.texts


def test_a_path_that_leaves_the_ground_stays_in_view(tmp_path: Path) -> None:
    """The ground is 5 m x 4 m; one flight ends at x = 3.4 m."""
    away = [[0.0, 0.0, 0.0, 1.0], [1.0, 3.4, 0.0, 1.0]]
    sets = read_sources([jsonl(tmp_path / "f.jsonl", flight(0), flight(1, path=away))]).sets
    figure = scene_figure(sets, "lab", LAB)
    assert figure is not None
    for axes in figure.axes[:2]:
        assert axes.get_xlim() == pytest.approx((-3.5, 3.5))
        assert axes.get_ylim() == pytest.approx((-2.1, 2.1))


def test_what_no_flight_reached_is_left_out(tmp_path: Path) -> None:
    never = dict.fromkeys(("search_distance_m", "time_to_find_mark_s", "time_to_land_s"))
    bare = [flight(seed, duration_s=22.0, profile=None, **never) for seed in range(2)]
    written = write(tmp_path / "r.html", jsonl(tmp_path / "f.jsonl", *bare), undrawn=[PAGE])
    assert {row["metric"] for row in rows(written, "metrics")} == {"duration_s"}
    text = written.page.read_text()
    for word in ("search", "90 s", "mark", "`"):
        assert word not in text
    whole = write(
        tmp_path / "w.html", jsonl(tmp_path / "w.jsonl", flight(0), flight(1)), undrawn=[PAGE]
    )
    few, many = (cv2.imread(str(one.images[1])) for one in (written, whole))
    assert few.shape[0] < many.shape[0], "panels without a value are left out"


def test_a_metric_that_is_0_in_all_flights_has_no_panel(tmp_path: Path) -> None:
    """A mission without a search has a search distance of 0 m in each flight."""
    titles = []
    for name, searched_m in (("none", 0.0), ("some", 1.5)):
        flights = [flight(seed, search_distance_m=searched_m) for seed in range(3)]
        figure = densities(read_sources([jsonl(tmp_path / f"{name}.jsonl", *flights)]).sets)
        assert figure is not None
        titles.append({axes.get_title(loc="left") for axes in figure.axes if axes.get_visible()})
    assert titles[1] - titles[0] == {"distance while searching, m"}


def test_the_first_90_s_are_those_of_flights_that_lasted_so_long(tmp_path: Path) -> None:
    source = jsonl(tmp_path / "f.jsonl", flight(0), flight(7, duration_s=22.0))
    written = write(tmp_path / "r.html", source)
    (row,) = (row for row in rows(written, "metrics") if row["metric"] == "explore_distance_m")
    assert (row["flights"], row["most"]) == ("1", "7.0")
    assert "shorter flights do not count" in written.page.read_text()


def test_trees_on_the_same_flights_are_compared(tmp_path: Path) -> None:
    flights = [flight(seed, tree) for tree in ("one.xml", "two.xml") for seed in range(3)]
    written = write(tmp_path / "r.html", jsonl(tmp_path / "f.jsonl", *flights))
    assert "Compared on the same flights" in Page(written.page.read_text()).texts
    assert [row["measure"] for row in rows(written, "pairs")] == ["successes", "duration_s"]
    alone = write(tmp_path / "r.html", jsonl(tmp_path / "f.jsonl", *flights[:3]))
    assert "Compared on the same flights" not in alone.page.read_text()


def test_the_same_again_has_the_movers(tmp_path: Path) -> None:
    lost = flight(3, outcome="collision", reason="touched mover-1", movers=2)
    written = write(tmp_path / "r.html", campaign(tmp_path / "c", lost, movers=2))
    (row,) = rows(written, "failures")
    assert "--profile lab --movers 2" in row["command to repeat"]
    assert "movers" in Page(written.page.read_text()).texts


def test_coverage_stands_in_the_table_and_in_a_figure_of_its_own(tmp_path: Path) -> None:
    source = jsonl(
        tmp_path / "f.jsonl",
        *(flight(seed, **COVERED | {"coverage_passed": 0.5 + seed / 10}) for seed in range(3)),
        *(flight(seed, tree="two.xml", **COVERED) for seed in range(3)),
    )
    written = write(tmp_path / "r.html", source, undrawn=[PAGE])
    table = {(row["metric"], row["tree"]): row for row in rows(written, "metrics")}
    row = table["coverage_passed", "one"]
    assert (row["mean"], row["median"], row["least"], row["most"]) == (
        "60.0",
        "60.0",
        "50.0",
        "70.0",
    )
    assert row["unit"] == "%"
    assert table["coverage_seen", "two"]["mean"] == "75.0"
    assert "within 0.5 m of the flown path" in written.page.read_text()
    (figure,) = (path for path in written.images if path.name == "coverage.png")
    first = cv2.imread(str(figure))
    more = dict(COVERED, coverage_curve=[[10.0, 0.3, 0.9], [20.0, 0.4, 0.95]])
    write(tmp_path / "r.html", jsonl(tmp_path / "more.jsonl", flight(0, **more)), undrawn=[PAGE])
    assert first is not None
    assert not np.array_equal(first, cv2.imread(str(figure)))


def test_maps_stand_in_a_table_of_their_own(tmp_path: Path) -> None:
    made: dict[str, Any] = {
        "objects_found": 2,
        "objects_total": 4,
        "object_errors_m": [0.1, 0.3],
        "false_objects": 1,
        "map_drift_m": 0.25,
        "map_restarts": 1,
    }
    lost = made | {"objects_found": 0, "object_errors_m": [], "map_drift_m": 0.75}
    source = jsonl(
        tmp_path / "f.jsonl", flight(0, **made), flight(1, **lost), flight(2, tree="two.xml")
    )
    written = write(tmp_path / "r.html", source)
    (row,) = rows(written, "map")
    assert row["tree"] == "one"
    assert (row["flights"], row["objects found"], row["of"], row["found, %"]) == (
        *("2", "2", "8", "25.0"),
    )
    assert (row["false objects"], row["error, m: mean"], row["most"]) == ("2", "0.2", "0.3")
    assert row["95 %"] == "", "two flights have no percentiles"
    assert row["restarts"] == "2"
    (drift,) = (row for row in rows(written, "metrics") if row["metric"] == "map_drift_m")
    assert (drift["mean"], drift["most"]) == ("0.5", "0.75")
    assert "an object of its class within 0.5 m" in written.page.read_text()
    no_map = write(tmp_path / "no.html", jsonl(tmp_path / "n.jsonl", flight(0)))
    assert "The mission's map" not in no_map.page.read_text()


def test_panels_of_many_trees_keep_their_height(tmp_path: Path) -> None:
    flights = [flight(n, f"tree-{name}.xml") for name in range(12) for n in range(6)]
    figure = densities(read_sources([jsonl(tmp_path / "f.jsonl", *flights)]).sets)
    assert figure is not None
    FigureCanvasAgg(figure).draw()
    heights_in = [axes.get_position().height * figure.get_figheight() for axes in figure.axes]
    assert min(heights_in) > 0.8


@pytest.mark.parametrize("count", [1, 2, 3, 8])
def test_nothing_is_drawn_through_what_is_written_of_a_few_flights(
    tmp_path: Path, count: int
) -> None:
    source = jsonl(tmp_path / "f.jsonl", *(flight(seed, tree=DEPTH) for seed in range(count)))
    figure = densities(read_sources([source]).sets)
    assert figure is not None
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    panels = [axes for axes in figure.axes if axes.get_visible()]
    boxes = [axes.get_window_extent(renderer) for axes in panels]
    words = [
        text.get_window_extent(renderer)
        for axes in panels
        for text in (*axes.texts, axes.title, axes._left_title)
        if text.get_text()
    ]
    assert len(words) > 2 * len(panels)
    for index, word in enumerate(words):
        assert not any(word.overlaps(box) for box in boxes)
        assert not any(word.overlaps(other) for other in words[:index])


def test_timings_are_listed_by_stage(tmp_path: Path) -> None:
    written = write(tmp_path / "r.html", campaign(tmp_path / "c", flight(0), flight(1)))
    told = {row["stage"]: row for row in rows(written, "timings")}
    assert set(told) == {"whole tick", "segmentation", "flight"}
    assert told["segmentation"]["longest, ms"] == "30.0"
    assert told["flight"]["times real time"] == "5.0"


def test_flights_that_ended_before_anything_make_a_report_too(tmp_path: Path) -> None:
    bare = {"tree": "a.xml", "scene": None, "seed": 0, "outcome": "error", "reason": "crashed"}
    written = write(tmp_path / "r.html", jsonl(tmp_path / "f.jsonl", bare))
    assert [path.name for path in written.images] == ["outcomes.png"]
    assert "Times and distances" not in written.page.read_text()


def test_damaged_lines_and_missing_flights_are_listed_first(tmp_path: Path) -> None:
    folder = campaign(tmp_path / "c", flight(0), planned=5)
    with (folder / "flights.jsonl").open("a") as kept:
        kept.write("rubbish\n")
    text = write(tmp_path / "r.html", folder).page.read_text()
    note, failures = text.index("Please note"), text.index("Every failure")
    assert note < text.index("flights.jsonl:2: no JSON") < failures
    assert "1 of 5 planned flights were flown" in text


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "no flights in this folder; `uav-bt campaign` keeps them in flights.jsonl"),
        ("", "no flights; expected lines that `uav-bt campaign` wrote"),
        ("rubbish\n", "no flights, 1 damaged line; the first of them: "),
    ],
)
def test_a_folder_without_flights_is_refused(
    tmp_path: Path, content: str | None, message: str
) -> None:
    if content is not None:
        (tmp_path / "flights.jsonl").write_text(content)
    with pytest.raises(FileError, match=message):
        read_sources([tmp_path])


def test_a_campaign_that_was_refused_says_how_it_is_flown(tmp_path: Path) -> None:
    folder = campaign(tmp_path / "c", planned=5)
    with pytest.raises(FileError) as refused:
        read_sources([folder])
    assert str(refused.value) == (
        f"{folder}: this campaign has no flight yet; `uav-bt campaign --resume {folder}` flies it, "
        f"and `uav-bt campaign TREE... --out {folder}` flies another one in its place"
    )


def test_pictures_differ_with_what_they_show(tmp_path: Path) -> None:
    near, far = ([[0.0, 0.0, 0.0, 1.0], [1.0, end, 0.0, 1.0]] for end in (0.1, 2.0))
    pictures = [
        cv2.imread(str(write(tmp_path / "r.html", source, undrawn=[PAGE]).images[2]))
        for source in (
            jsonl(tmp_path / "near.jsonl", flight(0, tree="a.xml", path=near)),
            jsonl(tmp_path / "far.jsonl", flight(0, tree="a.xml", path=far)),
        )
    ]
    assert np.any(pictures[0] != pictures[1])


def test_the_origin_of_a_campaign_names_what_was_changed_for_it(tmp_path: Path) -> None:
    params = tmp_path / "params.yaml"
    params.write_text("variants: {slow: {set: {HelipadCenter.climb_m: 0.4}}}")
    options = FlightOptions(
        ports={"TakeOff.height_m": "1.2"},
        params=params,
        judge=JudgeConfig(time_limit_s=60.0),
        exact_masks=True,
    )
    plan = make_plan(["land_only"], options, scenes=["val-a"], flights=1)
    source = Provenance(path=tmp_path, plan=plan, runs=())
    rows = origin_table(source).rows
    assert ("port", "TakeOff.height_m=1.2") in rows
    (tree,) = [text for name, text in rows if name == "tree land_only[slow].xml"]
    assert str(tree).endswith(", HelipadCenter.climb_m=0.4")
    flown = flight(0, tree="land_only[slow].xml", ports={"A.b": "1"}, variables={"laps": 3})
    one = FlightSet(label="slow", tree="land_only[slow].xml", flights=(flown,), source=source)
    words = repeat_command(one, flown)
    assert words.startswith("uav-bt fly land_only --scene")
    assert "--set A.b=1 --var laps=3" in words
    assert ("time limit", "60 s") in rows


def test_the_origin_of_flights_without_images_names_drone_and_faults(tmp_path: Path) -> None:
    options = FlightOptions(drone="plain", faults=["random"], vary_room=True, movers=1)
    plan = make_plan(["land_only"], options, scenes=["val-a"], flights=1)
    found = dict(origin_table(Provenance(path=tmp_path, plan=plan, runs=())).rows)
    assert (found["drone"], found["faults"], found["movers"]) == ("plain", "random", "1")
    assert found["room"] == "boxes placed and sized by the seed"
    assert not [name for name in found if str(name).startswith(("weights", "images", "masks"))]


def test_the_origin_of_flights_in_the_twin_names_images_and_weights(tmp_path: Path) -> None:
    plan = make_plan(["land_only"], scenes=["val-a"], flights=1)
    found = dict(origin_table(Provenance(path=tmp_path, plan=plan, runs=())).rows)
    assert (found["images"], found["masks"]) == ("640x360", "the network's")
    assert [name for name in found if str(name).startswith("weights")]
    assert not {"drone", "faults", "room"} & set(found)
