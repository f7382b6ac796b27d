"""The tree files that ship with the package: finding them by name, copying them as starters."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from uav_bt.errors import FileError, UnknownNameError, did_you_mean
from uav_bt.files import did_you_mean_file, write_whole
from uav_bt.tree.loading.lookup import files_in, shipped_trees


def resolve_tree(tree: str | Path) -> Path:
    """Return a tree file: a path, or the bare name of a shipped mission.

    A name with a suffix or a folder always means a file, so that a mistyped path never flies a
    shipped mission instead.
    """
    path = Path(tree)
    if path.suffix in (".yaml", ".yml"):
        raise FileError(
            path,
            "expected a tree file (*.xml), got a YAML file: `--scene` flies in a scene file, and "
            f"`uav-bt lab scenes --show {path}` draws it",
        )
    if path.is_file():
        return path
    shipped = shipped_missions()
    bare = not path.suffix and path.parent == Path()
    if bare and path.name in shipped:
        return shipped[path.name]
    hint = did_you_mean_file(path.with_suffix(".xml")) if path.name else ""
    if not hint:
        what = "nor a shipped mission of that name"
        what = what if bare else "and a shipped mission has no suffix"
        hint = f", {what}{did_you_mean(path.stem, shipped)} ({', '.join(shipped)})"
    raise FileError(path, f"no such tree file{hint}")


def shipped_missions() -> dict[str, Path]:
    """Return the files of the shipped missions by name, those of the paper in `paper/` included."""
    found = [*shipped_trees().glob("*.xml"), *shipped_trees().glob("paper/*.xml")]
    return {file.stem: file for file in sorted(found)}


def tree_files(tree: str | Path) -> tuple[Path, ...]:
    """Return the tree file of a path or name; of a folder all in it and below, none hidden."""
    if not Path(tree).is_dir():
        return (resolve_tree(tree),)
    found = files_in(Path(tree))
    if not found:
        raise FileError(Path(tree), "no tree file (*.xml) in this folder or below")
    return found


STARTERS: Final = {
    "hover": "hover_and_look",
    "land": "land_only",
    "explore": "survey_and_land",
}
"""Shipped missions that a new mission can start from, by short name, the smallest first."""

_ROOT_TAG: Final = re.compile(r"<root\b[^>]*>\n")
# A comment must not contain two hyphens in a row.
_COMMENT: Final = """\
  <!--
    Begun from the shipped mission '{name}'. Change whatever you like, then:

      uav-bt check FILE         reports all that is wrong with it, with line and column
      uav-bt tree render FILE   draws it
      uav-bt simulate FILE      ticks it with scripted leaves, to see what runs when
      uav-bt fly FILE           flies it in the simulated lab
      uav-bt tree nodes         lists all nodes with their attributes and defaults

    How to read it:

      Sequence               runs its children one after another, until one fails
      Fallback               tries its children one after another, until one succeeds
      ReactiveSequence       begins anew at its first child in every tick; a child that is done
                             succeeds again, and the next one goes on
      Repeat, Retry...,      have one child: run it again, try it again, stop it after
      Timeout, Force...      some time, change its answer to success or failure
      SubTree ID="X"         runs the tree X of this file, or of the trees that ship
      attribute="{{name}}"     a variable of this tree
      attribute="{{@name}}"    a key of the mission board, where perception writes what it sees

    A leaf (TakeOff, Turn, Land, ...) answers RUNNING until it is done, then SUCCESS or FAILURE.
    Its ports are in the drone's own frame: metres, degrees clockwise.
  -->
"""


def write_starter(path: Path, start: str = "hover") -> None:
    """Write a tree file to begin with; an existing file is never overwritten.

    Args:
        path: the new file, `*.xml`.
        start: one of `STARTERS`.
    """
    if start not in STARTERS:
        raise UnknownNameError("starter mission", start, STARTERS)
    if path.suffix != ".xml":
        raise FileError(path, "expected a name that ends in .xml, as tree files have")
    name = STARTERS[start]
    text = (shipped_trees() / f"{name}.xml").read_text(encoding="utf-8")
    text = _ROOT_TAG.sub(lambda tag: tag[0] + _COMMENT.format(name=name), text, count=1)
    if path.exists():
        message = "there is such a file, and it is not overwritten; choose another name"
        raise FileError(path, message)
    write_whole(path, text)
