"""Measure the language server's times, and send it damaged documents.

    python -m benchmarks.language_server

Opens a file of 1,000 nodes, types letters into it, and measures until the diagnostics of that very
text are back; then completion and hover, at rest and right behind a keystroke. Then mutated files
go through the server (open, complete, hover, outline, format) and through the formatter, and whole
files with added blanks and comments through the formatter alone. The formatter must not change its
results, and a formatted file has the same findings, or loads to the same nodes, which tick as
before.
"""

from __future__ import annotations

import argparse
import logging
import random
import re
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lsprotocol import types

from tests.conformance import REGISTRY
from tests.uav_bt.lsp.editor import Editor, applied
from tests.uav_bt.tree.test_mutations import SOURCES, mutated
from tests.worlds.trees import World
from uav_bt.board import MISSION_KEYS
from uav_bt.errors import NodeFailedError, TreeError
from uav_bt.tree import parse_tree
from uav_bt.tree.editing.layout import format_source

URI = "file:///nowhere/mission.xml"
TICKS = 5
BETWEEN = re.compile(r"(?<=>)\s*(?=<)")
STREWN = ("", " ", "\n", "\n\n\n", "\t", "\n<!-- a -->\n", "<!-- a\n\tb\n -->", "\n\n  <!---->\n\n")
PLACE = re.compile(r"(?:<text>)?:\d+:\d+")
LEAF = '      <Explore name="look_{n}" policy="corridor" _skipIf="rounds &gt; {n}"/>\n'


def mission(nodes: int) -> str:
    """Return a file with a number of nodes: branches of twenty under one sequence."""
    parts = ['<root BTCPP_format="4">\n  <BehaviorTree ID="M">\n  <Sequence>\n']
    parts.append('    <Script code="rounds := 0"/>\n')
    for first in range(2, nodes, 20):
        leaves = (LEAF.format(n=n) for n in range(first, min(first + 19, nodes - 1)))
        parts.append(f"    <Fallback>\n{''.join(leaves)}    </Fallback>\n")
    return "".join([*parts, "  </Sequence>\n  </BehaviorTree>\n</root>\n"])


def memory_mb(process: int) -> float:
    """Return a process' resident memory."""
    status = Path(f"/proc/{process}/status").read_text(encoding="ascii")
    return int(status.partition("VmRSS:")[2].split()[0]) / 1024


def expect(good: object, text: str) -> None:
    """End with the document that something is wrong with."""
    if not good:
        raise SystemExit(f"not as expected with this document:\n{text}")


def print_times(what: str, seconds: list[float]) -> None:
    """Print the median and the worst of measured times."""
    median, worst = statistics.median(seconds) * 1e3, max(seconds) * 1e3
    print(f"{what:34} median {median:7.1f} ms   max {worst:7.1f} ms   n {len(seconds)}")


def time_typing(editor: Editor, text: str, times: int) -> None:
    """Type letters into a node's name and into a policy's, one by one, and measure."""
    editor.open(URI, text)
    editor.diagnostics(URI)
    line = text[: text.index("look_500")].count("\n")
    words = text.splitlines()[line]
    took: dict[str, list[float]] = {}

    def clocked(what: str, answer: Callable[[], Any]) -> Any:
        began = time.perf_counter()
        answered = answer()
        took.setdefault(what, []).append(time.perf_counter() - began)
        return answered

    def typed(column: int) -> list[types.Diagnostic]:
        start = types.Position(line, column)
        change = types.TextDocumentContentChangePartial(types.Range(start, start), "x")
        editor.change(URI, change)
        return editor.diagnostics(URI)

    name, policy = words.index("look_500"), words.index("corridor")
    for number in range(times):
        found = clocked("keystroke to no diagnostics", lambda at=name + number: typed(at))
        expect(not found, text)
    policy += times
    for number in range(times):
        found = clocked("keystroke to diagnostics", lambda at=policy + number: typed(at))
        expect(any("unknown" in one.message for one in found), text)
        expect(clocked("completion of a value", lambda: editor.complete(URI, line, policy)), text)
        expect(clocked("completion of a node", lambda: editor.complete(URI, line, 6)), text)
        expect(clocked("hover", lambda: editor.hover(URI, line, 9)), text)
    for _ in range(times):
        start = types.Position(line, name)
        change = types.TextDocumentContentChangePartial(types.Range(start, start), "x")
        editor.change(URI, change)
        behind = "completion behind a keystroke"
        policy += 1
        expect(clocked(behind, lambda at=policy: editor.complete(URI, line, at)), text)
        editor.diagnostics(URI)
    editor.close_document(URI)
    editor.diagnostics(URI)
    for what, seconds in took.items():
        print_times(what, seconds)


