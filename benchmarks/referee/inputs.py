"""What both programs read: made by the earlier one."""

from __future__ import annotations

import json
import random
import re
import shutil
from pathlib import Path

from .parts import ports, shipped_trees
from .program import Program

# What is replaced once in a tree file, and by what.
MISTAKES = (
    (r' \w+="[^"]*"', ""),
    (r'="[^"]*"', '="x"'),
    (r'="[^"]*"', '="{nobody}"'),
    (r'="[^"]*"', '="{@phase}"'),
    (r"<(\w+)", r"<\1x"),
    (r"<\w+[^<>]*/>", ""),
    (r"(<\w+[^<>]*/>)", r"\1\1"),
    (r"(<\w+[^<>]*/>)", r"<Parallel>\1\1</Parallel>"),
    (r"\d+", "-7"),
    (r"/>", ">"),
)


def make_inputs(program: Program, folder: Path, traces: Path | None, cases: Path | None) -> None:
    """Copy tree files, write mistakes into some, and write scripts for the shipped ones."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(program.root / "trees", folder / "trees/shipped")
    shutil.copytree(program.root / "tests/data", folder / "trees/data")
    shutil.copy(traces or folder / "trees/data/bt_traces_sample.jsonl", folder / "traces.jsonl")
    if cases:
        shutil.copytree(cases, folder / "trees/cases")
    (folder / "trees/wrong").mkdir()
    (folder / "scripts").mkdir()
    files = sorted((folder / "trees/shipped").rglob("*.xml"))
    for seed in range(200):
        draw = random.Random(seed)  # noqa: S311
        text = (file := draw.choice(files)).read_text()
        wrong, new = draw.choice(MISTAKES)
        place = draw.choice(list(re.finditer(wrong, text)))
        text = text[: place.start()] + place.expand(new) + text[place.end() :]
        (folder / f"trees/wrong/{file.stem}-{seed}.xml").write_text(text)
    nodes = dict(ports(program, folder))
    trees = shipped_trees(program)
    drawings = program.many([["tree", "render", tree] for tree in trees], folder)
    for tree, drawing in zip(trees, drawings, strict=True):
        ids = sorted(set(re.findall(r"-- (\w+)", drawing.stdout)))
        for seed in range(6):
            draw = random.Random(seed)  # noqa: S311
            leaves = {
                one: "".join(draw.choices([word[0] for word in nodes[one]["answers"]], k=5))
                for one in ids
                if nodes.get(one, {}).get("kind") in ("Action", "Condition")
                and not nodes[one]["builtin"]
            }
            script = json.dumps({"leaves": leaves, "default": "S"})
            (folder / f"scripts/{tree}-{seed}.yaml").write_text(script)
