"""Imports of the packages that run and quantise networks, with their usage reports switched off.

OpenVINO and NNCF report through the package `openvino_telemetry`, which also writes an identifier
into the home folder. Both work without that package. ONNX Runtime, which NNCF runs for calibration,
reads the variable `ORT_DISABLE_TELEMETRY` (`Privacy.md` in its wheel).
"""

from __future__ import annotations

import functools
import os
import sys
from collections.abc import MutableMapping
from pathlib import Path
from typing import Any, Final

_CPU_INFO: Final = Path("/proc/cpuinfo")  # Linux only
_CAPS: Final = ("ONEDNN_MAX_CPU_ISA", "DNNL_MAX_CPU_ISA")  # of oneDNN: current and older name


@functools.cache
def import_openvino() -> Any:
    """Return OpenVINO; the first call imports it, which takes a third of a second."""
    _switch_reports_off()
    _spare_amx(os.environ, _CPU_INFO)
    import openvino  # noqa: PLC0415

    return openvino


@functools.cache
def import_nncf() -> Any:
    """Return NNCF; the first call imports it, which takes seconds."""
    _switch_reports_off()
    import nncf  # noqa: PLC0415

    return nncf


def instruction_sets() -> tuple[str, ...]:
    """Return the instruction sets of this processor, where known, and OpenVINO's cap for them."""
    lines = _CPU_INFO.read_text(encoding="utf-8").splitlines() if _CPU_INFO.is_file() else []
    known = {line for line in lines if line.startswith(("flags", "Features"))}  # x86, ARM
    return (*sorted(known), *(f"{name}={os.environ.get(name)}" for name in _CAPS))


def _switch_reports_off() -> None:
    # With this entry an import fails as if the package were not installed.
    sys.modules["openvino_telemetry"] = None  # type: ignore[assignment]
    os.environ["ORT_DISABLE_TELEMETRY"] = "1"


def _spare_amx(environment: MutableMapping[str, str], cpu_info: Path) -> None:
    """Keep OpenVINO from using a processor's tile instructions (AMX), unless a cap is set.

    Some virtual machines announce AMX and then refuse to run it, which ends the process
    (uxlfoundation/oneDNN issue 5689). OpenVINO has no setting that disables it. Networks of a few
    million weights do not gain from it. Processors without AMX are not limited: any cap at AVX-512
    also disables VNNI on processors that have VNNI without AVX-512.
    """
    if any(name in environment for name in _CAPS) or not cpu_info.is_file():
        return
    if "amx_tile" in cpu_info.read_text(encoding="utf-8").split():
        environment[_CAPS[0]] = "AVX512_CORE_FP16"
