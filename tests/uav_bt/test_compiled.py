"""Kernels are compiled for one signature, at import, and kept where that is possible."""

from __future__ import annotations

import logging
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from uav_bt.compiled import _say, compiled


def total(values: np.ndarray, divisor: float) -> float:
    """Return the sum of quotients, one after the other."""
    found = 0.0
    for value in values:
        found += value / divisor
    return found


SIGNATURE = "float64(float64[::1], float64)"


def test_a_division_by_zero_is_infinite() -> None:
    assert compiled(SIGNATURE)(total)(np.ones(3), 0.0) == np.inf


def test_another_type_is_refused_instead_of_compiled_in_flight() -> None:
    kernel = compiled(SIGNATURE)(total)
    with pytest.raises(TypeError, match="No matching definition"):
        kernel(np.ones((2, 2)), 1.0)


def test_without_a_folder_that_can_be_written_one_message_says_what_to_set(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """The kernel works all the same."""
    _say.cache_clear()
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null/cache")
    elsewhere = total.__code__.replace(co_filename="/dev/null/kernel.py")
    lost = type(total)(elsewhere, total.__globals__)
    with caplog.at_level(logging.WARNING, logger="uav_bt.compiled"):
        assert compiled(SIGNATURE)(lost)(np.ones(3), 1.0) == 3.0
        compiled(SIGNATURE)(lost)
    assert [record.message.count("NUMBA_CACHE_DIR") for record in caplog.records] == [1]


def test_a_second_process_takes_the_kernels_from_the_cache(tmp_path: Path) -> None:
    """The first process says that it compiles, the second is silent."""
    (tmp_path / "kernels.py").write_text(
        "from uav_bt.compiled import compiled\n"
        "@compiled('float64(float64)')\n"
        "def twice(value):\n"
        "    return 2.0 * value\n"
        "print(twice(21.0))\n"
    )
    for message in ("compiling for this machine", ""):
        done = subprocess.run(
            [sys.executable, "-c", "import kernels"],
            cwd=tmp_path,
            env={"PYTHONPATH": f"{Path(__file__).parents[2]}:{tmp_path}", "HOME": str(tmp_path)},
            capture_output=True,
            text=True,
            check=True,
        )
        assert done.stdout == "42.0\n"
        assert (message in done.stderr) if message else not done.stderr
