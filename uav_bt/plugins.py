"""Installed plug-ins by entry-point group and name, and installed extras."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from uav_bt.errors import InputError, MissingDependencyError, UavBtError, UnknownNameError

if TYPE_CHECKING:
    from uav_bt.landing_marks import MarkFinder
    from uav_bt.protocols import LeafPolicy
    from uav_bt.types.sizes import LandingMark

_PACKAGES: Final = ("behaviours", "perception", "sim_bridge", "trees")

BEHAVIOURS: Final = "uav_bt.behaviours"  # each names an iterable of node classes
POLICIES: Final = "uav_bt.policies"  # each names a callable that makes a LeafPolicy
DRONES: Final = "uav_bt.drones"  # each names a DroneConfig class
LANDING_MARKS: Final = "uav_bt.landing_marks"  # each names a MarkFinder class

_KINDS: Final = {POLICIES: "policy", DRONES: "drone", LANDING_MARKS: "landing mark"}
# Modules that only some commands import, by the extra that installs them.
_EXTRAS: Final = {
    "campaign": ("jinja2", "matplotlib", "pebble"),
    "dask": ("distributed",),
    "design": ("control",),
    "live": ("zmq", "msgpack"),
    "lsp": ("lsprotocol", "pygls"),
    "record": ("mcap", "foxglove"),
    "train": ("torch", "onnx", "onnxruntime", "nncf"),
    "view": ("rerun",),
}


def check_packages(home: Path | None = None, names: Sequence[str] = _PACKAGES) -> None:
    """Refuse to start if a foreign folder hides one of our packages, whose names are common."""
    home = Path(__file__).resolve().parents[1] if home is None else home
    for name in names:
        spec = importlib.util.find_spec(name)
        found = [] if spec is None else [*(spec.submodule_search_locations or [str(spec.origin)])]
        if home / name not in [Path(place).resolve() for place in found]:
            theirs = f"finds '{found[0]}'" if found else "finds nothing"
            advice = f"rename that '{name}', start from another folder, or take it off PYTHONPATH"
            advice = advice if found else "reinstall uav-bt"
            raise InputError(
                f"Python {theirs} where uav-bt needs its own '{home / name}'; {advice}"
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
        both = f"by {point.value} and by {others[0].value}; uninstall one of the two packages"
        raise InputError(f"{kind} '{name}' is registered twice: {both}")
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


def need(extra: str, what: str = "this") -> None:
    """Refuse to begin work if a package of an extra is not installed; `what` needs it."""
    absent = [module for module in _EXTRAS[extra] if importlib.util.find_spec(module) is None]
    if absent:
        raise _missing(what, absent, extra)


def missing_extra(error: ModuleNotFoundError) -> Exception:
    """Return the error about the extra that installs a module, or the given one if none does."""
    module = (error.name or "").partition(".")[0]
    extra = next((extra for extra, modules in _EXTRAS.items() if module in modules), None)
    return error if extra is None else _missing("this", [module], extra)


def _missing(what: str, modules: Sequence[str], extra: str) -> MissingDependencyError:
    absent = " and ".join(modules)
    return MissingDependencyError(f"{what} needs {absent}; run {install_command(extra)}")


def install_command(extra: str) -> str:
    """Return the command that installs an extra, for messages; uav-bt is on no package index."""
    constraints = "constraints-olympe.txt" if extra == "olympe" else "constraints.txt"
    return f'`pip install -c {constraints} -e ".[{extra}]"` in the folder of uav-bt\'s source'


def look_up_policy(name: str, own: Mapping[str, Any] | None = None) -> None:
    """Refuse a policy that cannot be made, NAME or NAME:ARGUMENT, without making it.

    The policy's `look_up`, if any, checks the argument. `own` has further classes of policies.
    """
    if ":" not in name:
        return  # an import would take longer than the rest of the check
    factory, argument = _policy(name, own or {})
    if hasattr(factory, "look_up"):
        factory.look_up(argument)


def make_policy(name: str, own: Mapping[str, Any] | None = None) -> LeafPolicy:
    """Return a leaf policy by its registered name, or by one of these classes' names.

    NAME:ARGUMENT is for a policy with `from_text`, such as `student:FILE.onnx`.
    """
    from uav_bt.protocols import LeafPolicy  # noqa: PLC0415  (NumPy, and `--help` needs this module)

    factory, argument = _policy(name, own or {})
    made = _made(f"policy '{name}'", factory if argument is None else factory.from_text, argument)
    if not isinstance(made, LeafPolicy):
        raise InputError(f"policy '{name}' has no method `decide(view)`: {_class_of(made)}")
    return made


def make_mark_finder(mark: LandingMark) -> MarkFinder:
    """Return a finder of a landing mark, whose kind must be registered and take the mark."""
    from uav_bt.landing_marks import MarkFinder  # noqa: PLC0415  (NumPy, as above)

    made = _made(f"landing mark '{mark.kind}'", load(LANDING_MARKS, mark.kind), mark)
    if not isinstance(made, MarkFinder):
        lacking = "find, picture, uses_images or shows_heading"
        raise InputError(f"landing mark '{mark.kind}' lacks {lacking}: {_class_of(made)}")
    return made


def _policy(name: str, own: Mapping[str, Any]) -> tuple[Any, str | None]:
    """Return the factory of a policy, and the argument of its `from_text`."""
    registered, colon, argument = name.partition(":")
    factory = own[registered] if registered in own else load(POLICIES, registered)
    if colon and not hasattr(factory, "from_text"):
        raise InputError(f"policy '{registered}' takes no argument, got '{name}'")
    return factory, argument if colon else None


def _made(what: str, factory: Callable[..., object], argument: object) -> object:
    try:
        return factory() if argument is None else factory(argument)
    except UavBtError:
        raise
    except Exception as error:  # a foreign class may raise anything when it is made
        raise InputError(f"{what} cannot be made: {describe_failure(error)}") from error


def _class_of(value: object) -> str:
    return f"{type(value).__module__}.{type(value).__qualname__}"
