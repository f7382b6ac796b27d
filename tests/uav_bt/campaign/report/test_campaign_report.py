"""Reports: their content and sources; they are self-contained."""

from __future__ import annotations

import csv
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import pytest
from markupsafe import escape
from matplotlib.font_manager import fontManager

from sim_bridge.twin.scene_file import load_scene
from tests.uav_bt.campaign.campaign_world import jsonl, keep, line, plan
from uav_bt.app.options import FlightOptions
from uav_bt.campaign import make_plan
from uav_bt.campaign.plan import PlannedFile
from uav_bt.campaign.report import figures as plots
from uav_bt.campaign.report.campaign_report import WrittenReport, write_report
from uav_bt.campaign.report.sources import FlightSet, read_sources
from uav_bt.campaign.report.tables import origin_table
from uav_bt.errors import FileError
from uav_bt.mission.judge import JudgeConfig

COVERED = {
    "coverage_passed_90s": 0.4,
    "coverage_passed": 0.5,
    "coverage_seen": 0.75,
    "coverage_curve": [[10.0 * n, 0.05 * n, 0.08 * n] for n in range(1, 10)],
}
PATH = [[0.0, -1.0, -1.0, 0.4], [10.0, 1.0, -1.0, 1.5], [20.0, -1.0, -1.0, 0.4]]
TIMES = {"p50": 1.0, "p99": 2.0, "max": 30.0}


def flight(seed: int, tree: str = "one.xml", **fields: Any) -> dict[str, Any]:
    known = {
        "tree": tree,
        "scene": "val-a",
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
    }
    return line(seed, **known | fields)


def campaign(folder: Path, *flights: dict[str, Any], **how: Any) -> Path:
    trees = [PlannedFile(name="one.xml", path="/missions/one.xml")]
    scenes = [PlannedFile(name="val-a", path="/labs/my lab.yaml")]
    number = how.pop("planned", len(flights))
    keep(folder, *flights, of=plan(trees=trees, scenes=scenes, flights=number, **how))
    return folder


def write(out: Path, *paths: Path, drawn: bool = False, **options: Any) -> WrittenReport:
    """Write a report. Drawing takes long: only for tests that look at the pictures."""
    with pytest.MonkeyPatch.context() as patch:
        if not drawn:
            patch.setattr(plots, "drawn", lambda *_: b"undrawn")
        return write_report(paths, out, **options)


def rows(written: WrittenReport, name: str) -> list[dict[str, str]]:
    (file,) = (path for path in written.tables if path.stem.endswith(f"-{name}"))
    with file.open(newline="") as stream:
        return list(csv.DictReader(stream))


def rows_of(folder: Path, name: str, *flights: dict[str, Any]) -> list[dict[str, str]]:
    """Return a table of the report of some flights."""
    return rows(write(folder / "r.html", jsonl(folder / "f.jsonl", *flights)), name)


def references(written: WrittenReport) -> list[str]:
    """Return what the page refers to, after a check that its tags close."""
    text = written.page.read_text().replace("&amp;", "&")
    tags = re.findall(r"<(/?)(h\d|p|div|table|tr|th|td|code|a|html)\b", text)
    assert len([1 for close, _ in tags if close]) == len([1 for close, _ in tags if not close])
    return re.findall(r'(?:src|href)="([^"]*)"', text)


@pytest.mark.parametrize(
    ("form", "begins"), [("png", b"\x89PNG"), ("pdf", b"%PDF-"), ("svg", b"<?xml")]
)
def test_the_same_flights_make_the_same_page_figures_and_tables(
    tmp_path: Path, form: str, begins: bytes
) -> None:
    source = jsonl(tmp_path / "f.jsonl", *(flight(seed, **COVERED) for seed in range(6)))
    written = write(tmp_path / "r.html", source, drawn=True, figures=form)
    assert [str(path.relative_to(tmp_path)) for path in written.images] == [
        f"r-figures/{name}.{form}" for name in ("distributions", "coverage", "scene-val-a")
    ]
    names = "outcomes scenes metrics rates timings flights map failures pairs"
    assert [path.name for path in written.tables] == [f"r-{name}.csv" for name in names.split()]
    files = (written.page, *written.images, *written.tables)
    first = [path.read_bytes() for path in files]
    assert all(one.startswith(begins) for one in first[1:4])
    assert not any(date in one for one in first[1:4] for date in (b"CreationDate", b"dc:date"))
    if form == "png":
        pictures = [cv2.imread(str(path)) for path in written.images]
        assert all(picture is not None and picture.std() > 5.0 for picture in pictures)
    write(tmp_path / "r.html", source, drawn=True, figures=form)
    assert [path.read_bytes() for path in files] == first


