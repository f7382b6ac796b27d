"""An installed program, driven by its command line, and the files that it writes."""

from __future__ import annotations

import csv
import hashlib
import json
import os
import shlex
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

import av
from mcap.reader import make_reader

Done = subprocess.CompletedProcess[str]
WARM = Path(__file__).with_name("warm.py")
TOPICS = ["/drone/truth", "/mission/commands", "/mission/tick"]


class Program:
    """A worktree of this repository and the Python that runs it."""

    def __init__(self, root: Path, scratch: Path, python: str = sys.executable) -> None:
        self.root, self.python = root.resolve(), python
        info = scratch / "uav_bt-0.dist-info"  # the plug-ins of this worktree, not the installed
        info.mkdir()
        (info / "METADATA").write_text("Name: uav_bt\nVersion: 0\n")
        project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
        with (info / "entry_points.txt").open("w") as file:
            for group, entries in project["entry-points"].items():
                file.writelines([f"[{group}]\n", *(f"{key}={entries[key]}\n" for key in entries)])
        path = os.pathsep.join((str(self.root), str(scratch)))
        self.environment = {**os.environ, "PYTHONPATH": path, "NO_COLOR": "1", "COLUMNS": "100"}

    def start(self, *words: str | Path, cwd: Path, text: str = "") -> Done:
        """Run Python with these words until it ends."""
        return subprocess.run(  # noqa: S603
            [self.python, *words],
            cwd=cwd,
            env=self.environment,
            input=text,
            capture_output=True,
            text=True,
            check=False,
            timeout=900,
        )

    def many(self, lines: list[list[str]], cwd: Path) -> list[Done]:
        """Run short commands in a folder; the program is loaded once for all of them."""
        with tempfile.TemporaryDirectory() as name:
            codes = self.start(WARM, name, cwd=cwd, text=json.dumps(lines)).stdout.split()
            texts = [
                [Path(name, f"{number}.{stream}").read_text() for stream in (1, 2)]
                for number in range(len(lines))
            ]
        return [Done((), int(codes[n - len(lines)]), *text) for n, text in enumerate(texts)]

    def files(self, line: str, inputs: Path) -> dict[str, Any]:
        """Run commands, with && between, in an empty folder; return what they print and write."""
        with tempfile.TemporaryDirectory() as name:
            rows: dict[str, Any] = {}
            for one in line.replace("INPUTS", str(inputs)).split(" && "):
                words = shlex.split(one)
                rows[f"uav-bt {words[0]}"] = answer(
                    self.start("-m", "uav_bt", *words, cwd=Path(name))
                )
            files = sorted(path for path in Path(name).rglob("*") if path.is_file())
            return rows | {str(file.relative_to(name)): content(file) for file in files}


def answer(done: Done) -> dict[str, Any]:
    """Return the exit code, printed JSON, and the last words of a failed command."""
    said = (done.stderr.strip() or done.stdout.strip()).rpartition("\n")[2]
    return {
        "exit": done.returncode,
        "printed": json.loads(done.stdout) if done.stdout[:1] in "{[" and done.stdout else None,
        "said": said if done.returncode else "",
    }


def content(file: Path) -> Any:
    """Return what is compared of a file."""
    match file.suffix:
        case ".json":
            return json.loads(file.read_text())
        case ".jsonl":
            return [json.loads(line) for line in file.read_text().splitlines()]
        case ".csv":
            return list(csv.DictReader(file.read_text().splitlines()))
        case ".mp4":
            with av.open(file) as film:
                images = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
            return [f"{image.shape} {hashlib.sha256(image.data).hexdigest()}" for image in images]
        case ".mcap":
            ticks: dict[str, list[Any]] = {topic: [] for topic in TOPICS}
            with file.open("rb") as stream:
                for _, channel, message in make_reader(stream).iter_messages(TOPICS):
                    ticks[channel.topic].append(json.loads(message.data))
            return ticks
    return hashlib.sha256(file.read_bytes()).hexdigest()
