"""Answers of two programs, written, read and compared."""

from __future__ import annotations

import json
from itertools import zip_longest
from pathlib import Path
from typing import Any

# Wall times, words and places.
LEFT_OUT = {
    *("tick_ms", "perception_ms", "compute_s", "slow_leaves", "wall_s", "started", "git"),
    *("message", "doc", "origin", "range", "sample", "policies"),
}
ABSENT = "nothing"


def plain(value: Any) -> Any:
    """Return a value without wall times and words; of the path of a node only the last name."""
    match value:
        case dict():
            return {str(key): plain(value[key]) for key in value if key not in LEFT_OUT}
        case list():
            return [plain(one) for one in value]
        case str() if " " not in value:
            return value.rpartition("/")[2]
    return value


def difference(before: Any, after: Any, path: str) -> str:
    """Return the first difference of two values, empty if there is none."""
    match before, after:
        case dict(), dict():
            keys = [key for key in {**before, **after} if key != "said"]
            pairs = [(f".{key}", before.get(key, ABSENT), after.get(key, ABSENT)) for key in keys]
        case list(), list():
            both = zip_longest(before, after, fillvalue=ABSENT)
            pairs = [(f"[{index}]", *two) for index, two in enumerate(both)]
        case _:
            return "" if str(before) == str(after) else f"{path}: before {before}, after {after}"
    found = (difference(one, other, path + key) for key, one, other in pairs)
    return next(filter(None, found), "")


def write(folder: Path, found: dict[str, dict[str, Any]]) -> None:
    """Write the answers of each part, a line each."""
    folder.mkdir(parents=True, exist_ok=True)
    for part, rows in found.items():
        lines = [json.dumps([name, rows[name]]) + "\n" for name in sorted(rows)]
        (folder / f"{part}.jsonl").write_text("".join(lines))


def compare(before: Path, after: Path, parts: list[str], show: int = 5) -> int:
    """Print what differs between two folders of answers; return 1 if anything does."""
    differs = False
    for part in parts:
        one, other = (
            dict(map(json.loads, (folder / f"{part}.jsonl").read_text().splitlines()))
            for folder in (before, after)
        )
        names = [name for name in one if name in other]
        lines = [line for name in names if (line := difference(one[name], other[name], name))]
        print(f"{part}: {len(lines) or 'none'} of {len(names)} differ")
        print(*(f"  {line:.300}\n" for line in lines[:show]), sep="", end="")
        for words, some, others in (("before", one, other), ("after", other, one)):
            alone = [name for name in some if name not in others]
            heads = [name for name in alone if name.rpartition(" ")[0] not in alone]
            if alone:
                print(f"  only {words}: {', '.join(heads)}")
            differs |= bool(alone or lines)
    return int(differs)
