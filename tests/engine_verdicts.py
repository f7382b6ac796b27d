"""Record what a running BehaviorTree.CPP says of tree files, for `tests/data/engine_4_8.jsonl`.

The engine is no dependency of this project. Its release 4.8.2 comes with the package
`behaviortreepy` 0.1.4, in an environment of its own:

    pip install --no-deps behaviortreepy==0.1.4
    python tests/engine_verdicts.py tests/data/engine_4_8.jsonl

reads lines with `xml` from the file, and writes them back with `taken`. Every file's main tree is
called `Main`. Nothing is ticked: a file is taken when its tree can be made.
"""

from __future__ import annotations

import importlib
import json
import sys
from pathlib import Path
from typing import Any


def is_taken(engine: Any, xml: str) -> bool:
    """Return whether the engine makes the tree `Main` of a file."""
    factory = engine.BehaviorTreeFactory()
    try:
        factory.register_behavior_tree_from_text(xml)
        factory.create_tree("Main")
    except (RuntimeError, IndexError):
        return False
    return True


def main() -> None:
    """Record the verdicts of a file's lines."""
    path = Path(sys.argv[1])
    engine = importlib.import_module("behaviortreepy")
    lines = [json.loads(line)["xml"] for line in path.read_text(encoding="utf-8").splitlines()]
    verdicts = [{"xml": xml, "taken": is_taken(engine, xml)} for xml in lines]
    text = "".join(json.dumps(each, sort_keys=True) + "\n" for each in verdicts)
    path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
