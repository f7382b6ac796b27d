"""`tools/kernels.py`: a command runs with the kernels of an older processor."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
SHOWN = """
import json, re
import cv2, numpy as np
from numba.core.registry import cpu_target
numpy = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
opencv = re.findall(r"[*]([A-Z0-9-]+)(?= |$)", cv2.getCPUFeaturesLine())
numba = cpu_target.target_context.codegen().magic_tuple()[1:]
print(json.dumps([numpy, opencv, numba]))
"""


def run(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(  # noqa: S603  # our own script
        [sys.executable, "tools/kernels.py", *words],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
    )


@pytest.mark.parametrize(
    ("kernels", "newer", "processor"),
    [("avx2", ("AVX512", "X86_V4"), "haswell"), ("baseline", ("AVX", "X86_V3"), "nehalem")],
)
def test_all_libraries_take_older_kernels(
    kernels: str, newer: tuple[str, ...], processor: str
) -> None:
    """A warning, such as NumPy's about a feature that it cannot disable, would be an error."""
    done = run(kernels, "--", sys.executable, "-W", "error", "-c", SHOWN)
    assert (done.returncode, done.stderr) == (0, "")
    here = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    if not any(name.startswith(newer) for name in here):
        assert f"nothing newer than {kernels}" in done.stdout
        return
    numpy, opencv, numba = json.loads(done.stdout.splitlines()[-1])
    assert [name for name in (*numpy, *opencv) if name.startswith(newer)] == []
    assert numba == [processor, ""]


def test_the_exit_code_is_the_commands() -> None:
    done = run("baseline", "--", sys.executable, "-c", "raise SystemExit(3)")
    assert done.returncode == (3 if "OPENBLAS_CORETYPE=Nehalem" in done.stdout else 0)