def behaviour(source: bytes) -> list[object]:
    """Return the behaviour of a file: why it is refused, or its nodes and their answers."""
    world = World()
    for key in MISSION_KEYS:
        world.board.declare(key)
    try:
        tree = parse_tree(source, REGISTRY)
    except TreeError as error:
        return sorted(PLACE.sub("", finding) for finding in error.findings)
    tree.setup(world.context)
    for name in ("a", "b", "c", "mode"):
        tree.variables[name] = 1
    seen: list[object] = [type(node).__name__ for node in tree.nodes()]
    try:
        for _ in range(TICKS):
            answer = tree.tick()
            seen += [answer, world.events(), [(node.path, node.status) for node in tree.nodes()]]
    except NodeFailedError as error:
        seen.append(str(error))
    tree.halt()
    return [*seen, world.events()]


def laid_out(text: str) -> tuple[bytes, bool]:
    """Return a file's text in the one layout, and whether it loads.

    Raises:
        TreeError: the file is not well-formed XML.
    """
    once = format_source(text.encode(), Path(URI))
    expect(format_source(once, Path(URI)) == once, text)
    before = behaviour(text.encode())
    expect(behaviour(once) == before, text)
    return once, any(not isinstance(each, str) for each in before)


def strew(files: int) -> None:
    """Lay whole files out that have blanks and comments between their tags."""
    random_ = random.Random(21)  # noqa: S311 - no secret
    ticked = 0
    for _ in range(files):
        text = BETWEEN.sub(lambda _: random_.choice(STREWN), random_.choice(SOURCES))
        ticked += laid_out(text)[1]
    print(f"{files} files with blanks and comments: formatted, {ticked} load, and tick as before")


def fuzz(editor: Editor, files: int) -> None:
    """Send mutated files through server and formatter."""
    random_ = random.Random(20)  # noqa: S311 - no secret
    good, ticked = 0, 0
    for number in range(files):
        text = mutated(random_)
        uri = f"{URI}-{number % 20}"
        editor.open(uri, text)
        editor.diagnostics(uri)
        lines = text.splitlines() or [""]
        line = random_.randrange(len(lines))
        column = random_.randint(0, len(lines[line]))
        editor.complete(uri, line, column)
        editor.hover(uri, line, column)
        editor.define(uri, line, column)
        which = types.TextDocumentIdentifier(uri)
        editor.ask("text_document_document_symbol", types.DocumentSymbolParams(which))
        edits = editor.format(uri)
        try:
            once, ticks = laid_out(text)
        except TreeError:
            expect(not edits, text)
        else:
            good += 1
            ticked += ticks
            expect(not text.isascii() or applied(text, edits).encode() == once, text)
        editor.close_document(uri)
        editor.diagnostics(uri)
        expect(editor.alive, text)
    print(f"{files} mutated files: server alive, {good} formatted, the others refused")
    print(f"{ticked} of the formatted load, and tick as before; the others are refused as before")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--nodes", type=int, default=1000)
    parser.add_argument("--keys", type=int, default=50)
    parser.add_argument("--files", type=int, default=10_000)
    given = parser.parse_args()
    logging.getLogger("uav_bt").setLevel(logging.ERROR)  # mutated files have many warnings
    editor = Editor()
    print(f"memory, nothing open              {memory_mb(editor.process_id):.0f} MB")
    time_typing(editor, mission(given.nodes), given.keys)
    print(f"memory, after {given.nodes} nodes {memory_mb(editor.process_id):.0f} MB")
    fuzz(editor, given.files)
    strew(given.files)
    print(f"memory, after all                 {memory_mb(editor.process_id):.0f} MB")
    print(f"exit code of the server           {editor.close()}")


if __name__ == "__main__":
    main()
