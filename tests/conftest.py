"""Settings of all tests."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest
from hypothesis import settings

from uav_bt.lab import shipped
from uav_bt.lab.lab_file import read_lab

# Each worker of pytest-xdist takes one core. Without this, the libraries of each worker take all
# cores, and wait for one another. Processes that tests start inherit it.
for library in ("OMP", "OPENBLAS", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")
os.environ.setdefault("OPENCV_FOR_THREADS_NUM", "1")

# Examples have no time limit: only benchmarks measure speed.
settings.register_profile("uav-bt", deadline=None)
settings.load_profile("uav-bt")

# A background job of a shell ignores Ctrl-C, and `nohup` ignores the end of the terminal. Child
# processes inherit this, but tests interrupt them.
for number, handler in (
    (signal.SIGINT, signal.default_int_handler),
    (signal.SIGHUP, signal.SIG_DFL),
):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, handler)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that replaces the paper's lab, to find code that relies on its classes."""
    parser.addoption("--lab", metavar="FOLDER", help="lab that stands for the paper's in all tests")


def pytest_configure(config: pytest.Config) -> None:
    """Replace the paper's lab before tests are collected, because they read its classes."""
    folder = config.getoption("--lab")
    if folder is not None:
        lab = read_lab(Path(folder))
        shipped._shipped_lab = lambda _: lab  # type: ignore[assignment]
