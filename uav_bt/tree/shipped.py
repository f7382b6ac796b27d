"""Which tree file a person means: a path, the name of a shipped mission, a whole folder."""

from __future__ import annotations

from pathlib import Path

from uav_bt.errors import FileError


def shipped_trees() -> Path:
    """Return the folder of the missions that ship with uav-bt."""
    from importlib import resources  # noqa: PLC0415 - slow, and mostly not needed

    return Path(str(resources.files("trees")))


def resolve_tree(tree: str | Path) -> Path:
    """Return a tree file: a path, or the name of a shipped mission.

    Raises:
        FileError: there is neither.
    """
    path = Path(tree)
    if path.is_file():
        return path
    folder = shipped_trees()
    shipped = folder / f"{path.stem}.xml"
    # A name with a folder in it means that very file, which does not exist.
    if path.parent in (Path(), Path("trees")) and shipped.is_file():
        return shipped
    known = ", ".join(sorted(file.stem for file in folder.glob("*.xml")))
    raise FileError(path, f"no such tree file, nor a shipped mission of that name ({known})")


def tree_files(tree: str | Path) -> tuple[Path, ...]:
    """Return the tree files that a path or a name stands for.

    Args:
        tree: a file, a shipped mission's name, or a folder: all XML files in it and below, hidden
            folders left out.

    Raises:
        FileError: there is no such file, or nothing to find in the folder.
    """
    folder = Path(tree)
    if not folder.is_dir():
        return (resolve_tree(tree),)
    found = sorted(
        path
        for path in folder.rglob("*.xml")
        if path.is_file()
        and not any(part.startswith(".") for part in path.relative_to(folder).parts)
    )
    if not found:
        raise FileError(folder, "no tree file (*.xml) in this folder or below")
    return tuple(found)
