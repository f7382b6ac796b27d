"""Perception of whole sources: results and refused inputs."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest

from perception.camera.ground_plane import ground_depth, view_of
from perception.depth.confidence import COEFFICIENTS
from perception.segmentation.runtime import shipped_unet
from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.objects import Helipad, ObjectSpec
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.views import render_views
from tests.uav_bt.learning.frames_world import write_video
from tests.worlds.footage import camera_file, frame, state, write_record
from uav_bt.app import perceive
from uav_bt.app.perceive import PerceiveOptions, inputs
from uav_bt.errors import InputError
from uav_bt.lab.shipped import load_lab
from uav_bt.types import DepthMap, Frame
from uav_bt.types.arrays import Image

SIZE = (320, 180)
PITCH_RAD = math.radians(-30.0)
SPEED_MPS = 0.5
RATE = 10
CAMERA = anafi_camera(*SIZE)
CONTACT = PerceiveOptions(model="contact", segmentation="unet")


@pytest.fixture(scope="module")
def images() -> list[Image]:
    """Four images of a flight towards a box at half a metre a second, 1.5 m above the ground."""
    scene = Scene(
        name="small",
        helipad=Helipad(position_m=(0.3, -0.9)),
        objects=(ObjectSpec(kind="box-5", position_m=(1.0, 0.1), size_m=(0.5, 0.5, 1.9)),),
    )
    poses = [
        CameraPose(
            x_m=-1.0 + SPEED_MPS * index / RATE,
            y_m=0.0,
            z_m=1.5,
            yaw_rad=0.0,
            pitch_rad=PITCH_RAD,
        )
        for index in range(4)
    ]
    return [view.image for view in render_views(scene, poses, size_px=SIZE)]


def write_images(folder: Path, images: list[Image]) -> Path:
    folder.mkdir()
    for index, image in enumerate(images):
        assert cv2.imwrite(str(folder / f"{index}.png"), image[..., ::-1])
    return folder


def write_flight(path: Path, images: list[Image]) -> Path:
    """Write the flight's record, which begins at second 5."""
    frames = [
        frame(image, index, 5.0 + index / RATE, gimbal_pitch_rad=PITCH_RAD)
        for index, image in enumerate(images)
    ]
    states = [state(one.captured_s, SPEED_MPS) for one in frames]
    return write_record(path, CAMERA, frames, states)


def look(
    source: Path, options: PerceiveOptions = CONTACT, **outputs: Any
) -> tuple[perceive.PerceiveSummary, list[dict[str, Any]]]:
    """Return the summary, and the values of each frame."""
    lines = source.parent / "seen.jsonl"
    summary = perceive.perceive(str(source), options, lines=lines, **outputs)
    return summary, [json.loads(line) for line in lines.read_text("utf-8").splitlines()]


def classes_in(masks: Path) -> list[dict[str, Any]]:
    content = json.loads((masks / "classes.json").read_text("utf-8"))
    return list(content["classes"])


def facts(path: Path) -> tuple[tuple[int, int], list[float]]:
    with av.open(str(path)) as container:
        codec = container.streams.video[0].codec_context
        size_px = (codec.width, codec.height)
        return size_px, [float(image.time) for image in container.decode(video=0)]


def test_a_video_becomes_a_film_lines_and_a_summary(tmp_path: Path, images: list[Image]) -> None:
    source, told = write_video(tmp_path / "flight.mp4", images, rate=RATE), list[tuple[int, int]]()
    summary, lines = look(
        source,
        out=tmp_path / "seen.mp4",
        advance=lambda _text, done, total: told.append((done, total)),
    )
    assert (summary.frames, summary.without_depth, summary.interrupted) == (4, {}, False)
    assert "ANAFI" in summary.camera
    assert "assumed for all frames" in summary.telemetry
    assert [*summary.stage_ms] == ["segmentation", "metric_depth", "corridor", "mark", "all"]
    assert facts(tmp_path / "seen.mp4") == ((1280, 720), pytest.approx([0.0, 0.1, 0.2, 0.3]))
    assert told == [(1, 4), (2, 4), (3, 4), (4, 4)]
    assert [line["index"] for line in lines] == [0, 1, 2, 3]
    # The box's front is 1.75 m ahead of the lens and 1.9 m ahead of the body; the drone approaches.
    assert lines[0]["corridor"]["free_distance_m"] == pytest.approx(1.90, abs=0.12)
    assert lines[3]["corridor"]["nearest_side"] is not None
    assert lines[0]["refusal"] is None


