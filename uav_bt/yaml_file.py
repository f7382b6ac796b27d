"""YAML files as typed values: all problems of a file at once, each with its line.

The form of a file is a dataclass (or another type for pydantic). pydantic checks the values; PyYAML
gives the lines. Further checks go into `__post_init__` of the dataclass and raise ValueRangeError:

    @dataclass(frozen=True, kw_only=True)
    class Room:
        width_m: Annotated[float, Field(gt=0.0)]
        doors: tuple[str, ...] = ()

    room = read_yaml(Path("room.yaml"), Room, "room file").value

Numbers are those of YAML 1.2: 010 is ten, 1e3 is a thousand, 1:30 and 1_0 are texts.
"""

from __future__ import annotations

import functools
import json
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from operator import itemgetter
from pathlib import Path
from typing import Any, Final, Generic, TypeVar, cast

import yaml
from pydantic import ConfigDict, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from uav_bt.errors import FileError, InputError, did_you_mean
from uav_bt.files import did_you_mean_file, read_bounded, reading

T = TypeVar("T")
Steps = tuple[str | int, ...]  # path to a value: keys of mappings and indices of lists

MAX_BYTES: Final = 250_000  # a site or a scene has one thousand
_MAX_SIZE: Final = 500_000  # characters and values; a few lines of nested aliases can make billions
_MAX_DEPTH: Final = 40
_MAX_SHOWN: Final = 80  # characters of a value in a message
_TAG: Final = "tag:yaml.org,2002:"
_INTEGER: Final = re.compile(r"(?:[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+)\Z")
_FLOAT: Final = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?\Z")
_EXPECTED: Final = {
    **dict.fromkeys(("float_type", "float_parsing"), "a number"),
    **dict.fromkeys(("int_type", "int_parsing", "int_from_float"), "a whole number"),
    **dict.fromkeys(("list_type", "tuple_type"), "a list"),
    "bool_type": "true or false",
    "string_type": "a text",
    "finite_number": "a finite number",
    "path_type": "the path of a file",
}


def read_yaml(
    path: Path,
    form: type[T],
    what: str,
    *,
    failure: type[FileError] = FileError,
    remedy: str = "",
) -> YamlFile[T]:
    """Read a YAML file; JSON is YAML too. An empty file is an empty mapping.

    Args:
        path: the file. Validators find its folder in their context, as `folder`.
        form: the type of its content; other keys are refused.
        what: the kind of file, for messages.
        failure: class of the error, which has one line per problem.
        remedy: advice for a missing file.
    """
    with reading(path, failure):
        if not path.exists():
            advice = f"{did_you_mean_file(path)}{'; ' if remedy else ''}{remedy}"
            raise failure(path, f"there is no such {what}{advice}")
        text = read_bounded(path, MAX_BYTES, failure).decode()
    return YamlFile(path, text, form, failure)


def yaml_text(content: Any) -> str:
    """Return plain values as the text of a YAML file, which reads as the same values."""
    text: str = yaml.dump(content, Dumper=_Dumper, sort_keys=False)
    return text


