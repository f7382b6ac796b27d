"""A reader of each kind of file, with an intact file."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import cv2
import numpy as np

from perception.camera.camera_file import load_camera
from perception.camera.image_files import exif_orientation, read_image
from perception.control.runtime import OnnxControlStudent
from perception.control.training.network import STUDENT_FILES
from perception.control.training.samples import ControlFlight, read_flight, write_flight
from perception.depth.runtime import load_depth_estimator
from perception.depth.training.labelling import read_labels, write_labels
from perception.networks.mapping import read_mapping
from perception.networks.weights_file import SHIPPED_WEIGHTS
from perception.segmentation.runtime import load_segmenter
from perception.segmentation.teacher import load_teacher
from perception.segmentation.training.picks import read_picks
from sim_bridge.twin.scene_file import load_scene, scene_text
from tests.paper_lab import CLASSES
from tests.uav_bt.learning.frames_world import view, write_video
from uav_bt import app
from uav_bt.app.option_values import fault_texts
from uav_bt.app.options import FlightOptions
from uav_bt.app.site import load_site
from uav_bt.app.sources.by_name import open_source
from uav_bt.campaign.plan import CampaignPlan, PlannedFile
from uav_bt.campaign.store import PLAN_FILE, read_flights, read_plan
from uav_bt.lab.lab_file import read_lab
from uav_bt.lab.obj_file import read_obj
from uav_bt.lab.shipped import load_lab
from uav_bt.lab.surface import check_picture
from uav_bt.learning.lab_material import LabMaterial
from uav_bt.record.info import record_info
from uav_bt.record.reader import RecordReader
from uav_bt.tree import NodeRegistry, load_tree
from uav_bt.tree.dry_run import read_script
from uav_bt.tree.loading.models import with_palette
from uav_bt.tree.loading.parameter_file import read_parameters
from uav_bt.tree.shipped import resolve_tree

DEPOT: Final = load_lab("depot")
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
PLAN: Final = CampaignPlan(
    trees=(PlannedFile(**FILE, ports={"TakeOff.height_m": "1.2"}),),
    scenes=(PlannedFile(**FILE),),
    flights=5,
    options=FlightOptions(policies={"a": "b"}),
)
PALETTE: Final = """\
<root BTCPP_format="4"><TreeNodesModel><Action ID="Grip"><input_port name="force" type="double"
default="1.5"/></Action><Condition ID="Held"/></TreeNodesModel></root>"""
VISIT: Final = """\
<root BTCPP_format="4"><BehaviorTree ID="Visit"><LoopString queue="file:{}" value="{{at}}">
<Face at="{{at}}"/></LoopString></BehaviorTree></root>"""
PICKS: Final = f"image,x,y,class,origin\na.png,3,4,{CLASSES.names[1]},hand\n"
FRAMES: Final = "image,source,time_s,sharpness,use\na.png,v.mp4,0.0,1.0,train\n"


def read_record(path: Path) -> None:
    record_info(path)
    for moment in RecordReader(path).moments():
        if moment.frame is not None and moment.frame.image is not None:
            moment.frame.frame()


def read_places(path: Path) -> None:
    tree = path.with_suffix(".xml")
    tree.write_text(VISIT.format(path.name), encoding="utf-8")
    load_tree(tree)


def read_pixels(path: Path) -> None:
    exif_orientation(path)
    read_image(path, colour=True, as_stored=False)


def read_video(path: Path) -> None:
    list(open_source(str(path)).images())


def image(suffix: str) -> bytes:
    """Return an image file of noise."""
    pixels = np.random.default_rng(0).integers(0, 256, (20, 30, 3), np.uint8)
    return bytes(cv2.imencode(suffix, pixels)[1])


def write_views(path: Path) -> None:
    views = np.zeros((1, 2, 4), np.float32)
    write_flight(
        path,
        ControlFlight(
            images=np.frombuffer(image(".jpg"), np.uint8),
            ends=np.array([1]),
            poses=np.zeros((1, 4)),
            ego=np.zeros((1, 4)),
            labels=views,
        ),
    )


def write_film(path: Path) -> None:
    write_video(path, [view(place) for place in range(4)])


@cache
def record() -> bytes:
    """Return a record with a message on nearly every channel."""
    leaves = "<Segment/><FindMark/><TrackMotion/><MapSite/><TakeOff/>"
    body = f'<BehaviorTree ID="A"><ReactiveSequence>{leaves}</ReactiveSequence></BehaviorTree>'
    tree = f'<root BTCPP_format="4">{body}</root>'
    with TemporaryDirectory() as made:
        path = Path(made) / "a.mcap"
        app.fly(tree, app.FlightOptions(exact_masks=True, image_size_px=(64, 36), record=path))
        return path.read_bytes()


def write_depot(path: Path) -> None:
    """Write a lab file with the pictures and meshes that it names."""
    for name in ("lab.yaml", "crate.jpg", "barrier.obj"):
        shutil.copy(DEPOT.folder / name, path.parent)


@dataclass(frozen=True)
class Reader:
    """A reader, the name of its file, and an intact file: its content, or a function to write it.

    `fits` are damages that leave a valid file: no list, no line.
    """

    read: Callable[[Path], object]
    name: str
    intact: str | bytes | Callable[[Path], object]
    fits: tuple[str, ...] = ()

    def write(self, folder: Path) -> Path:
        path = folder / self.name
        path.parent.mkdir(exist_ok=True)
        if callable(self.intact):
            self.intact(path)
        else:
            path.write_bytes(self.intact.encode() if isinstance(self.intact, str) else self.intact)
        return path


def shipped(name: str) -> bytes:
    return (SHIPPED_WEIGHTS / name).read_bytes()


TEXTS: Final = {
    "tree": Reader(load_tree, "a.xml", resolve_tree("survey_and_land").read_text("utf-8")),
    "palette": Reader(partial(with_palette, NodeRegistry()), "a.xml", PALETTE),
    "scene": Reader(load_scene, "a.yaml", scene_text(load_scene("train-a"))),
    "lab": Reader(lambda path: read_lab(path.parent), "lab.yaml", write_depot),
    "site": Reader(load_site, "a.yaml", SITE, fits=("empty",)),
    "camera": Reader(load_camera, "a.yaml", CAMERA),
    "mapping": Reader(lambda path: read_mapping(path, CLASSES), "a.yaml", MAPPING),
    "parameters": Reader(read_parameters, "a.yaml", PARAMETERS, fits=("empty",)),
    "script": Reader(read_script, "a.yaml", SCRIPT),
    "places": Reader(read_places, "a.txt", "start:2,0\nmark@90\n"),
    "table of places": Reader(read_places, "a.csv", "frame,x,y\nstart,2,0\n"),
    "faults": Reader(
        lambda path: fault_texts([f"@{path}"]), "a.txt", "video-lost@explore+1~3\n", fits=("empty",)
    ),
    "picks": Reader(lambda path: read_picks(path, CLASSES), "a.csv", PICKS),
    "list of images": Reader(
        lambda path: LabMaterial(lab=replace(DEPOT, folder=path.parent.parent)).read_frames(),
        "frames/frames.csv",
        FRAMES,
        fits=("absent", "empty"),
    ),
    "mesh": Reader(
        lambda path: read_obj(path, (1.0, 1.0, 1.0)),
        "a.obj",
        (DEPOT.folder / "barrier.obj").read_bytes(),
    ),
    "flights": Reader(read_flights, "a.jsonl", FLIGHT, fits=("empty",)),
    "campaign": Reader(
        lambda path: read_plan(path.parent),
        PLAN_FILE,
        json.dumps(
            {"format": 1, "plan": PLAN.to_json(), "runs": [{"began": "now", "host": "here"}]}
        ),
    ),
}
BINARIES: Final = {
    "record": Reader(read_record, "a.mcap", lambda path: path.write_bytes(record())),
    "PNG": Reader(read_pixels, "a.png", image(".png")),
    "picture": Reader(check_picture, "a.jpg", (DEPOT.folder / "crate.jpg").read_bytes()),
    "JPEG": Reader(read_pixels, "a.jpg", image(".jpg")),
    "video": Reader(read_video, "a.mp4", write_film),
    "labels": Reader(
        read_labels,
        "a.npz",
        lambda path: write_labels(path, np.ones((2, 2, 4, 6), np.float16)),
    ),
    "views": Reader(read_flight, "a.npz", write_views),
    "teacher": Reader(
        lambda path: load_teacher(path, CLASSES),
        "a.safetensors",
        shipped("teacher.safetensors"),
    ),
    "weights": Reader(
        STUDENT_FILES.load,
        "a.safetensors",
        shipped("student.safetensors"),
    ),
    "U-Net": Reader(
        partial(load_segmenter, classes=CLASSES),
        "a.onnx",
        shipped("unet.onnx"),
    ),
    "any": Reader(partial(load_segmenter, classes=CLASSES), "a.onnx", shipped("any.onnx")),
    "depth network": Reader(
        load_depth_estimator,
        "a.onnx",
        shipped("depth.onnx"),
    ),
    "student": Reader(
        OnnxControlStudent,
        "a.onnx",
        shipped("student.onnx"),
    ),
}
READERS: Final = {**TEXTS, **BINARIES}
