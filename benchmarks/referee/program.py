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
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import av
from mcap.reader import make_reader

HERE = Path(__file__).parent
TABLE = tomllib.loads((HERE / "table.toml").read_text())
Rows = Iterator[tuple[str, Any]]


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
        self.environment = {**os.environ, "PYTHONPATH": f"{self.root}:{scratch}", "COLUMNS": "100"}
        files = [file for file in root.glob("trees/**/*.xml") if file.parent.name != "lib"]
        self.trees = sorted(file.stem for file in files)

    def lines(self, line: str) -> list[str]:
        """Return a line of the table for each shipped mission if it has TREE."""
        return [line.replace("TREE", tree) for tree in self.trees] if "TREE" in line else [line]

    def start(self, words: list[str], cwd: Path, text: str = "") -> tuple[int, str, str]:
        """Run Python with these words; return its exit code, output and errors."""
        given = {"cwd": cwd, "env": self.environment, "input": text, "timeout": 1800}
        done = subprocess.run([self.python, *words], capture_output=True, text=True, **given)  # noqa: PLW1510, S603
        return done.returncode, done.stdout.replace(f"{self.root}/", ""), done.stderr

    def answers(self, inputs: Path, lines: str | list[str]) -> dict[str, Any]:
        """Return the answers by command line; that they failed is one of them."""
        try:
            whole = isinstance(lines, str)
            return dict(self.long(inputs, lines) if whole else self.short(inputs, lines))
        except (OSError, ValueError, LookupError, TypeError, subprocess.SubprocessError) as error:
            return {f"{lines} failed": repr(error)}

    def short(self, inputs: Path, lines: list[str]) -> Rows:
        """Run short commands, for which the program is loaded once; named objects are answers."""
        held = shlex.join(sorted(str(file.relative_to(inputs)) for file in inputs.rglob("*.xml")))
        full = [line.format(held=held, shipped=" ".join(self.trees)) for line in lines]
        text = json.dumps([shlex.split(line) for line in full])
        _, out, _ = self.start([str(HERE / "warm.py")], inputs, text)
        for line, end in zip(lines, json.loads(out), strict=True):
            found = answer(line, *end)
            objects = found.pop("printed") if isinstance(found["printed"], dict) else {}
            yield from [(line, found), *((f"{line} {name}", one) for name, one in objects.items())]

    def long(self, inputs: Path, line: str, folder: Path | None = None) -> Rows:
        """Run commands, with && between, in a folder; what they print and write is one answer."""
        with tempfile.TemporaryDirectory() as empty:
            found: dict[str, Any] = {}
            for one in line.split(" && "):
                words = shlex.split(one.format(inputs=inputs, here=HERE, out=TABLE["out"]))
                words = words if one[0] in "-{" else ["-m", "uav_bt", *words]
                found[one.split()[0]] = answer(one, *self.start(words, folder or Path(empty)))
            files = sorted(path for path in Path(empty).rglob("*") if path.is_file())
            yield line, {**found, **{file.name: plain(content(file)) for file in files}}


def answer(line: str, code: int, out: str, errors: str) -> dict[str, Any]:
    """Return a command's exit code, what it printed, and its last words if it failed."""
    printed: Any = None
    if "--help" in line:  # options with default and range, commands
        entries = re.findall(r"(?m)^  (-.*?|[a-z-]+)(?:  (.*))?$", re.sub(r"\n {5,}", "  ", out))
        notes = r"\[(?:default|required|x|\d)[^\]]*\]"
        printed = {head: re.findall(notes, said) for head, said in entries}
    elif out[:1] in ("{", "["):
        printed = json.loads(out if out[1] == "\n" else f"[{','.join(out.splitlines())}]")
    elif "tree render" in line or "conformance" in line:
        printed = out.splitlines()
    said = errors.strip().rpartition("\n")[2] if code else ""
    return {"exit": code, "said": said, "printed": plain(printed)}


def content(file: Path) -> Any:
    """Return what is compared of a file."""
    if file.suffix in (".json", ".jsonl"):
        text = file.read_text()
        return json.loads(text if file.suffix == ".json" else f"[{','.join(text.splitlines())}]")
    if file.suffix == ".csv":
        return list(csv.DictReader(file.read_text().splitlines()))
    if file.suffix == ".mp4":
        with av.open(file) as film:
            images = [frame.to_ndarray() for frame in film.decode(video=0)]
        return [[*image.shape, hashlib.sha256(image.data).hexdigest()] for image in images]
    if file.suffix == ".mcap":
        with file.open("rb") as stream:
            ticks = make_reader(stream).iter_messages(TABLE["topics"])
            return [json.loads(message.data) for _, _, message in ticks]
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