class YamlFile(Generic[T]):
    """The content of a file, with the line of each value."""

    def __init__(
        self, path: Path, text: str, form: type[T], failure: type[FileError] = FileError
    ) -> None:
        self.path = path
        self._failure = failure
        self._left = _MAX_SIZE
        self._found: dict[Steps, tuple[int, str]] = {}  # line, text in messages
        self.value: T = self._validated(self._read(text), form)

    def line(self, *steps: str | int) -> int:
        """Return the line of a value, given by keys and indices."""
        return self._found[self._known(steps)][0]

    @contextmanager
    def at(self, *steps: str | int) -> Iterator[None]:
        """Give errors of a block the line of a value, given by keys and indices."""
        try:
            yield
        except InputError as error:
            raise self.error(str(error), *steps) from error

    def error(self, message: str, *steps: str | int) -> FileError:
        """Return an error about a value, given by keys and indices."""
        return self.errors([(steps, message)])

    def errors(self, found: Iterable[tuple[Steps, str]]) -> FileError:
        """Return one error about several values, in the order of their lines."""
        lines = [(self.line(*steps), _located(steps, text)) for steps, text in found]
        first, *others = sorted(dict.fromkeys(lines), key=itemgetter(0))
        texts = [first[1], *(f"{self.path}:{line}: {text}" for line, text in others)]
        return self._failure(self.path, "\n".join(texts), first[0])

    def _known(self, steps: Steps) -> Steps:
        """Return the existing steps, without missing keys and pydantic's names of branches."""
        known: Steps = ()
        for step in steps:
            known = (*known, step) if (*known, step) in self._found else known
        return known

    # --- the text as plain values -----------------------------------------------------------------

    def _read(self, text: str) -> Any:
        try:
            root = yaml.compose(text, Loader=_Loader)
            if root is not None:
                return self._plain(root, ())
        except yaml.MarkedYAMLError as error:
            line = None if error.problem_mark is None else error.problem_mark.line + 1
            raise self._failure(self.path, f"not valid YAML: {error.problem}", line) from error
        except yaml.reader.ReaderError as error:
            line = text.count("\n", 0, error.position) + 1
            reason = f"the character #x{error.character:04x} is not allowed"
            raise self._failure(self.path, f"not valid YAML: {reason}", line) from error
        except RecursionError as error:
            raise self._failure(self.path, f"nested deeper than {_MAX_DEPTH}") from error
        self._found[()] = (1, "nothing")
        return {}

    def _plain(self, node: yaml.Node, steps: Steps, key: yaml.Node | None = None) -> Any:
        """Return a node as a number, a text, a list or a mapping."""
        twice = steps in self._found
        self._found[steps] = ((key or node).start_mark.line + 1, _shown(node))
        self._left -= 1 + len(steps) + (len(node.value) if isinstance(node.value, str) else 0)
        if twice:
            raise self.error("the key is given twice", *steps)
        if len(steps) > _MAX_DEPTH:
            raise self.error(f"nested deeper than {_MAX_DEPTH}, aliases unfolded", *steps)
        if self._left < 0:
            raise self.error(f"larger than {_MAX_SIZE} characters, aliases unfolded", *steps)
        if isinstance(node, yaml.SequenceNode) and node.tag == f"{_TAG}seq":
            return [self._plain(item, (*steps, index)) for index, item in enumerate(node.value)]
        if isinstance(node, yaml.MappingNode) and node.tag == f"{_TAG}map":
            return {
                name.value: self._plain(item, (*steps, self._name(name, steps)), name)
                for name, item in node.value
            }
        if not isinstance(node, yaml.ScalarNode):
            raise self.error(f"the tag {node.tag} is not allowed", *steps)
        try:
            return _SCALARS[node.tag](node.value)
        except (KeyError, ValueError) as error:
            tag = "" if node.tag in _SCALARS else f" with the tag {node.tag}"
            text = f"expected a text, a number below 2**63, true or false, got {_shown(node)}{tag}"
            raise self.error(text, *steps) from error

    def _name(self, node: yaml.Node, steps: Steps) -> str:
        if isinstance(node, yaml.ScalarNode):
            return str(node.value)
        self._found[*steps, "?"] = (node.start_mark.line + 1, _shown(node))
        raise self.error("expected a name before the colon", *steps, "?")

    # --- the values in their form -----------------------------------------------------------------

    def _validated(self, content: Any, form: type[T]) -> T:
        # JSON's strict mode takes lists for tuples and texts for paths, but no number for a text.
        text, context = json.dumps([content]), {"folder": self.path.parent}
        try:
            value: T = _adapter(cast("Any", form)).validate_json(text, context=context)[0]
        except ValidationError as error:
            raise self.errors(self._problems(error, TypeAdapter(form).json_schema())) from error
        return value

    def _problems(self, error: ValidationError, schema: dict[str, Any]) -> list[tuple[Steps, str]]:
        """Return places and texts of all problems."""
        expected: dict[Steps, list[str]] = {}  # all branches of a union fail at one place
        found: list[tuple[Steps, str]] = []
        for item in error.errors(include_url=False):
            kind, steps = item["type"], item["loc"][1:]
            known = self._known(steps)
            if kind == "missing" and isinstance(steps[-1], str):
                found.append((known, f"lacks the key '{steps[-1]}'"))
            elif kind in ("unexpected_keyword_argument", "extra_forbidden"):
                keys = list(_part(schema, steps[:-1])["properties"])
                hint = did_you_mean(str(steps[-1]), keys)
                found.append((known, f"unknown key{hint} (known: {', '.join(keys)})"))
            elif kind == "value_error":
                found.append((known, str(item["ctx"]["error"])))
            elif kind == "json_invalid":  # half a surrogate pair
                found.append((known, f"not valid YAML: {item['ctx']['error']}"))
            elif steps[-1:] == ("[key]",):
                wanted = _expected(item, schema)
                found.append((known, f"expected {wanted} as key, got '{steps[-2]}'"))
            else:
                expected.setdefault(known, []).append(_expected(item, schema))
        reached = [*expected, *(steps for steps, _ in found)]
        for steps, words in expected.items():
            # The branch that matched deepest has the most specific error.
            if not any(len(one) > len(steps) and one[: len(steps)] == steps for one in reached):
                text = " or ".join(dict.fromkeys(words))
                got = self._found[steps][1]
                hint = did_you_mean(got.strip("'"), re.findall(r"'([^']+)'", text))
                found.append((steps, f"expected {text}, got {got}{hint}"))
        return found


