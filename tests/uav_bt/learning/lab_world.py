"""A small drawn lab: blue wall, green floor and a red crate, with picks on its images."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from perception.segmentation.training.picks import Pick, write_picks
from uav_bt.lab.shipped import load_lab
from uav_bt.learning.lab_material import LabFrame, LabMaterial, Use

LAB = """\
version: 1
classes:
  wall: {role: outside, colour: "#202040"}
  floor: {role: ground, colour: "#0a0b0c"}
  crate: {role: obstacle, colour: "#ff0000"}
  cart: {role: obstacle, colour: "#800000"}
"""
WIDTH, HEIGHT = 256, 144
WALL, FLOOR, CRATE = range(3)
COLOURS = np.array([(30, 40, 200), (30, 180, 40), (210, 40, 30)], dtype=np.uint8)


def draw_lab(folder: Path, *, train: int = 6, check: int = 2) -> LabMaterial:
    """Write a lab with images for training and for checks, and picks on all of them."""
    folder.mkdir(parents=True)
    (folder / "lab.yaml").write_text(LAB)
    material = LabMaterial(lab=load_lab(folder / "lab.yaml"))
    material.frames.mkdir()
    rng = np.random.default_rng(0)
    frames, picks = [], []
    for index in range(train + check):
        name, left = f"hall-{index:03d}.png", 40 + 12 * index
        rgb = COLOURS[exact_ids(left)] + rng.integers(0, 12, (HEIGHT, WIDTH, 3), dtype=np.uint8)
        cv2.imwrite(str(material.frames / name), rgb[..., ::-1])
        use: Use = "train" if index < train else "check"
        frames.append(LabFrame(image=name, source="x.mp4", use=use))
        places = [(20, 20, WALL), (230, 30, WALL), (15, 120, FLOOR), (240, 130, FLOOR)]
        places += [(left + 15, 70, CRATE), (left + 35, 90, CRATE)]
        picks += [Pick(image=name, x=x, y=y, class_id=class_id) for x, y, class_id in places]
    material.write_frames(frames)
    write_picks(material.picks, picks, material.lab.classes)
    return material


def exact_ids(left_px: int) -> NDArray[np.uint8]:
    """Return the exact class ids of an image whose crate begins at a column."""
    ids = np.full((HEIGHT, WIDTH), WALL, dtype=np.uint8)
    ids[HEIGHT // 2 :] = FLOOR
    ids[50:110, left_px : left_px + 50] = CRATE
    return ids


def write_colour_network(path: Path, order: tuple[int, ...] = (2, 1, 0, 3)) -> Path:
    """Write an ONNX network that scores each class by one colour of the pixel.

    `order` has a channel for each class, red 0, green 1, blue 2; 3: the class never wins.
    """
    weights = np.zeros((len(order), 3, 1, 1), dtype=np.float32)
    bias = np.zeros(len(order), dtype=np.float32)
    for class_id, channel in enumerate(order):
        if channel < 3:
            weights[class_id, channel] = 1.0
        else:
            bias[class_id] = -5.0
    graph = helper.make_graph(
        [helper.make_node("Conv", ["image", "w", "b"], ["logits"])],
        "colours",
        [helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 3, 112, 224])],
        [helper.make_tensor_value_info("logits", TensorProto.FLOAT, [1, len(order), 112, 224])],
        [numpy_helper.from_array(weights, "w"), numpy_helper.from_array(bias, "b")],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    onnx.save(model, path)
    return path
