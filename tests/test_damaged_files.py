"""Damaged files: each reader accepts a file or refuses it with one of our errors."""

from __future__ import annotations

import contextlib
import json
import random
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from perception.camera.camera_file import load_camera
from perception.segmentation.mapping import read_mapping
from sim_bridge.twin.scene_file import load_scene, scene_text
from tests.paper_lab import CLASSES
from uav_bt import app
from uav_bt.app.options import FlightOptions
from uav_bt.app.site import load_site
from uav_bt.campaign.flight_lines import read_flights
from uav_bt.campaign.plan import CampaignPlan, PlannedFile, PlannedTree
from uav_bt.campaign.store import PLAN_FILE, read_plan
from uav_bt.errors import InputError
from uav_bt.record.channels import CHANNELS, START
from uav_bt.record.info import record_info
from uav_bt.record.reader import RecordReader
from uav_bt.record.record_file import RecordFile
from uav_bt.tree.dry_run.script_file import read_script
from uav_bt.tree.loading.loader import check_file
from uav_bt.tree.loading.parameter_file import read_parameters
from uav_bt.tree.shipped import resolve_tree

SITE: Final = """\
{flight_height_m: 1.2, network: {model: unet}, ground: [carpet, background], return_home: off,
limits: {speed_mps: 0.6, climb_mps: 0.5}, battery: {take_off: 0.4}, ports: {http: 8080}}"""
CAMERA: Final = """\
{width_px: 1280, height_px: 720, distortion: [0.01, -0.05, 0.001, 0.0, 0.02], forward_offset_m: 0.1,
K: [[925.1, 0.0, 641.2], [0.0, 924.8, 358.9], [0.0, 0.0, 1.0]],
reprojection_error_px: 0.21, corners: &shape [9, 6], images_used: *shape}"""
MAPPING: Final = """\
input: {mean: [123.7, 116.3, 103.5], scale: [58.4, 57.1, 57.4], colours: bgr, layout: nhwc}
classes: {0: background, 5: obstacle, 11: carpet}"""
SCRIPT: Final = """\
{leaves: {TakeOff: RRS, Explore: (RRS)}, default: S, outputs: {Measure: {depth_m: 1.5}},
variables: {laps: 3, name: north, on: true}}"""
PARAMETERS: Final = """\
{set: {TakeOff.height_m: 1.2}, var: {laps: 3, name: north},
variants: {slow: {var: {laps: 2}}, fast: {set: {Explore.flowing: true}}}}"""
FLIGHT: Final = (
    '{"tree": "a", "seed": 3, "outcome": "success", "tick_ms": {"p50": 4.1, "p99": 9.0, "max": 12},'
    ' "min_clearance_m": null, "path": [[0.0, 1.0, 2.0, 0.0]]}'
)
FILE: Final = {"name": "a", "path": "/a", "sha256": "0" * 64}
TREES: Final = (PlannedTree(**FILE, ports={"TakeOff.height_m": "1.2"}),)
SCENES: Final = (PlannedFile(**FILE),)
OPTIONS: Final = FlightOptions(policies={"a": "b"})
PLANS: Final = CampaignPlan(trees=TREES, scenes=SCENES, flights=5, options=OPTIONS).to_json()
PLAN: Final = json.dumps({"format": 1, "plan": PLANS, "runs": [{"began": "now", "host": "here"}]})


def read_campaign(path: Path) -> None:
    path.rename(path.with_name(PLAN_FILE))
    read_plan(path.parent)


def read_record(path: Path) -> None:
    record_info(path)
    for moment in RecordReader(path).moments():
        if moment.frame is not None and moment.frame.image is not None:
            moment.frame.frame()


# For each kind: the reader, the suffix, and an intact file.
TEXTS: Final[dict[str, tuple[Callable[[Path], Any], str, str]]] = {
    "tree": (check_file, ".xml", resolve_tree("survey_and_land").read_text(encoding="utf-8")),
    "scene": (load_scene, ".yaml", scene_text(load_scene("train-a"))),
    "site": (load_site, ".yaml", SITE),
    "camera": (load_camera, ".yaml", CAMERA),
    "mapping": (partial(read_mapping, classes=CLASSES), ".yaml", MAPPING),
    "parameters": (read_parameters, ".yaml", PARAMETERS),
    "script": (read_script, ".yaml", SCRIPT),
    "flights": (read_flights, ".jsonl", FLIGHT),
    "campaign": (read_campaign, ".json", PLAN),
}
WORDS: Final = b"\0 -1 1e999 nan null [] {} '' *a &a !!int <!-- x".split()
LONG: Final = (b"", b"9" * 5000, b"[" * 500, b"<a>" * 200)
DAMAGE: Final = st.binary(max_size=8) | st.sampled_from([*WORDS, *LONG])
# A position as a share of the file's length, the bytes removed there, and the bytes inserted.
Edit = tuple[float, int, bytes]
EDITS: Final = st.lists(st.tuples(st.floats(0, 1), st.integers(0, 40), DAMAGE), min_size=1)
VALUES: Final = st.sampled_from([None, True, -1, 2**63, 1e308, "", "x" * 10_000, [], [None], {}])
# The same damage in every run.
SAME: Final = settings(
    derandomize=True,
    database=None,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)