def _expected(item: ErrorDetails, schema: dict[str, Any]) -> str:
    kind, steps = item["type"], item["loc"][1:]
    if kind == "missing":
        return f"a list of {_part(schema, steps[:-1]).get('minItems', 'more')}"
    if kind in ("too_short", "too_long"):
        bound = ("least", "min_length") if kind == "too_short" else ("most", "max_length")
        return f"a list of at {bound[0]} {item['ctx'][bound[1]]}"
    if kind in ("dict_type", "dataclass_type"):
        keys = ", ".join(_part(schema, steps).get("properties", ()))
        return f"a mapping with {keys}" if keys else "a mapping"
    words = _EXPECTED.get(kind, item["msg"].removeprefix("Input should be "))
    return f"a number {words}" if "than" in kind else words


def _part(schema: dict[str, Any], steps: Steps) -> dict[str, Any]:
    """Return the part of a JSON schema at a place."""
    part = schema
    for step in (*steps, None):
        while "$ref" in part or "anyOf" in part:
            if "$ref" in part:
                part = schema["$defs"][part["$ref"].rpartition("/")[2]]
            else:
                branches = part["anyOf"]
                nested = (one for one in branches if one.get("type") in (None, "array", "object"))
                part = next(nested, branches[0])
        if isinstance(step, str):
            others = part.get("additionalProperties")  # values of a mapping with any keys
            others = others if isinstance(others, dict) else part
            part = part.get("properties", {}).get(step, others)
        elif isinstance(step, int):
            part = part.get("items") or part["prefixItems"][step]
    return part


def _located(steps: Steps, text: str) -> str:
    """Return a message with its place."""
    where = "".join(f"[{step}]" if isinstance(step, int) else f".{step:.80}" for step in steps)[1:]
    return text if not where or text.startswith(where) else f"{where}: {text}"


def _shown(node: yaml.Node) -> str:
    if isinstance(node, yaml.ScalarNode):
        rest = "..." if len(node.value) > _MAX_SHOWN else ""
        return f"'{node.value[:_MAX_SHOWN]}'{rest}" if node.value else "nothing"
    return f"a list of {len(node.value)}" if isinstance(node, yaml.SequenceNode) else "a mapping"


@functools.cache
def _adapter(form: Any) -> TypeAdapter[tuple[Any]]:
    # A dataclass takes no config from outside, but an element of a tuple inherits the tuple's.
    config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)
    one: Any = tuple[form]
    return TypeAdapter(one, config=config)


# --- PyYAML with the numbers of YAML 1.2 ----------------------------------------------------------


class _Loader(yaml.SafeLoader):
    yaml_implicit_resolvers = {  # noqa: RUF012  (as PyYAML declares it)
        first: [rule for rule in rules if rule[0] in {f"{_TAG}bool", f"{_TAG}null"}]
        for first, rules in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }


class _Dumper(yaml.SafeDumper):
    """Quotes a text that is another value in any version of YAML."""


for _each in (_Loader, _Dumper):
    _each.add_implicit_resolver(f"{_TAG}int", _INTEGER, None)
    _each.add_implicit_resolver(f"{_TAG}float", _FLOAT, None)


def _whole(text: str) -> int:
    value = int(text, {"0o": 8, "0x": 16}.get(text[:2], 10))
    if abs(value) >= 2**63:
        raise ValueError
    return value


_SCALARS: Final[dict[str, Callable[[str], Any]]] = {
    f"{_TAG}null": lambda _: None,
    f"{_TAG}bool": lambda text: yaml.SafeLoader.bool_values[text.lower()],
    f"{_TAG}int": _whole,
    f"{_TAG}float": float,
    f"{_TAG}str": str,
}
