"""Of which commit the code is that flies."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

__all__ = ["code_state"]


def code_state(folder: Path) -> str | None:
    """Return the commit of the checkout that a folder belongs to; None where there is none.

    Args:
        folder: anywhere in the checkout.

    Returns:
        The commit's hash, followed by ``+changes`` when files that git follows differ from it.
    """
    git = shutil.which("git")
    if git is None:
        return None
    commit = _said(git, folder, "rev-parse", "HEAD")
    if commit is None:
        return None
    changed = _said(git, folder, "status", "--porcelain", "--untracked-files=no")
    return f"{commit}+changes" if changed else commit


def _said(git: str, folder: Path, *words: str) -> str | None:
    done = subprocess.run(  # noqa: S603 - git, with words of our own
        [git, "-C", str(folder), *words], capture_output=True, text=True, check=False
    )
    return done.stdout.strip() if done.returncode == 0 else None
