"""`docs/faults.md`: its table of kinds agrees with the code."""

from __future__ import annotations

import math
from pathlib import Path

from uav_bt.testing import FAULTS, FaultKind

PAGE = Path(__file__).parents[3] / "docs" / "faults.md"


def row(kind: FaultKind) -> str:
    level = "" if kind.level is None else f"{kind.level:g} {kind.unit}"
    bounded = math.isfinite(kind.least) or math.isfinite(kind.most)
    limits = f"{kind.least:g} to {kind.most:g}" if bounded else "any"
    return f"| `{kind.name}` | {kind.what} | {level} | {limits if level else ''} |"


def test_the_page_has_the_kinds_as_the_code_has_them() -> None:
    rows = "\n".join(row(kind) for kind in FAULTS.values())
    table = f"| kind | effect | default level | range |\n|---|---|---|---|\n{rows}\n"
    assert table in PAGE.read_text(encoding="utf-8"), (
        f"docs/faults.md: replace the table by\n{table}"
    )
