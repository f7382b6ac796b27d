"""The content of a YAML file as plain values with their lines; bounded, also with aliases.

`BoundedLoader` reads all YAML of the program. Its numbers are those of YAML 1.2: 010 is ten, 1e3 is
a thousand, 1:30 and 1_0 are texts.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Final

import yaml

Steps = tuple[str | int, ...]  # path to a value: keys of mappings and indices of lists

_MAX_SIZE: Final = 500_000  # characters and values; a few lines of nested aliases can make billions
_MAX_DEPTH: Final = 40
_MAX_SHOWN: Final = 80  # characters of a value in a message
_MAX_INTEGER: Final = 2**63
_TAG: Final = "tag:yaml.org,2002:"
_INTEGER: Final = re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT: Final = re.compile(
    r"(?:[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?|"
    r"[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN))\Z"
)


class BoundedLoader(yaml.SafeLoader):
    """PyYAML's safe loader with bounded depth, as it recurses, and the numbers of YAML 1.2."""

    yaml_implicit_resolvers = {  # noqa: RUF012  (as PyYAML declares it)
        first: [rule for rule in rules if rule[0] not in {f"{_TAG}int", f"{_TAG}float"}]
        for first, rules in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }
    _depth = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """Compose a node; refuse one that is nested too deeply."""
        if self._depth > _MAX_DEPTH:
            mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
            problem = f"nested deeper than {_MAX_DEPTH}"
            raise yaml.composer.ComposerError(problem=problem, problem_mark=mark)
        self._depth += 1
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def integer(self, node: yaml.ScalarNode) -> int:
        """Return the whole number of a node."""
        if not _INTEGER.fullmatch(node.value):
            raise RefusedValueError(node, (), f"not valid YAML: got {_shown(node)}")
        return int(node.value, {"0o": 8, "0x": 16}.get(node.value[:2], 10))


BoundedLoader.add_constructor(f"{_TAG}int", BoundedLoader.integer)
BoundedLoader.add_implicit_resolver(
    f"{_TAG}int", re.compile(rf"(?:{_INTEGER.pattern})\Z"), list("-+0123456789")
)
BoundedLoader.add_implicit_resolver(f"{_TAG}float", _FLOAT, list("-+.0123456789"))


def plain_yaml(path: Path) -> Any:
    """Return the values of a YAML file of ours, without a form."""
    return BoundedLoader(path.read_text(encoding="utf-8")).get_single_data()


class RefusedValueError(yaml.MarkedYAMLError):
    """A value that is refused for every form."""

    def __init__(self, node: yaml.Node, steps: Steps, text: str) -> None:
        super().__init__(problem=located(steps, text), problem_mark=node.start_mark)


class Places:
    """Line and text of each value of a file."""

    def __init__(self) -> None:
        self._left = _MAX_SIZE
        self._loader = BoundedLoader("")
        self._found: dict[Steps, tuple[int, str]] = {(): (1, "nothing")}  # line, in words

    def line(self, steps: Steps) -> int:
        """Return the line of a value, or of the last existing step to it."""
        return self._found[self.known(steps)][0]

    def shown(self, steps: Steps) -> str:
        """Return the text of a value."""
        return self._found[self.known(steps)][1]

    def known(self, steps: Steps) -> Steps:
        """Return the existing steps, without missing keys and pydantic's names of branches."""
        known: Steps = ()
        for step in steps:
            known = (*known, step) if (*known, step) in self._found else known
        return known

    def plain(self, node: yaml.Node, steps: Steps, key: yaml.Node | None = None) -> Any:
        """Return a node as numbers, texts, lists and mappings only."""
        if len(steps) > _MAX_DEPTH:  # an alias that contains itself
            raise RefusedValueError(node, (), f"nested deeper than {_MAX_DEPTH}, aliases unfolded")
        self._left -= 1 + len(steps) + (len(node.value) if isinstance(node, yaml.ScalarNode) else 0)
        if self._left < 0:
            raise RefusedValueError(
                node, (), f"larger than {_MAX_SIZE} characters, aliases unfolded"
            )
        self._found[steps] = ((key or node).start_mark.line + 1, _shown(node))
        if isinstance(node, yaml.ScalarNode):
            return self._scalar(node, steps)
        if node.tag not in {f"{_TAG}map", f"{_TAG}seq"}:
            raise RefusedValueError(node, (), f"not valid YAML: the tag {node.tag} is not allowed")
        if isinstance(node, yaml.SequenceNode):
            return [self.plain(item, (*steps, index)) for index, item in enumerate(node.value)]
        content: dict[str, Any] = {}
        for name, item in node.value:
            if not isinstance(name, yaml.ScalarNode):
                raise RefusedValueError(name, steps, "expected a name before the colon")
            if name.value in content:
                raise RefusedValueError(name, steps, f"the key '{name.value:.80}' is given twice")
            content[name.value] = self.plain(item, (*steps, name.value), name)
        return content

    def _scalar(self, node: yaml.ScalarNode, steps: Steps) -> Any:
        try:
            value = self._loader.construct_object(node)
        except RefusedValueError as error:
            raise RefusedValueError(node, steps, str(error.problem)) from error
        except yaml.YAMLError:
            raise
        except Exception as error:  # PyYAML passes on Python's, as for 45 May
            known = f"{error}, " if isinstance(error, ValueError) else "not valid YAML: "
            raise RefusedValueError(node, steps, f"{known:.80}got {_shown(node)}") from error
        fits = value is None or isinstance(value, bool | int | float | str)
        if fits and not (isinstance(value, int) and abs(value) >= _MAX_INTEGER):
            return value
        expected = "a number below 2**63" if fits else "a number, a text, true or false"
        raise RefusedValueError(node, steps, f"expected {expected}, got {_shown(node)}")


def _shown(node: yaml.Node) -> str:
    if isinstance(node, yaml.ScalarNode):
        rest = "..." if len(node.value) > _MAX_SHOWN else ""
        return f"'{node.value[:_MAX_SHOWN]}'{rest}" if node.value else "nothing"
    return f"a list of {len(node.value)}" if isinstance(node, yaml.SequenceNode) else "a mapping"


def located(steps: Steps, text: str) -> str:
    """Return a message with its place."""
    where = "".join(f"[{step}]" if isinstance(step, int) else f".{step:.80}" for step in steps)[1:]
    return text if not where or text.startswith(where) else f"{where}: {text}"
