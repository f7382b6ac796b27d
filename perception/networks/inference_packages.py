"""OpenVINO and NNCF, with their usage reports switched off, and a cache of compiled networks.

Both report through the package `openvino_telemetry`, which also writes an identifier into the home
folder. Both work without that package. ONNX Runtime, which NNCF runs for calibration, reads the
variable `ORT_DISABLE_TELEMETRY` (`Privacy.md` in its wheel).

A shipped network takes 0.2 s to compile, and 0.05 s to read from `$XDG_CACHE_HOME/uav-bt/networks`,
by default `~/.cache/uav-bt/networks`. A file's name is the hash of everything that the compilation
depends on. OpenVINO's own `CACHE_DIR` writes into the final file, which another process may be
reading, and does not detect damaged weights.
"""

from __future__ import annotations

import functools
import hashlib
import logging
import os
import sys
from collections.abc import Iterator, Mapping, MutableMapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from uav_bt.errors import FileError
from uav_bt.files import write_whole

_LOG: Final = logging.getLogger(__name__)

_CPU_INFO: Final = Path("/proc/cpuinfo")  # Linux only
_CAPS: Final = ("ONEDNN_MAX_CPU_ISA", "DNNL_MAX_CPU_ISA")  # of oneDNN: current and older name
_DEVICE: Final = "CPU"
_KEPT_FILES: Final = 24  # the oldest beyond these are deleted; 1 to 4 MB each; chosen
_DIGEST_BYTES: Final = hashlib.sha256().digest_size  # before the network; shows damage


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
    (uxlfoundation/oneDNN issue 5689). Networks of a few million weights do not gain from it. Other
    processors are not limited: any cap at AVX-512 disables VNNI on those without AVX-512.
    """
    if any(name in environment for name in _CAPS) or not cpu_info.is_file():
        return
    if "amx_tile" in cpu_info.read_text(encoding="utf-8").split():
        environment[_CAPS[0]] = "AVX512_CORE_FP16"


# --- compiled networks ----------------------------------------------------------------------------


def compiled_network(model: Any, path: Path, settings: Mapping[str, Any]) -> Any:
    """Return the network of an ONNX file, compiled for the CPU.

    It runs from its written form also when it was compiled just now, so that results do not depend
    on the cache.
    """
    core = import_openvino().Core()
    file = _file(model, path, settings, core)
    with suppress(OSError, RuntimeError):  # none yet; another build of this version has written it
        whole = b"" if file is None else file.read_bytes()
        kept = whole[_DIGEST_BYTES:]
        if whole and hashlib.sha256(kept).digest() == whole[:_DIGEST_BYTES]:  # else it is damaged
            return core.import_model(kept, _DEVICE, settings)
    compiled = core.compile_model(model, _DEVICE, settings)
    try:
        content = compiled.export_model().getvalue()
        imported = core.import_model(content, _DEVICE, settings)
    except RuntimeError as error:
        _LOG.info("%s: OpenVINO cannot keep this network compiled: %s", path, error)
        return compiled
    if file is None:
        return imported
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(file, hashlib.sha256(content).digest() + content)
        kept_files = sorted(file.parent.glob("*.blob"), key=lambda each: each.stat().st_mtime)
        for old in kept_files[:-_KEPT_FILES]:
            old.unlink()
    except (OSError, FileError) as error:  # or another process has deleted a file
        _LOG.info("a compiled network is not kept: %s", error)
    return imported


def _file(model: Any, path: Path, settings: Mapping[str, Any], core: Any) -> Path | None:
    """Return the file of a compiled network; None for a user without a home folder."""
    folder = Path(os.environ.get("XDG_CACHE_HOME", ""))
    if not folder.is_absolute():
        try:
            folder = Path.home() / ".cache"
        except RuntimeError:
            return None
    machine = (core.get_property(_DEVICE, "FULL_DEVICE_NAME"), *instruction_sets())
    about = (import_openvino().get_version(), sorted(settings.items()))
    whole = hashlib.sha256(path.read_bytes())
    for part in (repr(about).encode(), repr(machine).encode(), *_parts(model)):
        whole.update(part)
    return folder / "uav-bt" / "networks" / f"{path.stem}-{whole.hexdigest()}.blob"


def _parts(model: Any) -> Iterator[bytes]:
    """Yield the operations of a network, without their names, which depend on the process."""
    numbers: dict[str, int] = {}
    for operation in model.get_ordered_ops():
        numbers[operation.get_name()] = len(numbers)
        sources = [each.get_source_output() for each in operation.inputs()]
        inputs = [(numbers[each.get_node().get_name()], each.get_index()) for each in sources]
        ports = operation.outputs()
        outputs = [(str(each.get_partial_shape()), str(each.get_element_type())) for each in ports]
        kind = operation.get_type_name()
        yield repr((kind, operation.get_attributes(), inputs, outputs)).encode()
        if kind == "Constant":
            yield operation.get_data().tobytes()
