"""Installed plug-ins by entry-point group and name, and installed extras."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import sys
import traceback
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from uav_bt.errors import InputError, MissingDependencyError, UavBtError, UnknownNameError

if TYPE_CHECKING:
    from uav_bt.landing_marks import MarkFinder
    from uav_bt.protocols import LeafPolicy
    from uav_bt.types.landing_mark import LandingMark

_PACKAGES: Final = ("behaviours", "perception", "sim_bridge", "trees")

BEHAVIOURS: Final = "uav_bt.behaviours"  # each names an iterable of node classes
POLICIES: Final = "uav_bt.policies"  # each names a callable that makes a LeafPolicy
DRONES: Final = "uav_bt.drones"  # each names a DroneConfig class
LANDING_MARKS: Final = "uav_bt.landing_marks"  # each names a MarkFinder class

_KINDS: Final = {POLICIES: "policy", DRONES: "drone", LANDING_MARKS: "landing mark"}
# Modules that only some commands import, with the extra that installs each.
_EXTRAS: Final = {
    **dict.fromkeys(("jinja2", "matplotlib", "pebble"), "campaign"),
    "control": "design",
    "distributed": "dask",
    "rerun": "view",
    **dict.fromkeys(("msgpack", "zmq"), "live"),
    **dict.fromkeys(("lsprotocol", "pygls"), "lsp"),
    **dict.fromkeys(("foxglove", "mcap"), "record"),
    **dict.fromkeys(("nncf", "onnx", "onnxruntime", "torch"), "train"),
}


def check_packages(home: Path | None = None, names: Sequence[str] = _PACKAGES) -> None:
    """Refuse to start if a foreign folder hides one of our packages, whose names are common."""
    home = Path(__file__).resolve().parents[1] if home is None else home
    for name in names:
        ours, spec = home / name, importlib.util.find_spec(name)
        found = [] if spec is None else [*(spec.submodule_search_locations or []), spec.origin]
        theirs = [place for place in found if place is not None]
        if not theirs:
            raise InputError(
                f"the package '{name}' that belongs to uav-bt is not installed; reinstall uav-bt"
            )
        if ours not in [Path(place).resolve() for place in theirs]:
            raise InputError(
                f"Python finds '{theirs[0]}' where uav-bt needs its own '{ours}'; rename that "
                f"'{name}', start from another folder, or take it off PYTHONPATH"
            )


@lru_cache(maxsize=1)
def _installed(path: tuple[str, ...]) -> Any:  # `EntryPoints`; in Python 3.11 of another type
    """Return the entry points of all packages on `sys.path`; each package has a file of them."""
    del path  # another one has other packages
    return importlib.metadata.entry_points()


def _entry_points(group: str) -> dict[str, list[importlib.metadata.EntryPoint]]:
    found: dict[str, list[importlib.metadata.EntryPoint]] = {}
    for point in _installed(tuple(sys.path)).select(group=group):
        points = found.setdefault(point.name, [])
        # One package found twice (an editable install beside its checkout) is not a conflict.
        if point.value not in [known.value for known in points]:
            points.append(point)
    return found


def names(group: str) -> tuple[str, ...]:
    """Return all registered names of a group, in alphabetical order."""
    return tuple(sorted(_entry_points(group)))


def load(group: str, name: str) -> Any:
    """Import and return the object registered under a name."""
    points = _entry_points(group)
    kind = _KINDS.get(group, "behaviours package")
    if name not in points:
        raise UnknownNameError(kind, name, points)
    point, *others = points[name]
    if others:
        raise InputError(
            f"{kind} '{name}' is registered twice: by {point.value} and by {others[0].value}; "
            "uninstall one of the two packages"
        )
    try:
        return point.load()
    except (Exception, SystemExit) as error:  # a foreign module may raise anything when imported
        package = "" if point.dist is None else f" '{point.dist.name}'"
        raise InputError(
            f"{kind} '{name}' ({point.value}) cannot be imported: {describe_failure(error)}; "
            f"mend, reinstall or uninstall the package{package} that registers it"
        ) from error


def describe_failure(error: BaseException) -> str:
    """Return the text of an import error, with file and line of the module that raised it."""
    text = str(error) if isinstance(error, (ImportError, AttributeError)) else repr(error)
    machinery = (importlib.metadata.__file__, importlib.__file__)
    places = [
        f"{frame.filename}:{frame.lineno}: "
        for frame in traceback.extract_tb(error.__traceback__)
        if frame.filename not in (*machinery, __file__) and not frame.filename.startswith("<")
    ]
    return f"{places[-1] if places else ''}{text}"


def need(extra: str, *modules: str, what: str = "this") -> None:
    """Refuse to begin work if a package that it needs is not installed.

    The message names the user of the modules and the command that installs their extra.
    """
    absent = [name for name in modules if not _is_installed(name)]
    if absent:
        raise _missing(what, absent, extra)


def missing_extra(error: ModuleNotFoundError) -> Exception:
    """Return the error about the extra that installs a module, or the given one if none does."""
    module = (error.name or "").partition(".")[0]
    return _missing("this", [module], _EXTRAS[module]) if module in _EXTRAS else error


def _missing(what: str, modules: Sequence[str], extra: str) -> MissingDependencyError:
    return MissingDependencyError(
        f"{what} needs {' and '.join(modules)}; run {install_command(extra)}"
    )


def install_command(extra: str) -> str:
    """Return the command that installs an extra, for messages; uav-bt is on no package index."""
    constraints = "constraints-olympe.txt" if extra == "olympe" else "constraints.txt"
    return f'`pip install -c {constraints} -e ".[{extra}]"` in the folder of uav-bt\'s source'


def _is_installed(module: str) -> bool:
    if module in sys.modules:
        return sys.modules[module] is not None
    return importlib.util.find_spec(module) is not None


def look_up_policy(name: str, own: Mapping[str, Any] | None = None) -> None:
    """Refuse a policy that cannot be made, NAME or NAME:ARGUMENT, without making it.

    The policy's `look_up`, if any, checks the argument. `own` has further classes of policies.
    """
    registered, colon, argument = name.partition(":")
    if not colon:
        return  # an import would take longer than the rest of the check
    factory = _policy_factory(registered, argument, own or {})
    if hasattr(factory, "look_up"):
        factory.look_up(argument)


def make_policy(name: str, own: Mapping[str, Any] | None = None) -> LeafPolicy:
    """Return a leaf policy by its registered name.

    Args:
        name: NAME, or NAME:ARGUMENT for a policy with `from_text`: `student:FILE.onnx`.
        own: classes of policies by name, besides the registered ones.
    """
    from uav_bt.protocols import LeafPolicy  # noqa: PLC0415  (NumPy, and `--help` needs this module)

    registered, colon, argument = name.partition(":")
    factory = _policy_factory(registered, argument if colon else None, own or {})
    try:
        policy = factory.from_text(argument) if colon else factory()
    except UavBtError:
        raise
    except Exception as error:  # a foreign class may raise anything when it is made
        raise InputError(f"policy '{name}' cannot be made: {describe_failure(error)}") from error
    if not isinstance(policy, LeafPolicy):
        kind = f"{type(policy).__module__}.{type(policy).__qualname__}"
        raise InputError(f"policy '{name}' has no method `decide(view)`: {kind}")
    return policy


def make_mark_finder(mark: LandingMark) -> MarkFinder:
    """Return a finder of a landing mark, whose kind must be registered and take the mark."""
    from uav_bt.landing_marks import MarkFinder  # noqa: PLC0415  (NumPy, as above)

    kind = load(LANDING_MARKS, mark.kind)
    try:
        finder = kind(mark)
    except UavBtError:
        raise
    except Exception as error:  # a foreign class may raise anything when it is made
        raise InputError(
            f"landing mark '{mark.kind}' cannot be made: {describe_failure(error)}"
        ) from error
    if not isinstance(finder, MarkFinder):
        name = f"{type(finder).__module__}.{type(finder).__qualname__}"
        raise InputError(
            f"landing mark '{mark.kind}' lacks find, picture, uses_images or shows_heading: {name}"
        )
    return finder


def _policy_factory(registered: str, argument: str | None, own: Mapping[str, Any]) -> Any:
    """Return the factory that is registered as a policy, or is one of these."""
    factory = own[registered] if registered in own else load(POLICIES, registered)
    if argument is not None and not hasattr(factory, "from_text"):
        raise InputError(f"policy '{registered}' takes no argument, got '{registered}:{argument}'")
    return factory
