"""Tools of the repository: installation and kernels."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.worlds.processes import ROOT, python

# --- kernels --------------------------------------------------------------------------------------


def install(venv: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(  # noqa: S603  # our own script
        ["/bin/sh", "tools/install.sh", str(venv)],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
    )


def test_an_unusable_python_is_refused_by_name(tmp_path: Path) -> None:
    done = install(tmp_path / "venv", PYTHON="/no/such/python")
    assert done.returncode == 2
    assert "PYTHON=/no/such/python is no Python 3.11 or later" in done.stderr
    assert not (tmp_path / "venv").exists()


def test_no_python_at_all_says_what_to_install(tmp_path: Path) -> None:
    done = install(tmp_path / "venv", PYTHON="", PATH=str(tmp_path))
    assert done.returncode == 2
    assert "needs Python 3.11 or later, found: none" in done.stderr
    assert "apt install python3" in done.stderr


def test_the_newest_supported_python_is_taken(tmp_path: Path) -> None:
    tools = tmp_path / "bin"
    tools.mkdir()
    for version in ("3.11", "3.12", "3.13"):
        fake = tools / f"python{version}"
        # A pyenv shim exists for versions that are not installed: every call of it fails.
        answer = "exit 127" if version == "3.13" else f'echo "Python {version}.0"; exit 0'
        fake.write_text(f"#!/bin/sh\n{answer}\n", encoding="utf-8")
        fake.chmod(0o755)
    done = install(tmp_path / "venv", PYTHON="", PATH=f"{tools}:/usr/bin:/bin")
    assert "with Python 3.12.0" in done.stderr


def test_an_index_out_of_reach_is_reported_and_a_further_try_goes_on(tmp_path: Path) -> None:
    away = {"PIP_NO_INDEX": "1", "PIP_CONFIG_FILE": os.devnull, "PIP_FIND_LINKS": ""}
    first = install(tmp_path / "venv", PYTHON=sys.executable, **away)
    assert first.returncode == 2, first.stderr
    assert "Could not find a version that satisfies the requirement" in first.stderr
    assert "Is the network" in first.stderr
    assert "Traceback" not in first.stderr
    second = install(tmp_path / "venv", PYTHON=sys.executable, **away)
    assert second.returncode == 2
    assert "making" in first.stderr
    assert "making" not in second.stderr


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
    return python("tools/kernels.py", *words)


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
