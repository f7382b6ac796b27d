"""Runs a command with the kernels of an older x86-64 processor, which round differently.

`python tools/kernels.py baseline -- pytest -m flight` on a processor with AVX2, `avx2` in place of
`baseline` on one with AVX-512. Where the processor has nothing newer, the command does not run.
"""

import argparse
import os
import re

import cv2
import numpy as np

NEWER = {  # features, by the first letters that NumPy or OpenCV gives them
    "avx2": ("AVX512", "X86_V4"),
    "baseline": ("AVX", "F16C", "FMA", "FP16", "X86_V3", "X86_V4"),
}
SETTINGS = {  # without NUMBA_CPU_FEATURES Numba uses all features of the processor
    "avx2": "OPENBLAS_CORETYPE=Haswell NUMBA_CPU_NAME=haswell NUMBA_CPU_FEATURES= "
    "ONEDNN_MAX_CPU_ISA=AVX2 OPENCV_IPP=avx2",
    "baseline": "OPENBLAS_CORETYPE=Nehalem NUMBA_CPU_NAME=nehalem NUMBA_CPU_FEATURES= "
    "ONEDNN_MAX_CPU_ISA=AVX OPENCV_IPP=sse42 GLIBC_TUNABLES=glibc.cpu.hwcaps=-FMA",
}


def variables(kernels: str) -> dict[str, str]:
    """Return the variables that choose kernels; none if the processor has nothing newer."""
    of_numpy = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    of_opencv = re.findall(r"\*([A-Z0-9-]+)(?= |$)", cv2.getCPUFeaturesLine())  # "?": it lacks it
    numpy, opencv = (
        [name for name in found if name.startswith(NEWER[kernels])]
        for found in (of_numpy, of_opencv)
    )
    settings = dict(pair.split("=", 1) for pair in SETTINGS[kernels].split())
    # What this process must already do without stays off in the command.
    numpy_off, opencv_off = map(os.environ.get, ("NPY_DISABLE_CPU_FEATURES", "OPENCV_CPU_DISABLE"))
    settings["NPY_DISABLE_CPU_FEATURES"] = " ".join([*(numpy_off or "").split(), *numpy])
    settings["OPENCV_CPU_DISABLE"] = ",".join([*filter(None, [opencv_off]), *opencv])
    return settings if numpy else {}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("kernels", choices=NEWER)
    parser.add_argument("command", nargs="+", help='after "--"')
    given = parser.parse_args()
    chosen = variables(given.kernels)
    if not chosen:
        print(f"this processor has nothing newer than {given.kernels}: the command is not run")
        raise SystemExit
    print(*(f"{name}={value}" for name, value in chosen.items()), flush=True)
    os.execvpe(given.command[0], given.command, {**os.environ, **chosen})  # noqa: S606
