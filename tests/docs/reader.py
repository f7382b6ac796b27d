"""Simulated reader who follows a page step by step in a temporary folder."""

from __future__ import annotations

import importlib
import os
import re
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import click
import pytest
import yaml
from click.core import ParameterSource
from click.testing import CliRunner, Result

from sim_bridge.twin.scene_file import load_scene
from tests.docs.documents import (
    ROOT,
    Block,
    Command,
    blocks,
    check_install,
    check_python,
    check_script,
    check_target,
    commands,
    resolve,
)
from tests.worlds.processes import python
from uav_bt.app.site import load_site
from uav_bt.cli import declare
from uav_bt.cli.root import uav_bt
from uav_bt.cli.shared import registry_with
from uav_bt.tree import NodeRegistry, parse_tree
from uav_bt.tree.dry_run import read_script
from uav_bt.tree.loading.loader import check_file
from uav_bt.tree.shipped import tree_files

# Functions that load the files of options.
LOADERS: Final[dict[str, Callable[[Path], object]]] = {"site": load_site, "script": read_script}
# Arguments that name an output file, although their click type does not show it.
WRITES: Final = {("new", "file")}


class Reader:
    """Saves the files of a page, runs its Python in one namespace and its commands in order.

    Args:
        page: the page's path in the repository.
        folder: the working folder.
        monkeypatch: puts packages that the page installs on the path.
        left_out: returns whether a command is only parsed.
        added: further arguments for a command when it is run.
        long_python: Python that is not run.
    """

    def __init__(
        self,
        page: str,
        folder: Path,
        monkeypatch: pytest.MonkeyPatch,
        *,
        left_out: Callable[[str], bool],
        added: Mapping[str, tuple[str, ...]],
        long_python: tuple[str, ...],
    ) -> None:
        self.page = page
        self.folder = folder
        self._monkeypatch = monkeypatch
        self._left_out = left_out
        self._added = added
        self._long_python = long_python
        self._names: dict[str, Any] = {"__name__": "page"}
        self._passed: set[Path] = set()  # files of tests that have passed
        self._unwritten: set[Path] = set()  # placeholders for outputs of commands that were not run

    def follow(self) -> None:
        """Follow the page from top to bottom, then run the tests that it wrote."""
        for block in blocks((ROOT / self.page).read_text(encoding="utf-8")):
            try:
                self._block(block)
            except (AssertionError, click.ClickException) as error:
                message = getattr(error, "message", error)
                pytest.fail(f"{self.page}:{block.line}: {message}", pytrace=False)
        if left := sorted(set(self._tests()) - self._passed):
            assert "passed" in self._pytest(*map(str, left))

    def _block(self, block: Block) -> None:
        if block.file is not None:
            path = self.folder / block.file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block.text, encoding="utf-8")
        match block.kind:
            case "sh":
                for command in commands(block, self.folder):
                    self._command(command)
            case "console":
                self._console(block)
            case "python" if block.file is None:
                self._python(block)
            case "xml" if block.file is None:
                parse_tree(block.text, NodeRegistry.installed())
            case "yaml":
                assert isinstance(yaml.safe_load(block.text), dict)
            case "python" | "xml" | "toml" | "csv" if block.file is not None:
                pass  # used by later blocks
            case "text":
                pass  # output of a program
            case _:
                raise AssertionError(f"a block of an unknown kind: '{block.kind}'")

    def _python(self, block: Block) -> None:
        if any(call in block.text for call in self._long_python):
            check_python(block, self._names)
            return
        before = set(self._names)
        exec(compile(block.text, f"{self.page}:{block.line}", "exec"), self._names)  # noqa: S102
        for name in self._names.keys() - before:
            if name.startswith("test_"):
                self._names[name]()

    def _tests(self) -> list[Path]:
        """Return the files of tests that the page wrote; `examples` is a link into the checkout."""
        files = self.folder.rglob("test_*.py")
        return [file for file in files if not file.is_relative_to(self.folder / "examples")]

    def _pytest(self, *words: str, codes: tuple[int, ...] = (0,)) -> str:
        """Run `pytest`; tests that fly and have passed are not run again."""
        written = self._tests()
        flown = [file for file in self._passed if "app.fly(" in file.read_text(encoding="utf-8")]
        left_out = [f"--ignore={path}" for path in ("examples", *flown)]
        kept = os.environ.get("PYTHONPATH", "")
        path = os.pathsep.join(filter(None, [str(self.folder), str(self.folder / ".meta"), kept]))
        result = python(
            *("-m", "pytest", "-p", "no:cacheprovider", "-p", "no:xdist", *left_out, *words),
            folder=self.folder,
            environment={"PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"},
        )
        assert result.returncode in codes, result.stdout + result.stderr
        assert "warnings summary" not in result.stdout, result.stdout
        if " passed" in result.stdout and " failed" not in result.stdout:
            named = {self.folder / word for word in words if (self.folder / word).is_file()}
            self._passed.update(named or written)
        return result.stdout

    # --- commands ---------------------------------------------------------------------------------

    def _console(self, block: Block) -> None:
        """Run the command of a block and compare its output with the block, with wildcards."""
        first, *expected = block.text.splitlines()
        only = Block("sh", first.removeprefix("$ "), block.line, None)
        (command,) = commands(only, self.folder)
        if command.words[0] == "pytest":
            printed = self._pytest(*command.words[1:], codes=(0, 1))
        else:
            printed = self._run(command.words, codes=(0, 1, 2)).output
        try:
            pytest.LineMatcher(printed.splitlines()).fnmatch_lines(expected)
        except pytest.fail.Exception as error:
            raise AssertionError(f"{command} prints something else: {error}") from error

    def _command(self, command: Command) -> None:
        words, program = command.words, Path(command.words[0]).name
        match program:
            case "" if words[1].endswith("bin/activate"):
                pass  # `. .venv/bin/activate`
            case "make":
                check_target(words[1])
            case "pip" if words[-2:] == ("-e", "."):
                self._install()
            case "pip":
                check_install(words)
            case "uav-bt":
                self._uav_bt(command)
            case "pytest" if not self._left_out(str(command)):
                self._pytest(*words[1:])
            case "mkdir" | "cp":
                subprocess.run(words, check=True, cwd=self.folder)  # noqa: S603  # our own page
            case _:
                if program.startswith("python"):
                    check_script(command)
                assert self._left_out(str(command)), f"unknown command: {command}"

    def _install(self) -> None:
        """Install the page's package like `pip install -e .`, but without pip."""
        code = "import setuptools.build_meta as b; b.prepare_metadata_for_build_editable('.meta')"
        (self.folder / ".meta").mkdir()
        assert python("-c", code, folder=self.folder).returncode == 0
        for folder in (self.folder, self.folder / ".meta"):
            self._monkeypatch.syspath_prepend(folder)
        importlib.invalidate_caches()

    def _uav_bt(self, command: Command) -> None:
        written = self._parse(command)
        if self._left_out(str(command)):
            for path in written:
                path.parent.mkdir(parents=True, exist_ok=True)
                path.touch()
            self._unwritten |= set(written)
            return
        added = next(
            (more for key, more in self._added.items() if str(command).startswith(key)), ()
        )
        differs = command.words[1] == "replay"  # exit code 1: the files differ, as expected
        result = self._run((*command.words, *added), codes=(0, 1) if differs else (0,))
        if command.output:
            (self.folder / command.output).write_text(result.stdout, encoding="utf-8")

    def _run(self, words: tuple[str, ...], codes: tuple[int, ...] = (0,)) -> Result:
        result = CliRunner().invoke(uav_bt, list(words[1:]))
        assert result.exit_code in codes, f"{' '.join(words)}: {result.output}"
        return result

    def _parse(self, command: Command) -> list[Path]:
        """Parse a command with click, and check that its input files exist.

        Returns:
            The files that it writes.
        """
        called, parent, left = resolve(command.words)
        context = called.make_context(called.name, left, parent=parent)
        written = [self.folder / command.output] if command.output else []
        for param in called.params:
            name = str(param.name)
            value = context.params.get(name)
            for each in value if isinstance(value, tuple | list) else (value,):
                if each is None:
                    continue
                if name in {"tree", "trees"}:
                    given = context.params
                    registry = registry_with(
                        leaves=given.get("leaves", ()), palette=given.get("palette")
                    )
                    for file in tree_files(each):
                        assert not check_file(file, registry), f"{file} is refused"
                elif name in {"scene", "scenes"} and not re.search(r"[*,]", str(each)):
                    load_scene(each)
                elif isinstance(param.type, click.Path) and isinstance(each, str | Path):
                    if _writes(called, param):
                        written += [self.folder / file for file in _files(each, param.type)]
                    elif context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
                        self._read(name, Path(each))
        return written

    def _read(self, name: str, path: Path) -> None:
        there = [home / path for home in (self.folder, ROOT) if (home / path).exists()]
        assert there, f"{path} is not there: nothing saved, wrote or brought it"
        if name in LOADERS and there[0] not in self._unwritten:
            LOADERS[name](there[0])


def _writes(command: click.Command, param: click.Parameter) -> bool:
    about = command.about[str(param.name)] if isinstance(command, declare.Command) else None
    made = about is not None and about.path in {"written", "folder"}
    return made or (command.name, param.name) in WRITES


def _files(path: Path, kind: click.Path) -> list[Path]:
    """Return the files that a command writes for a path; a network has two."""
    if not kind.file_okay:
        return [path / ".kept"]
    return [path, path.with_suffix(".onnx")] if path.suffix == ".safetensors" else [path]
