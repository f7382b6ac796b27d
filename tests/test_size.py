"""The house stays small: ceilings of lines, for each package, and of what hides lines."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from benchmarks.size import ROOT, lines, package_of, tracked

# Lines as `wc -l` counts them. A cut lowers its ceiling; a commit that raises one says why.
CEILINGS = {}
SLACK = 40  # a ceiling stands at most this far above its package
BYTES_A_LINE = 41  # of all Python
DATA_ROWS = 3_500  # of tests/data: what a reader of the tests must read as well
OTHER_ROWS = 3_284  # of text elsewhere that is neither Python nor Markdown
DRAWN_OR_LEARNED = {".onnx", ".safetensors", ".svg", ".png", ".jpg", ".webp"}


def rows(paths: list[Path]) -> int:
    """Return the rows of text that is neither Python nor Markdown; labs and drawings are apart."""
    return sum(
        lines(path)
        for path in paths
        if path.suffix not in {".py", ".md", *DRAWN_OR_LEARNED} and path.parts[0] != "labs"
    )


def test_every_package_stays_below_its_ceiling() -> None:
    size = Counter[str]()
    for path in tracked("*.py"):
        size[package_of(path)] += lines(path)
    assert size.keys() == CEILINGS.keys()
    above = {name: count for name, count in size.items() if count > CEILINGS[name]}
    assert above == {}, "larger than the ceiling"
    below = {name: count for name, count in size.items() if count < CEILINGS[name] - SLACK}
    assert below == {}, "smaller: lower the ceiling, so that the room is not filled again"


def test_lines_are_not_hidden_in_longer_ones() -> None:
    texts = [(ROOT / path).read_bytes() for path in tracked("*.py")]
    assert sum(map(len, texts)) < BYTES_A_LINE * sum(text.count(b"\n") for text in texts)
    hidden = [text for text in texts if b"noqa: " + b"E501" in text or b"# fmt: " + b"off" in text]
    assert hidden == []


def test_lines_are_not_hidden_in_data() -> None:
    data = tracked("tests/data")
    assert rows(data) <= DATA_ROWS
    assert rows([path for path in tracked() if path not in set(data)]) <= OTHER_ROWS
