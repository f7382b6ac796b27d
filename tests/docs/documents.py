"""Parser of a page: its blocks in order, their files and their commands."""

from __future__ import annotations

import ast
import inspect
import re
import shlex
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import click

from uav_bt.cli.root import uav_bt

ROOT: Final = Path(__file__).parents[2]
FENCE: Final = re.compile(r"^( *)```([^\n`]*)\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)
# A block is a file if its first line is a comment that contains only the file's name ...
HEADING: Final = re.compile(r"(?:# |<!-- )([\w./-]+\.\w+)(?: -->)?\n")
# ... or if the sentence before the block names the file.
SAVED: Final = re.compile(r"[Ss]ave (?:this|it)\s+as\s+`([\w./-]+)`[^`]*\Z")
# Commands of a block that is marked by an indentation of four spaces or more.
INDENTED: Final = re.compile(r"^ {4,}(?:\$ |uav-bt |pip |python |make |pytest )", re.MULTILINE)
INLINE: Final = re.compile(r"(?<!`)`(uav-bt [^`]+)`(?!`)")
INLINE_SCRIPT: Final = re.compile(r"(?<!`)`(python (?:-m\s+benchmarks[. ]|benchmarks/)[^`]+)`(?!`)")


@dataclass(frozen=True)
class Block:
    """The text between two fences."""

    kind: str
    text: str
    line: int  # number of its first line in the page
    file: str | None  # where the reader saves it


@dataclass(frozen=True)
class Command:
    """One command of a shell block."""

    words: tuple[str, ...]
    line: int
    output: str | None = None  # the file after `>`

    def __str__(self) -> str:
        return shlex.join(self.words)


def blocks(page: str) -> Iterator[Block]:
    """Yield a page's blocks in order."""
    end = 0
    for found in FENCE.finditer(page):
        indent, kind, text = found.groups()
        text = re.sub(f"^{indent}", "", text, flags=re.MULTILINE)
        heading, saved = HEADING.match(text), SAVED.search(page[end : found.start()])
        file = heading[1] if heading else saved[1] if saved else None
        yield Block(kind, text, page.count("\n", 0, found.start()) + 2, file)
        end = found.end()


def prose(page: str) -> str:
    """Return a page without its blocks."""
    return FENCE.sub("", page)


def commands(block: Block, folder: Path) -> Iterator[Command]:
    """Yield a shell block's commands; unquoted patterns are replaced by the files in a folder."""
    text = re.sub(r"\\\n\s*", lambda cut: " " * len(cut[0]), block.text)
    for number, line in enumerate(text.splitlines(), block.line):
        words = shlex.split(line, comments=True)
        output = None
        if len(words) > 2 and words[-2] == ">":
            output, words = words[-1], words[:-2]
        if words:
            expanded = [each for word in words for each in _expanded(word, line, folder)]
            yield Command(tuple(expanded), number, output)


def _expanded(word: str, line: str, folder: Path) -> list[str]:
    if not re.search(r"[*?]", word) or f'"{word}"' in line or f"'{word}'" in line:
        return [word]
    return sorted(str(path.relative_to(folder)) for path in folder.glob(word)) or [word]


def resolve(words: tuple[str, ...]) -> tuple[click.Command, click.Context, list[str]]:
    """Return the click command that words call, its parent's context, and the remaining words.

    Raises:
        UsageError: the command is unknown, or an option of a group is unknown.
    """
    command: click.Command = uav_bt
    context, left = click.Context(uav_bt, info_name="uav-bt"), list(words[1:])
    while isinstance(command, click.Group) and left and not left[0].startswith("-"):
        child = command.get_command(context, left[0])
        if child is None:
            raise click.UsageError(f"there is no command {left[0]!r} in {' '.join(words)}")
        parent, command, left = context, child, left[1:]
        context = click.Context(command, info_name=words[-len(left) - 1], parent=parent)
    return command, context.parent or context, left


def check_inline(text: str) -> None:
    """Check the command and the options of a command in the prose, whose arguments may be `FILE`.

    Raises:
        UsageError: the command or an option is unknown.
    """
    words = tuple(text.split())
    command, _, left = resolve(tuple(word for word in words if word != "..."))
    known = {name for each in command.params for name in each.opts} | {"--help", "-h"}
    for word in left:
        if word.startswith("--") and word.partition("=")[0] not in known:
            raise click.UsageError(f"`{text}`: {command.name} has no option {word}")


def check_script(command: Command) -> None:
    """Check a `python FILE ...` command: the file exists and has each option."""
    script, *words = command.words[1:]
    if script == "-m":
        module, *words = words
        if not module.startswith("benchmarks."):
            return
        script = f"{module.replace('.', '/')}.py"
        if not (ROOT / script).is_file():
            script = script.replace(".py", "/__main__.py")
    source = (ROOT / script).read_text(encoding="utf-8")
    for word in words:
        if word.startswith("--"):
            assert f'"{word}"' in source, f"{script} has no option {word}"


def check_target(target: str) -> None:
    """Check that the makefile has a target."""
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert re.search(rf"^{target}:", makefile, re.MULTILINE), f"make has no target {target}"


def check_install(words: tuple[str, ...]) -> None:
    """Check the extras and the constraints of a `pip install` command."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for word in words:
        if word.startswith("constraints"):
            assert (ROOT / word).is_file(), f"{word} is not there"
        for extras in re.findall(r"\[([\w,]+)\]", word):
            unknown = set(extras.split(",")) - set(project["optional-dependencies"])
            assert not unknown, f"no extra {unknown}"


def check_python(block: Block, names: dict[str, Any]) -> None:
    """Check a Python block without running it: its imports work, its calls have valid arguments.

    Args:
        block: the block.
        names: the namespace after the earlier blocks.
    """
    tree = ast.parse(block.text)
    for node in tree.body:
        if isinstance(node, ast.Import | ast.ImportFrom):
            exec(compile(ast.Module([node], []), "page", "exec"), names)  # noqa: S102  # our page
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and (called := _called(node.func, names)) is not None:
            keywords = {word.arg: None for word in node.keywords if word.arg}
            inspect.signature(called).bind(*[None] * len(node.args), **keywords)


def _called(node: ast.expr, names: dict[str, Any]) -> Any:
    """Return the object of a dotted name, None if only running the block would create it."""
    if isinstance(node, ast.Attribute):
        owner = _called(node.value, names)
        return None if owner is None else getattr(owner, node.attr)
    return names.get(node.id) if isinstance(node, ast.Name) else None
