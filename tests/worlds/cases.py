"""Tables of cases that several tests keep outside their code."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

DATA = Path(__file__).parents[1] / "data"


def cases(name: str) -> Any:
    """Return the content of `tests/data/NAME.yaml`."""
    return yaml.safe_load((DATA / f"{name}.yaml").read_text("utf-8"))
