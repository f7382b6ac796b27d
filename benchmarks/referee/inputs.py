"""What both programs read, made with the earlier one."""

import json
import random
import re
import shutil
from pathlib import Path

from .program import HERE, TABLE, Program


def make_inputs(program: Program, root: Path, folder: Path, traces: Path | None) -> None:
    """Copy tree files, write mistakes into some, and write scripts for the shipped ones."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(HERE / "boards", folder / "boards")
    shutil.copytree(root / "trees", folder / "trees/shipped")
    shutil.copytree(root / "tests/data", folder / "trees/data")
    shutil.copy(traces or folder / "trees/data/bt_traces_sample.jsonl", folder / "traces.jsonl")
    draw = random.Random(0)  # noqa: S311
    files = sorted((folder / "trees/shipped").rglob("*.xml"))
    for number in range(200):
        text = (file := draw.choice(files)).read_text()
        wrong, new = draw.choice(TABLE["mistakes"])
        place = draw.choice(list(re.finditer(wrong, text)))
        text = text[: place.start()] + place.expand(new) + text[place.end() :]
        (folder / f"trees/wrong-{number}-{file.name}").write_text(text)
    nodes = {
        name.split()[-1]: one for name, one in program.short(folder, ["tree nodes --format json"])
    }
    for name, drawing in program.short(folder, program.lines(["tree render TREE"])):
        for number in range(6):
            leaves = {
                one: "".join(word[0] for word in draw.choices(nodes[one]["answers"], k=5))
                for one in sorted(nodes.keys() & set(re.findall(r"-- (\w+)", str(drawing))))
                if nodes[one]["kind"] in ("Action", "Condition") and not nodes[one]["builtin"]
            }
            script = json.dumps({"leaves": leaves, "default": "S"})
            (folder / f"{name.split()[-1]}-{number}.yaml").write_text(script)