def test_a_record_brings_its_camera_and_its_telemetry(tmp_path: Path, images: list[Image]) -> None:
    source = write_flight(tmp_path / "flight.mcap", images)
    summary, lines = look(source)
    assert summary.camera == summary.telemetry == f"of {source}"
    first = lines[0]["corridor"]
    assert first["free_distance_m"] == pytest.approx(1.90, abs=0.15)
    assert first["time_to_impact_s"] == pytest.approx((first["free_distance_m"] - 0.12) / 0.5, 0.01)


def test_a_video_is_seen_with_its_flights_telemetry(tmp_path: Path, images: list[Image]) -> None:
    source = write_video(tmp_path / "flight.mp4", images * 2, rate=RATE)
    flown = write_flight(tmp_path / "flight.mcap", images[:2])
    summary, lines = look(source, replace(CONTACT, telemetry=flown, height_m=9.0))
    assert summary.camera == f"of {flown}"
    assert lines[0]["corridor"]["free_distance_m"] == pytest.approx(1.90, abs=0.15)
    assert lines[3]["refusal"] is None, "a moment after the last entry still has telemetry"
    assert summary.without_depth == {"telemetry is not finite": 4}


def test_what_cannot_be_seen_is_counted_and_named(tmp_path: Path, images: list[Image]) -> None:
    folder = write_images(tmp_path / "views", [np.zeros_like(images[0]), images[1]])
    (folder / "2.png").write_bytes(b"no image")
    assert cv2.imwrite(str(folder / "3.png"), np.full((32, 18, 3), 90, np.uint8))
    summary, (black, seen) = look(folder)
    assert summary.frames == 2
    assert summary.without_depth == {"the frame is black": 1}
    assert summary.skipped == (
        "2.png: is not a readable image",
        "3.png: is 18x32, the first image is 320x180",
    )
    nothing = {"value": None, "reason": "the frame is black"}
    assert black["depth"] is black["corridor"] is None
    assert black["confidence"] == {"ground": nothing, "scale": nothing, "depth": nothing}
    assert seen["confidence"]["depth"]["value"] == seen["depth"]["confidence"] > 0.0
    by_contact = "the depth is by ground contact, without the network"
    assert seen["confidence"]["scale"] == {"value": None, "reason": by_contact}


class Growing:
    """A depth network, exact on the ground, whose unit doubles from frame to frame."""

    def __init__(self) -> None:
        self.unit_m = 0.5

    def estimate(self, frame: Frame) -> DepthMap:
        self.unit_m *= 2.0
        exact = ground_depth(view_of(frame, CAMERA, SIZE))
        depth = np.where(np.isfinite(exact), exact, 9.0).astype(np.float32) / self.unit_m
        return DepthMap(depth=depth, metric=False, captured_s=frame.captured_s)


@pytest.mark.parametrize("related", ["", "sequence", "telemetry", "video"])
def test_images_of_a_folder_stand_for_themselves_unless_they_are_a_sequence(
    tmp_path: Path, images: list[Image], monkeypatch: pytest.MonkeyPatch, related: str
) -> None:
    monkeypatch.setattr(inputs, "_network", lambda *_given: Growing())
    source = write_images(tmp_path / "views", images[:3])
    if related == "video":
        source = write_video(tmp_path / "flight.mp4", images[:3], rate=RATE)
    flown = write_flight(tmp_path / "flight.mcap", images[:3]) if related == "telemetry" else None
    options = PerceiveOptions(segmentation="unet", sequence=related == "sequence", telemetry=flown)
    summary, lines = look(source, options)
    factors = [row["depth"]["scale"]["factor"] for row in lines]
    confidence = lines[0]["confidence"]
    assert confidence["scale"]["value"] == confidence["depth"]["value"] > 0.5
    assert set(confidence["scale"]["measures"]) == set(COEFFICIENTS)
    assert set(confidence["ground"]["measures"]) == {"extent", "slope"}
    assert summary.unrelated == (not related)
    expected = [1.0, 1.0, 1.0] if related else [1.0, 2.0, 4.0]
    assert factors == pytest.approx(expected, rel=0.03)


