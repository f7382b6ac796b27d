"""Time the segmentation U-Net as it flies: a 640x360 frame in, a class map out.

    python benchmarks/segmenter.py

Resizing, inference, and taking the best class are all in the time.
"""

from __future__ import annotations

import argparse
import resource
import time
from pathlib import Path

import numpy as np

from perception.segmentation.runtime import OnnxSegmenter
from perception.weights_io import SHIPPED_WEIGHTS


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--model", type=Path, default=SHIPPED_WEIGHTS / "unet.onnx")
    parser.add_argument("--frames", type=int, default=300)
    arguments = parser.parse_args()
    frames = np.random.default_rng(0).integers(256, size=(8, 360, 640, 3), dtype=np.uint8)
    for threads in (1, 2):
        began = time.perf_counter()
        segmenter = OnnxSegmenter(arguments.model, threads=threads)
        loaded = time.perf_counter() - began
        times = []
        for index in range(arguments.frames):
            began = time.perf_counter()
            segmenter.ids(frames[index % len(frames)])
            times.append(1e3 * (time.perf_counter() - began))
        p50, p99 = np.percentile(times[10:], [50, 99])
        print(
            f"{threads} thread(s): median {p50:.1f} ms, p99 {p99:.1f} ms a frame; "
            f"loading {loaded:.2f} s"
        )
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"peak memory of this process {peak:.0f} MiB")


if __name__ == "__main__":
    main()