def test_the_page_stands_alone_and_names_flights_and_machine(tmp_path: Path) -> None:
    folder = campaign(tmp_path / "c", flight(0), planned=5)
    notes: list[str] = []
    written = write(tmp_path / "r.html", folder, figures=None, on_note=notes.append)
    found, text = references(written), written.page.read_text()
    assert len(found) == 1, "the scene's file is gone"
    assert all(one.startswith("data:image/png;base64,") for one in found)
    assert not any(f"<{tag}" in text for tag in ("script", "link", "iframe"))
    assert not written.images
    assert not (tmp_path / "r-figures").exists()
    for words in ("Flights of one", "abc", "Please note", notes[0]):
        assert f">{words}</" in text
    assert re.search(r"1 flight in val-a, \d{4}-\d\d-\d\d, uav-bt 0.1.0", text)
    assert notes[0] == f"{folder}: 1 of 5 planned flights were flown"
    assert notes[1].startswith("no map of scene 'val-a': ")


def test_texts_of_others_cannot_become_part_of_the_page(tmp_path: Path) -> None:
    evil = '<script>alert("x")</script>&$\\alpha'
    one = flight(0, tree=f"{evil}.xml", scene=evil, outcome="collision", reason=evil, profile=evil)
    text = write(tmp_path / "r.html", jsonl(tmp_path / "f.jsonl", one)).page.read_text()
    assert "<script" not in text
    assert escape(evil) in text


def test_outcomes_come_with_their_intervals(tmp_path: Path) -> None:
    flights = [flight(seed, outcome="timeout" if seed == 0 else "success") for seed in range(20)]
    (row,) = rows_of(tmp_path, "outcomes", *flights)
    numbers = {"flights": "20", "successes": "19", "success, %": "95.0"}
    ends = {"collision": "0", "left area": "0", "timeout": "1", "aborted": "0", "error": "0"}
    assert row == {"tree": "one", **numbers, "from, %": "76.4", "to, %": "99.1", **ends}
    (row,) = rows_of(tmp_path, "outcomes", *flights[1:3])
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
    assert "c/records/a%20b.mcap" in references(written)


@pytest.mark.parametrize(
    ("changes", "how", "words"),
    [
        ({}, {"policies": {"Explore": "mine"}}, "--policy Explore=mine"),
        (
            {},
            {"exact_masks": True, "image_size_px": (160, 90)},
            "--exact-masks --profile lab --image-size 160x90",
        ),
        (
            {"drone": "plain", "vary_room": True, "movers": 1, "faults": ["wind=0.1@explore~3"]},
            {"movers": 2},
            "--drone plain --profile lab --vary-room --movers 1 --faults 'wind=0.1@explore~3'",
        ),
        (
            {"ports": {"A.b": "1 m"}, "variables": {"laps": 3}, "folder": "flights/other-name"},
            {"judge": JudgeConfig(time_limit_s=60.0), "tree_id": "Main"},
            "--set 'A.b=1 m' --var laps=3 --time-limit 60 --tree Main --out other-name",
        ),
    ],
)
def test_a_flight_is_repeated_with_what_was_drawn_and_changed_for_it(
    tmp_path: Path, changes: dict[str, Any], how: dict[str, Any], words: str
) -> None:
    folder = campaign(tmp_path / "c", flight(3, **changes), **how)
    (one,) = read_sources([folder])
    told = one.repeat_command(one.flights[0])
    assert told.startswith("uav-bt fly /missions/one.xml --scene '/labs/my lab.yaml' --seed 3 --")
    assert told.removesuffix(" --out one-val-a-3").endswith(words)


