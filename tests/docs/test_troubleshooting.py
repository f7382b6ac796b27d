"""The program prints every message that the page quotes."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from typing import Final

import pytest

from tests.docs.documents import ROOT

PAGE: Final = (ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
MESSAGES: Final = re.findall(r"^\*\*`(.+)`\*\*$", PAGE, re.MULTILINE)
ROOMS: Final = ("uav_bt", "behaviours", "perception", "sim_bridge")
GAP: Final = "\0"  # placeholder for values in a message


def templates_of(tree: ast.AST) -> Iterator[str]:
    """Yield the texts of a module, with gaps where values are put in."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value
        elif isinstance(node, ast.JoinedStr):
            yield "".join(
                str(part.value) if isinstance(part, ast.Constant) else GAP for part in node.values
            )


@cache
def templates() -> frozenset[str]:
    """Return all texts of the packages, and those of the installer."""
    found = {
        text
        for room in ROOMS
        for path in (ROOT / room).rglob("*.py")
        for text in templates_of(ast.parse(path.read_text(encoding="utf-8")))
    }
    installer = (ROOT / "tools" / "install.sh").read_text(encoding="utf-8")
    lines = re.sub(r'"\s*\\\n\s*"', " ", installer).splitlines()  # continued strings
    return frozenset(found | {re.sub(r"\$\w+", GAP, line) for line in lines})


def printed(message: str) -> bool:
    """Return whether a text of the source contains the message, or matches its beginning.

    `...` in the message matches any text; a gap in the text matches any words of the message.
    """
    quoted = re.compile(".*?".join(re.escape(part) for part in message.split("...")), re.DOTALL)
    if any(quoted.search(text) for text in templates()):
        return True
    for text in templates():
        constant = re.sub(GAP, "", text)
        filled = ".+?".join(re.escape(part) for part in text.split(GAP))
        if len(constant) > len(message) / 2 and re.match(filled, message):
            return True
    return False


@pytest.mark.parametrize("message", MESSAGES)
def test_a_message_is_printed(message: str) -> None:
    assert len(message.replace("...", "").strip()) > 5
    assert printed(message)


def test_a_message_that_is_not_printed_would_be_found() -> None:
    assert not printed("the drone has no wings")
    assert not printed("unknown bird '...'")


def test_there_is_a_cure_for_each() -> None:
    assert len(MESSAGES) >= 20
    assert len(set(MESSAGES)) == len(MESSAGES)
    for block in PAGE.split("\n\n"):
        if block.startswith("**`"):
            assert len(block.splitlines()) > 1, block
