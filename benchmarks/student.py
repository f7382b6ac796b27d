"""Time and size of control students: three views and the movements between them in, a decision out.

    python benchmarks/student.py
    python benchmarks/student.py --model runs/student.onnx --model runs/student-int8.onnx

What is timed is a decision of the policy on a new 640x360 frame: shrinking it, and the network on
all views. The networks take turns, so that other work on the machine slows all of them. The
processor's own time is told, too, which other work does not stretch; with two threads it is that
of both. Operations are the multiplications of convolutions and dense layers. Memory is what the
process has grown by when the network has answered for the first time; networks after the first
share what the runtime needs anyway.
"""

from __future__ import annotations

import argparse
import math
import resource
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import onnx

from perception.control.runtime import SHIPPED_STUDENT, OnnxControlStudent
from perception.control.situation import situation_size

WARM_UP = 10  # decisions that are not counted


def multiplications(path: Path) -> int:
    """Return how many products one decision takes, by the shapes in the file."""
    model = onnx.shape_inference.infer_shapes(onnx.load(path))
    graph = model.graph
    shapes = {
        value.name: tuple(size.dim_value for size in value.type.tensor_type.shape.dim)
        for value in (*graph.input, *graph.value_info, *graph.output)
    }
    shapes |= {constant.name: tuple(constant.dims) for constant in graph.initializer}
    total = 0
    for node in graph.node:
        if node.op_type == "Conv":
            total += math.prod(shapes[node.output[0]]) * math.prod(shapes[node.input[1]][1:])
        elif node.op_type == "Gemm":
            total += shapes[node.output[0]][0] * math.prod(shapes[node.input[1]])
    return total


def parameters(path: Path) -> int:
    """Return how many numbers the network learnt, its batch norms folded in."""
    arrays = (constant for constant in onnx.load(path).graph.initializer)
    kinds = (onnx.TensorProto.FLOAT, onnx.TensorProto.INT8)
    return sum(math.prod(one.dims) for one in arrays if one.data_type in kinds and one.dims)


def decisions(student: OnnxControlStudent, frames: np.ndarray) -> Iterator[tuple[float, float]]:
    """Decide on frame after frame; yield the wall's and the processor's time of each, seconds."""
    views = student.config.views
    numbers = np.zeros(situation_size(views), dtype=np.float32)
    pictures = [student.looked_at(frame) for frame in frames[:views]]
    at = 0
    while True:
        began = time.perf_counter(), time.process_time()
        pictures = [student.looked_at(frames[at % len(frames)]), *pictures[: views - 1]]
        student.estimate(pictures, numbers)
        yield time.perf_counter() - began[0], time.process_time() - began[1]
        at += 1


def main() -> None:
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--model", action="append", type=Path, help="an ONNX file; repeatable")
    parser.add_argument("--decisions", type=int, default=300)
    arguments = parser.parse_args()
    paths = arguments.model or [SHIPPED_STUDENT]
    frames = np.random.default_rng(0).integers(256, size=(8, 360, 640, 3), dtype=np.uint8)
    print("| network | parameters | MB | million products | threads | ms, median | p99 |", end="")
    print(" processor ms | MiB more |\n|---|---|---|---|---|---|---|---|---|")
    for threads in (1, 2):
        cv2.setNumThreads(threads)
        runs, grown = {}, {}
        for path in paths:
            before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
            runs[path] = decisions(OnnxControlStudent(path, threads=threads), frames)
            next(runs[path])
            grown[path] = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
        took = {path: [] for path in paths}
        for _ in range(WARM_UP + arguments.decisions):
            for path in paths:
                took[path].append(next(runs[path]))
        for path in paths:
            wall, processor = 1e3 * np.array(took[path][WARM_UP:]).T
            p50, p99 = np.percentile(wall, [50, 99])
            print(
                f"| {path.stem} | {parameters(path):,} | {path.stat().st_size / 1e6:.2f} | "
                f"{multiplications(path) / 1e6:.0f} | {threads} | {p50:.1f} | {p99:.1f} | "
                f"{np.median(processor):.1f} | {grown[path]:.0f} |"
            )


if __name__ == "__main__":
    main()