def test_events_are_given_per_hour_of_flight(tmp_path: Path) -> None:
    """Two contacts in 0.5 h: Garwood's interval of 2 is 0.2422 to 7.2247."""
    ends = ["collision", "collision", "left_area", "aborted", "aborted"]
    flights = [
        flight(n, outcome=end, duration_s=360.0, total_distance_m=20.0, on_mark=n == 4)
        for n, end in enumerate(ends)
    ]
    columns = [f"contacts{number}" for number in ("", ", rate", ", from", ", to")]
    (row,) = rows_of(tmp_path, "rates", *flights)
    assert (row["hours"], row["metres per hour"]) == ("0.5", "200")
    assert [row[name] for name in columns] == ["2", "400.0", "48.4", "1444.9"]
    assert (row["exits"], row["landings elsewhere"]) == ("1", "1")
    (none,) = rows_of(tmp_path, "rates", flights[-1])
    assert [none[name] for name in columns] == ["0", "0.0", "0.0", "2995.7"]


def test_sources_stand_side_by_side_also_under_one_name(tmp_path: Path) -> None:
    one = campaign(tmp_path / "one", *(flight(seed) for seed in range(3)))
    two = jsonl(tmp_path / "two.jsonl", flight(0), flight(1, tree="other.xml"))
    sets = read_sources([one, two, one])
    assert [item.label for item in sets] == [f"one ({one})", f"one ({two})", "other"]
    assert (sets[1].tree_path(), sets[1].scene_path("val-a")) == ("one", "val-a")
    written = write(tmp_path / "r.html", one, two)
    assert [row["flights"] for row in rows(written, "outcomes")] == ["3", "1", "1"]
    assert next(row["pairs"] for row in rows(written, "pairs")) == "1"


def test_metrics_count_the_flights_that_came_so_far(tmp_path: Path) -> None:
    """The first 90 s are those of flights that lasted so long; coverage is in percent."""
    long = flight(0, time_to_land_s=20.0, duration_s=95.0, coverage_passed=0.5)
    short = {"time_to_land_s": None, "duration_s": 22.0}
    flights = [long, *(flight(n, **short, coverage_passed=0.5 + n / 10) for n in (1, 2))]
    written = write(tmp_path / "r.html", jsonl(tmp_path / "f.jsonl", *flights))
    found = {row["metric"]: row for row in rows(written, "metrics")}
    landed = [found["time_to_land_s"][name] for name in ("flights", "mean", "5 %", "most")]
    assert landed == ["1", "20.0", "", "20.0"]
    assert (found["explore_distance_m"]["flights"], found["duration_s"]["5 %"]) == ("1", "22.0")
    covered = [found["coverage_passed"][name] for name in ("unit", "mean", "least", "most")]
    assert covered == ["%", "60.0", "50.0", "70.0"]
    assert rows(written, "flights")[0]["coverage_passed"] == "0.5", "as in the line"
    assert set(found) & {"coverage_seen", "landing_error_m"} == set()
    assert "<td>time from there to motors off" in written.page.read_text()


def panels(*flights: dict[str, Any], at: Path) -> dict[str, Any]:
    figure = plots.distributions(read_sources([jsonl(at / "f.jsonl", *flights)]))
    assert figure is not None
    return {axes.get_title(): axes for axes in figure.axes if axes.get_visible()}


def test_distributions_have_a_panel_for_each_metric_with_values(tmp_path: Path) -> None:
    """A mission without a search has a search distance of 0 m in each flight."""
    search = "distance while searching, m"
    quiet = [flight(seed, search_distance_m=0.0) for seed in range(3)]
    shown = panels(*quiet, at=tmp_path)
    assert search not in shown
    assert panels(*(flight(seed) for seed in range(3)), at=tmp_path).keys() - shown.keys() == {
        search
    }
    (line,) = shown["time to find the landing mark, s"].lines
    assert line.get_xdata().tolist() == [0.0, 0.0, 2.0, 4.0]
    assert line.get_ydata().tolist() == pytest.approx([0.0, 1 / 3, 2 / 3, 1.0])


def test_letters_of_names_are_drawn_with_a_font_that_has_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """DejaVu Sans has no circled letters; other fonts of matplotlib have them."""
    own = [font for font in fontManager.ttflist if not font.fname.startswith("/usr")]
    monkeypatch.setattr(fontManager, "ttflist", own)
    families, boxes = plots.fonts_for("a \u24b6\u63a2")
    assert len(families) == 3
    assert boxes == "\u63a2"
    notes: list[str] = []
    source = jsonl(tmp_path / "f.jsonl", flight(0, tree="\u63a2\u7d22.xml", path=None))
    write(tmp_path / "r.html", source, figures=None, drawn=True, on_note=notes.append)
    assert [note.partition(":")[0] for note in notes] == ["figures show boxes for \u63a2 \u7d22"]