def test_every_second_frame_of_the_first_moments(tmp_path: Path, images: list[Image]) -> None:
    source, out = write_video(tmp_path / "flight.mp4", images * 3, rate=RATE), tmp_path / "seen.mp4"
    masks = tmp_path / "masks"
    summary, _ = look(source, replace(CONTACT, every=2, longest_s=0.5), out=out, masks=masks)
    assert summary.frames == 3
    names = {path.name for path in masks.iterdir()}
    assert names == {"000000.png", "000002.png", "000004.png", "classes.json"}
    assert facts(out)[1] == pytest.approx([0.0, 0.2, 0.4])


def test_what_does_not_belong_together_is_refused(tmp_path: Path, images: list[Image]) -> None:
    file = camera_file(tmp_path / "camera.yaml", anafi_camera(640, 360))
    whole, half = (
        write_flight(tmp_path / f"{count}.mcap", images[:count]) for count in (len(images), 2)
    )
    folder = write_images(tmp_path / "views", images)
    assert look(folder, replace(CONTACT, camera=file))[0].camera == f"of {file}"
    assert look(folder, replace(CONTACT, telemetry=whole))[0].without_depth == {}
    other = {
        "camera": camera_file(
            tmp_path / "other.yaml", replace(anafi_camera(640, 360), height_px=480)
        )
    }
    cropped = write_images(tmp_path / "cropped", [image[:, 40:280] for image in images])
    square = write_images(tmp_path / "square", [np.full((240, 320, 3), 90, np.uint8)])
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "a.png").write_bytes(b"no image")
    cases: list[tuple[Path, dict[str, Path], str]] = [
        (folder, other, "calibrated at 640x480, the images are 320x180"),
        (folder, {"telemetry": half}, "2, as many as the telemetry has entries, got 4"),
        (cropped, {"telemetry": whole}, "whole, not cropped"),
        (square, {}, r"320x240 \(aspect 1.333\).*`uav-bt lab calibrate.*--camera"),
        (whole, {"camera": file}, "knows its own camera"),
        (tmp_path / "broken", {}, r"can be read: a\.png: is not a readable"),
    ]
    for source, given, problem in cases:
        with pytest.raises(InputError, match=problem):
            look(source, replace(CONTACT, **given))  # type: ignore[arg-type]


def test_masks_are_class_ids_by_the_names_of_images(tmp_path: Path, images: list[Image]) -> None:
    folder = write_images(tmp_path / "views", images[:2])
    (folder / "0.png").rename(folder / "a b.png")
    assert cv2.imwrite(str(folder / "a b.jpg"), images[0][..., ::-1])
    masks = tmp_path / "new" / "masks"
    perceive.perceive(str(folder), CONTACT, masks=masks)
    names = {path.name for path in masks.iterdir()}
    assert names == {"1.png", "a b.png", "a b.png.png", "classes.json"}
    segmenter = shipped_unet()
    for name, index in (("1.png", 1), ("a b.png.png", 0)):
        ids = cv2.imread(str(masks / name), cv2.IMREAD_UNCHANGED)
        assert (ids == segmenter.ids(images[index])).all()
        assert (ids.dtype, ids.ndim) == (np.uint8, 2)
    classes, listed = load_lab().classes, classes_in(masks)
    assert [one["name"] for one in listed] == list(classes.names)
    assert [one["id"] for one in listed] == list(range(len(classes)))
    assert listed[classes.ground]["role"] == "ground"
    assert listed[classes.ground]["rgb"] == classes.colours[classes.ground].tolist()


def test_no_output_overwrites_a_network(tmp_path: Path, images: list[Image]) -> None:
    folder, network = write_images(tmp_path / "views", images[:1]), tmp_path / "net.onnx"
    network.write_bytes(b"a network")
    with pytest.raises(InputError, match="is an input and would be overwritten"):
        look(folder, replace(CONTACT, segmentation=str(network)), out=network)
    assert network.read_bytes() == b"a network"


def test_only_photographs_are_perceived_by_roles(tmp_path: Path, images: list[Image]) -> None:
    folder = write_images(tmp_path / "views", images[:1])
    flown = write_flight(tmp_path / "flight.mcap", images[:1])
    for source, ground in ((folder, "ground"), (flown, "carpet")):
        masks = tmp_path / source.stem
        perceive.perceive(str(source), PerceiveOptions(), masks=masks / "masks")
        assert ground in [one["name"] for one in classes_in(masks / "masks")]
