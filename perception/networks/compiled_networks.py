"""Compiled networks in the user's cache folder, so that a start does not compile them again.

A shipped network takes 0.2 s to compile, and 0.05 s to read from `$XDG_CACHE_HOME/uav-bt/networks`,
by default `~/.cache/uav-bt/networks`. A file's name is the hash of everything that the compilation
depends on, so another version of OpenVINO or another processor compiles again. A folder that cannot
be used and a damaged file cost time only. OpenVINO's own property `CACHE_DIR` writes into the final
file, which another process may be reading, and does not detect damaged weights.
"""

from __future__ import annotations

import hashlib
import logging
import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from perception.networks.inference_packages import import_openvino, instruction_sets
from uav_bt.errors import FileError
from uav_bt.files import write_whole

_LOG: Final = logging.getLogger(__name__)

_DEVICE: Final = "CPU"
_KEPT_FILES: Final = 24  # the oldest beyond these are deleted; 1 to 4 MB each; chosen
_DIGEST_BYTES: Final = hashlib.sha256().digest_size  # before the network; shows damage


def compiled_network(model: Any, path: Path, settings: Mapping[str, Any]) -> Any:
    """Return the network of an ONNX file, compiled for the CPU.

    It runs from its written form also when it was compiled just now, so that results do not depend
    on the cache.
    """
    core = import_openvino().Core()
    file = _file(model, path, settings, core)
    kept = None if file is None else _read(file)
    if kept is not None:
        with suppress(RuntimeError):  # another build of this version has written it
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
    whole = hashlib.sha256(path.read_bytes())
    whole.update(repr((import_openvino().get_version(), sorted(settings.items()))).encode())
    whole.update(repr(machine).encode())
    for part in _parts(model):
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


def _read(file: Path) -> bytes | None:
    """Return the network of a file; None if it is absent, unreadable or damaged."""
    try:
        content = file.read_bytes()
    except OSError:
        return None
    network = content[_DIGEST_BYTES:]
    return network if hashlib.sha256(network).digest() == content[:_DIGEST_BYTES] else None