def test_a_path_that_leaves_the_ground_stays_in_view(tmp_path: Path) -> None:
    """The ground is 5 m x 4 m; one flight ends at x = 3.4 m."""
    away = [[0.0, 0.0, 0.0, 1.0], [1.0, 3.4, 0.0, 1.0]]
    sets = read_sources([jsonl(tmp_path / "f.jsonl", flight(0), flight(1, path=away))])
    figure = plots.scene_figure(sets, "val-a", load_scene("val-a"))
    assert figure is not None
    for axes in figure.axes[:2]:
        assert axes.get_xlim() == pytest.approx((-3.5, 3.5))
    assert plots.scene_figure(sets, "val-b", load_scene("val-b")) is None


def test_maps_and_timings_stand_in_tables_of_their_own(tmp_path: Path) -> None:
    made: dict[str, Any] = {
        "objects_found": 2,
        "objects_total": 4,
        "object_errors_m": [0.1, 0.3],
        "object_height_errors_m": [-0.02],
        "false_objects": 1,
        "map_drift_m": 0.25,
        "map_restarts": 1,
    }
    none = {key: [] for key in ("object_errors_m", "object_height_errors_m")}
    lost = made | none | {"objects_found": 0, "map_drift_m": 0.75}
    flights = (flight(0, **made), flight(1, **lost), flight(2, tree="two.xml"))
    written = write(tmp_path / "r.html", jsonl(tmp_path / "f.jsonl", *flights))
    (row,) = rows(written, "map")
    counts = {"flights": "2", "objects found": "2", "of": "8", "found, %": "25.0"}
    errors = {"error, m: mean": "0.2", "median": "0.2", "95 %": "", "most": "0.3"}
    heights = {"heights known, %": "50.0", "height error, m: median": "0.02", "height, 95 %": ""}
    ends = {"false objects": "2", "restarts": "2"}
    assert row == {"tree": "one", **counts, **errors, **heights, **ends}
    told = {row["stage"]: row for row in rows(written, "timings") if row["tree"] == "one"}
    assert set(told) == {"whole tick", "segmentation", "flight"}
    assert told["segmentation"]["longest, ms"] == "30.0"
    assert told["flight"]["times real time"] == "5.0"


def test_flights_that_ended_before_anything_make_a_report_too(tmp_path: Path) -> None:
    bare = {"tree": "a.xml", "scene": None, "seed": 0, "outcome": "error", "reason": "crashed"}
    written = write(tmp_path / "r.html", jsonl(tmp_path / "f.jsonl", bare))
    assert not written.images
    assert "Times and distances" not in written.page.read_text()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "no flights in this folder; `uav-bt campaign` keeps them in flights.jsonl"),
        ("", "no flights; expected lines that `uav-bt campaign` wrote"),
    ],
)
def test_an_empty_folder_is_refused(tmp_path: Path, content: str | None, message: str) -> None:
    if content is not None:
        (tmp_path / "flights.jsonl").write_text(content)
    with pytest.raises(FileError, match=message):
        read_sources([tmp_path])
    folder = campaign(tmp_path / "c", planned=5)
    with pytest.raises(FileError, match=f"no flights; `uav-bt campaign --resume {folder}` flies"):
        read_sources([folder])


def test_the_origin_is_the_plan_and_its_runs(tmp_path: Path) -> None:
    params = tmp_path / "params.yaml"
    params.write_text("variants: {slow: {set: {HelipadCenter.climb_m: 0.4}}}")
    options = FlightOptions(params=params, drone="plain", faults=["random"], movers=1)
    planned = make_plan(["land_only"], options, scenes=["val-a"], flights=1)
    plain = FlightSet(label="", tree="", flights=(), path=tmp_path)
    told = origin_table(replace(plain, plan=planned, runs=[{"code": "abc"}])).rows
    expected = {"drone": "plain", "faults": "['random']", "movers": "1", "run code": "abc"}
    expected |= {"trees name": "land_only[slow].xml", "trees ports HelipadCenter.climb_m": "0.4"}
    assert expected.items() <= {str(name): text for name, text in told}.items()
    assert len(origin_table(plain).rows) == 1
