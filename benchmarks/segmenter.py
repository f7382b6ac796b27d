"""Time the segmentation U-Net as it flies: a 640x360 frame in, a class map out.

    python benchmarks/segmenter.py
    python benchmarks/segmenter.py --model runs/unet-int8.onnx --model runs/unet-fp32.onnx

Resizing, inference, and taking the best class are all in the time. The networks take turns, frame
by frame, so that other work on the machine slows all of them. With one thread the processor's own
time is told, too, which other work does not stretch.
"""

from __future__ import annotations

import argparse
import resource
import time
from pathlib import Path

import cv2
import numpy as np

from perception.segmentation.runtime import SHIPPED_UNETS, OnnxSegmenter, shipped_unet

WARM_UP = 10  # frames that are not counted


def load(name: str, threads: int) -> OnnxSegmenter:
    """Return a network by the name of a shipped one, or of a file."""
    if name in SHIPPED_UNETS:
        return shipped_unet(name, threads=threads)
    return OnnxSegmenter(Path(name), threads=threads)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--model", action="append", help="a shipped one's name or an ONNX file")
    parser.add_argument("--frames", type=int, default=300)
    arguments = parser.parse_args()
    frames = np.random.default_rng(0).integers(256, size=(8, 360, 640, 3), dtype=np.uint8)
    for threads in (1, 2):
        cv2.setNumThreads(threads)
        segmenters = {name: load(name, threads) for name in arguments.model or SHIPPED_UNETS}
        times: dict[str, list[tuple[float, float]]] = {name: [] for name in segmenters}
        for index in range(arguments.frames):
            for name, segmenter in segmenters.items():
                began = time.perf_counter(), time.thread_time()
                segmenter.ids(frames[index % len(frames)])
                took = time.perf_counter() - began[0], time.thread_time() - began[1]
                times[name].append(took)
        for name, took in times.items():
            wall, processor = 1e3 * np.array(took[WARM_UP:]).T
            p50, p99 = np.percentile(wall, [50, 99])
            own = f", processor {np.median(processor):.1f} ms" if threads == 1 else ""
            print(f"{name}, {threads} thread(s): median {p50:.1f} ms, p99 {p99:.1f} ms{own}")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"peak memory of this process {peak:.0f} MiB")


if __name__ == "__main__":
    main()
