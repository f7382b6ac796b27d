"""An installed program, driven by its command line, and its answers."""

import csv
import hashlib
import json
import os
import re
import shlex
import subprocess
import tempfile
import tomllib
from pathlib import Path
from typing import Any

import av
from mcap.reader import make_reader

HERE = Path(__file__).parent
TABLE = tomllib.loads((HERE / "table.toml").read_text())


class Program:
    """A worktree of this repository and the Python that runs it."""

    def __init__(self, root: Path, scratch: Path, python: str) -> None:
        self.root, self.python = root.resolve(), python
        info = scratch / "uav_bt-0.dist-info"  # the plug-ins of this worktree, not the installed
        info.mkdir()
        (info / "METADATA").write_text("Name: uav_bt\nVersion: 0\n")
        project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
        groups = project["entry-points"].items()
        texts = ["\n".join([f"[{name}]", *map(" = ".join, each.items())]) for name, each in groups]
        (info / "entry_points.txt").write_text("\n".join(texts))
        given = {"PYTHONPATH": f"{self.root}:{scratch}", "COLUMNS": "100"}
        given["OPENCV_FOR_THREADS_NUM"] = "1"  # sums of several threads round by the load
        self.environment = {**os.environ, **given}
        self.trees = sorted(f.stem for f in root.glob("trees/**/*.xml") if f.parent.name != "lib")

    def lines(self, line: str) -> list[str]:
        """Return a line of the table for each shipped mission if it has TREE."""
        return [line.replace("TREE", tree) for tree in self.trees] if "TREE" in line else [line]

    def start(self, words: list[str], cwd: Path, text: str = "") -> tuple[int, str]:
        """Run Python with these words; return its exit code and output."""
        given = {"cwd": cwd, "env": self.environment, "input": text, "timeout": 1800}
        done = subprocess.run([self.python, *words], capture_output=True, text=True, **given)  # noqa: PLW1510, S603
        return done.returncode, done.stdout.replace(f"{self.root}/", "")

    def short(self, inputs: Path, lines: list[str]) -> dict[str, Any]:
        """Run short commands, for which the program is loaded once; named objects are answers."""
        held = shlex.join(sorted(str(file.relative_to(inputs)) for file in inputs.rglob("*.xml")))
        full = [line.format(held=held, shipped=" ".join(self.trees)) for line in lines]
        text = json.dumps([shlex.split(line) for line in full])
        ends = json.loads(self.start([str(HERE / "warm.py")], inputs, text)[1])
        found: dict[str, Any] = {}
        for line, end in zip(lines, ends, strict=True):
            one = answer(line, *end)
            objects = one.pop("printed") if isinstance(one["printed"], dict) else {}
            found |= {line: one, **{f"{line} {name}": objects[name] for name in objects}}
        return found

    def long(self, inputs: Path, line: str, folder: Path | None = None) -> dict[str, Any]:
        """Run commands, with && between, in a folder; what they print and write is one answer."""
        with tempfile.TemporaryDirectory() as empty:
            found: dict[str, Any] = {}
            for one in line.split(" && "):
                words = shlex.split(one.format(inputs=inputs, here=HERE, out=TABLE["out"]))
                words = words if one[0] in "-{" else ["-m", "uav_bt", *words]
                found[one.split()[0]] = answer(one, *self.start(words, folder or Path(empty)))
            files = sorted(path for path in Path(empty).rglob("*") if path.is_file())
            return {line: plain({**found, **{file.name: content(file) for file in files}})}


def answer(line: str, code: int, out: str) -> dict[str, Any]:
    """Return a command's exit code and what it printed, as far as it is compared."""
    if "--help" in line:  # options with default and range, commands
        entries = re.findall(r"(?m)^  (-.*?|[a-z-]+)(?:  (.*))?$", re.sub(r"\n {5,}", "  ", out))
        notes = r"\[(?:default|required|x|\d)[^\]]*\]"
        printed = {head: re.findall(notes, said) for head, said in entries}
    elif out[:1] in ("{", "["):
        printed = json.loads(out if out[1] == "\n" else f"[{','.join(out.splitlines())}]")
    else:
        printed = out.splitlines() if "tree render" in line or "conformance" in line else None
    return {"exit": code, "printed": plain(printed)}


def content(file: Path) -> Any:
    """Return what is compared of a file."""
    if file.suffix in (".json", ".jsonl"):
        return answer("", 0, file.read_text())["printed"]
    if file.suffix == ".csv":
        return list(csv.DictReader(file.read_text().splitlines()))
    if file.suffix == ".mp4":
        with av.open(file) as film:
            images = [frame.to_ndarray() for frame in film.decode(video=0)]
        return [[*image.shape, hashlib.sha256(image.data).hexdigest()] for image in images]
    if file.suffix == ".mcap":
        with file.open("rb") as raw:
            return [json.loads(m.data) for *_, m in make_reader(raw).iter_messages(TABLE["topics"])]
    return hashlib.sha256(file.read_bytes()).hexdigest()


def plain(value: Any) -> Any:
    """Return a value without wall times and words, with lists of named objects by name."""
    match value:
        case dict():
            return {key: plain(value[key]) for key in value if key not in TABLE["left_out"]}
        case [{"file": _} | {"node_id": _} | {"name": _}, *_]:
            return {next(iter(one.values())): plain(one) for one in value}
        case list():
            return [plain(one) for one in value]
        case str() if " " not in value:
            return value.rpartition("/")[2]  # of the path of a node or file the last name
    return value