def edited(data: bytes, edits: list[Edit]) -> bytes:
    for share, dropped, put in edits:
        at = round(share * len(data))
        data = data[:at] + put + data[at + dropped :]
    return data


def read_or_refuse(read: Callable[[Path], Any], path: Path, data: bytes) -> None:
    path.write_bytes(data)
    with contextlib.suppress(InputError):
        read(path)


def with_wrong_value(whole: str | bytes, seed: int, value: object) -> bytes:
    """Return JSON with one value, at any depth, replaced."""
    content, rng = json.loads(whole), random.Random(seed)  # noqa: S311 - reproducible, no secret
    inner = content
    while True:
        key = rng.choice(list(inner) if isinstance(inner, dict) else range(len(inner)))
        if not (inner[key] and isinstance(inner[key], (dict, list)) and rng.random() < 0.7):
            inner[key] = value
            return json.dumps(content).encode() + b"\n"
        inner = inner[key]


@pytest.mark.parametrize("kind", TEXTS)
def test_whole_files_are_read(kind: str, tmp_path: Path) -> None:
    """The intact files are valid; otherwise the damage would not be the reason of a refusal."""
    read, suffix, text = TEXTS[kind]
    path = tmp_path / f"whole{suffix}"
    path.write_text(text, encoding="utf-8")
    read(path)


@pytest.mark.parametrize("kind", TEXTS)
@given(edits=EDITS)
@settings(SAME, max_examples=40)
def test_damaged_texts_are_read_or_refused(kind: str, tmp_path: Path, edits: list[Edit]) -> None:
    read, suffix, text = TEXTS[kind]
    read_or_refuse(read, tmp_path / f"damaged{suffix}", edited(text.encode(), edits))


@pytest.mark.parametrize("kind", ["flights", "campaign"])
@given(seed=st.integers(0, 2**32), value=VALUES)
@settings(SAME, max_examples=60)
def test_whole_json_with_wrong_values_is_read_or_refused(
    kind: str, tmp_path: Path, seed: int, value: object
) -> None:
    read, suffix, text = TEXTS[kind]
    read_or_refuse(read, tmp_path / f"damaged{suffix}", with_wrong_value(text, seed, value))


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a record with a message on nearly every channel."""
    path = tmp_path_factory.mktemp("whole") / "whole.mcap"
    leaves = "<Segment/><FindMark/><TrackMotion/><MapSite/><TakeOff/>"
    body = f'<BehaviorTree ID="A"><ReactiveSequence>{leaves}</ReactiveSequence></BehaviorTree>'
    tree = f'<root BTCPP_format="4">{body}</root>'
    app.fly(tree, app.FlightOptions(exact_masks=True, image_size_px=(64, 36), record=path))
    read_record(path)
    return path


@given(edits=EDITS)
@settings(SAME, max_examples=25)
def test_damaged_records_read_or_refused(record: Path, tmp_path: Path, edits: list[Edit]) -> None:
    read_or_refuse(read_record, tmp_path / "a.mcap", edited(record.read_bytes(), edits))


@given(topic=st.sampled_from(sorted(CHANNELS)), seed=st.integers(0, 2**32), value=VALUES)
@settings(SAME, max_examples=40)
def test_whole_records_with_wrong_messages_are_read_or_refused(
    record: Path, tmp_path: Path, topic: str, seed: int, value: object
) -> None:
    """The checksums are right, and the first JSON message of a channel has a wrong value."""
    path, reader, changed = tmp_path / "damaged.mcap", RecordReader(record), False
    file = RecordFile(path)
    file.metadata(START, reader.metadata)
    for message in reader.messages(to_s=2.0):
        data = message.data
        if message.topic == topic and data[:1] == b"{" and not changed:
            data, changed = with_wrong_value(data, seed, value), True
        file.write(CHANNELS[message.topic], message.time_ns, data)
    file.finish()
    read_or_refuse(read_record, path, path.read_bytes())
