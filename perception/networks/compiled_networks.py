"""Compiled networks in the user's cache folder, so that a start does not compile them again.

OpenVINO compiles a shipped network in 0.12 s and reads a compiled one in 0.03 s (`uav-bt fly` on
one core of an EPYC). Files are in `$XDG_CACHE_HOME/uav-bt/networks`, by default
`~/.cache/uav-bt/networks`. A file's name is the hash of everything that the compilation depends on:
the ONNX file, the network with its added steps, the settings, OpenVINO's version and the
processor. So another version or another processor compiles again.

A network runs from its compiled form also when it was compiled just now. Results therefore do not
depend on the cache. A folder that cannot be used and a damaged file have no effect but the time.
OpenVINO's own property `CACHE_DIR` writes into the final file, which another process may be
reading, and does not detect damaged weights.
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
    """Return a network, compiled for the CPU.

    Args:
        model: the network.
        path: its ONNX file.
        settings: properties of OpenVINO's CPU plug-in.

    Raises:
        RuntimeError: OpenVINO cannot compile the network.
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
    if file is not None:
        _write(file, content)
    return imported


def _file(model: Any, path: Path, settings: Mapping[str, Any], core: Any) -> Path | None:
    """Return the file of a compiled network; None without a cache folder or an ONNX file."""
    try:
        root = os.environ.get("XDG_CACHE_HOME", "")
        folder = Path(root) if Path(root).is_absolute() else Path.home() / ".cache"
        whole = hashlib.sha256(path.read_bytes())
    except (OSError, RuntimeError):  # the latter for a user without a home folder
        return None
    machine = (core.get_property(_DEVICE, "FULL_DEVICE_NAME"), *instruction_sets())
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
        outputs = [
            (str(each.get_partial_shape()), str(each.get_element_type()))
            for each in operation.outputs()
        ]
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


def _write(file: Path, network: bytes) -> None:
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(file, hashlib.sha256(network).digest() + network)
        kept = sorted(file.parent.glob("*.blob"), key=lambda each: each.stat().st_mtime)
        for old in kept[:-_KEPT_FILES]:
            old.unlink()
    except (OSError, FileError) as error:  # or another process has deleted a file
        _LOG.info("a compiled network is not kept: %s", error)
