"""The whole files that `fuzz_files.py` begins with."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from perception.networks.weights_file import SHIPPED_WEIGHTS
from sim_bridge.twin.scene_file import load_scene, scene_names, scene_text
from uav_bt import app
from uav_bt.app.options import FlightOptions
from uav_bt.campaign.plan import CampaignPlan, PlannedFile
from uav_bt.groot.btlog import BtlogWriter
from uav_bt.groot.transitions import Transition
from uav_bt.tree import NodeRegistry, Status
from uav_bt.tree.describe import palette_xml
from uav_bt.tree.loading.lookup import shipped_trees

# Two seconds that leave a message on nearly every channel.
_FLIGHT: Final = """
<root BTCPP_format="4">
  <BehaviorTree ID="Mission">
    <ReactiveSequence>
      <Segment/> <FindHelipad/> <TrackMotion/> <MapSite/>
      <EstimateDepth model="contact"/> <BuildCorridor/>
      <Sequence>
        <TakeOff height_m="0.8" gimbal_deg="-30"/>
        <Timeout msec="500"><Explore/></Timeout>
      </Sequence>
    </ReactiveSequence>
  </BehaviorTree>
</root>
"""
_SITE: Final = """\
flight_height_m: 1.2
take_off_surface_m: 0.4
network: {model: unet}
ground: [carpet, background]
limits: {speed_mps: 0.6, climb_mps: 0.5, yaw_rate_radps: 1.2, ceiling_m: 2.0}
battery: {take_off: 0.4, critical: 0.15}
link: {take_off: 0.4}
video: {latency_s: 0.2}
ports: {http: 8080, rtsp: 8554}
return_home: off
"""
_CAMERA: Final = """\
width_px: 1280
height_px: 720
K:
- [925.1, 0.0, 641.2]
- [0.0, 924.8, 358.9]
- [0.0, 0.0, 1.0]
distortion: [0.01, -0.05, 0.001, 0.0, 0.02]
forward_offset_m: 0.07
reprojection_error_px: 0.21
corners: &shape [9, 6]
images_used: *shape
"""
_MAPPING: Final = """\
input: {mean: [123.7, 116.3, 103.5], scale: [58.4, 57.1, 57.4], colours: bgr, layout: nhwc}
default: background
classes:
  0: background
  5: obstacle
  11: carpet
"""
_SCRIPT: Final = """\
leaves:
  TakeOff: RRS
  Explore: (RRS)
default: S
outputs:
  Measure: {depth_m: 1.5}
variables: {laps: 3, name: north, on: true}
board: {phase: explore}
"""
_PICKS: Final = """\
image,x,y,class,origin
a.png,10,20,carpet,hand
"b, c.png",0,719,background,simulated
"""


def _texts(name: str, text: str) -> Callable[[Path], list[Path]]:
    def write(folder: Path) -> list[Path]:
        path = folder / name
        path.write_text(text, encoding="utf-8")
        return [path]

    return write


def _trees(_: Path) -> list[Path]:
    return sorted(shipped_trees().glob("*.xml"))


def _palette(folder: Path) -> list[Path]:
    return _texts("seed.xml", palette_xml(NodeRegistry.installed()))(folder)


def _scenes(folder: Path) -> list[Path]:
    return [_texts(f"{n}.yaml", scene_text(load_scene(n)))(folder)[0] for n in scene_names()]


@functools.cache
def _record(folder: Path) -> list[Path]:
    path = folder / "seed.mcap"
    app.fly(
        _FLIGHT,
        app.FlightOptions(exact_masks=True, image_size_px=(160, 90), record=path),
    )
    return [path]


def _shipped(pattern: str) -> Callable[[Path], list[Path]]:
    return lambda _: sorted(SHIPPED_WEIGHTS.glob(pattern))


def _flights(folder: Path) -> list[Path]:
    times = {"p50": 4.1, "p99": 9.0, "max": 12.5}
    line = {
        "tree": "a.xml",
        "scene": "train-a",
        "outcome": "success",
        "reason": "landed",
        "duration_s": 61.2,
        "landing_error_m": 0.04,
        "min_clearance_m": None,
        "tick_ms": times,
        "perception_ms": {"segmentation": times},
        "path": [[0.0, 1.0, 2.0, 0.0], [0.5, 1.1, 2.0, 0.4]],
    }
    text = "".join(json.dumps({**line, "seed": seed}) + "\n" for seed in range(5))
    return _texts("seed.jsonl", text)(folder)


def _campaign(folder: Path) -> list[Path]:
    files = {
        what: (PlannedFile(name=what, path=f"/{what}", sha256="0" * 64),)
        for what in ("trees", "scenes")
    }
    options = FlightOptions(policies={"a": "b"})
    plan = CampaignPlan(**files, flights=5, weights={"unet": "1" * 64}, options=options)
    run = {"began": "2026-11-22", "host": "here"}
    content = {"format": 1, "plan": plan.to_json(), "runs": [run]}
    return _texts("seed.json", json.dumps(content))(folder)


def _btlog(folder: Path) -> list[Path]:
    path = folder / "seed.btlog"
    with BtlogWriter(path) as log:
        log.begin("<root/>", 1_000)
        statuses = list(Status)
        log.write(
            Transition(time_us=1_000 + number, uid=number % 7, status=statuses[number % 5])
            for number in range(50)
        )
    return [path]


SEEDS: Final[Mapping[str, Callable[[Path], list[Path]]]] = {
    "tree": _trees,
    "palette": _palette,
    "scene": _scenes,
    "site": _texts("seed.yaml", _SITE),
    "camera": _texts("seed.yaml", _CAMERA),
    "mapping": _texts("seed.yaml", _MAPPING),
    "script": _texts("seed.yaml", _SCRIPT),
    **dict.fromkeys(("record", "replay", "view", "film"), _record),
    "onnx": _shipped("unet.onnx"),
    "weights": _shipped("teacher.safetensors"),
    "flights": _flights,
    "campaign": _campaign,
    "btlog": _btlog,
    "picks": _texts("seed.csv", _PICKS),
}
"""By kind: what writes whole files into a folder and returns their paths, all of one suffix."""
