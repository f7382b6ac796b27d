"""A tree file's outline: its includes, its trees, its main tree, its node models."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from uav_bt.errors import did_you_mean
from uav_bt.tree.loading.findings import Findings
from uav_bt.tree.loading.models import read_models
from uav_bt.tree.loading.source import (
    Element,
    check_attributes,
    check_no_text,
    node_attributes,
    parse_source,
    read_source,
)
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.nodes import SubTree
from uav_bt.tree.registry import NodeRegistry

_ROOT_ATTRIBUTES: Final = frozenset({"BTCPP_format", "main_tree_to_execute", "project_name"})
_TREE_ATTRIBUTES: Final = frozenset({"ID"})
_ROOT_CHILDREN: Final = ("BehaviorTree", "TreeNodesModel", "include")


@dataclass
class Document:
    """The outline of a tree file."""

    path: Path
    main: str = ""
    trees: dict[str, Element] = field(default_factory=dict)
    included: dict[Path, bytes] = field(default_factory=dict)  # texts of the included files
    # Ports of the trees that the file describes as SubTree in its TreeNodesModel: default by name,
    # None where a SubTree has to give an entry.
    subtree_ports: dict[str, dict[str, str | None]] = field(default_factory=dict)

    def entries(self, subtree: Element) -> dict[str, str]:
        """Return a SubTree's entries and conditions, the described defaults included.

        As in the engine, a subtree that shares all variables has no defaults.
        """
        given = node_attributes(subtree)
        if autoremaps(subtree):
            return given
        ports = self.subtree_ports.get(subtree.attributes.get("ID", ""), {})
        defaults = {name: text for name, text in ports.items() if text is not None}
        return {**defaults, **given}


def autoremaps(subtree: Element) -> bool:
    """Return whether a SubTree shares all variables; one that is refused for it counts as such."""
    try:
        return SubTree.AUTOREMAP.convert(subtree.attributes.get("_autoremap", False))
    except ValueError:
        return True


def outline(root: Element, registry: NodeRegistry, findings: Findings) -> Document:
    """Read the outline of a file and of those it includes, and note what is wrong with them.

    Args:
        root: the file's root element.
        registry: the nodes that may occur.
        findings: where they are added.

    Raises:
        TreeError: an included file cannot be read or is no XML.
    """
    document = Document(root.path)
    included = Includes(root.path)
    waiting = [root]
    while waiting:
        element = waiting.pop(0)
        if _check_root(element, findings):
            for child in element.children:
                if child.tag == "include":
                    waiting += included.read(child, findings)
                else:
                    _read_part(child, document, registry, findings)
    document.included = included.sources
    if root.tag == "root":
        document.main = _find_main(root, document, findings)
    return document


def _check_root(root: Element, findings: Findings) -> bool:
    path = root.path
    if root.tag != "root":
        findings.add(path, root.position, f"expected the element <root>, got <{root.tag}>")
        return False
    check_attributes(root, _ROOT_ATTRIBUTES, findings)
    check_no_text(root, findings)
    version = root.attributes.get("BTCPP_format")
    if version != "4":
        got = "nothing" if version is None else f"'{version}'"
        findings.add(path, root.at("BTCPP_format"), f'expected BTCPP_format="4", got {got}', "root")
    return True


def _read_part(
    element: Element, document: Document, registry: NodeRegistry, findings: Findings
) -> None:
    if element.tag == "BehaviorTree":
        _read_tree(element, document, findings)
    elif element.tag == "TreeNodesModel":
        _read_models(element, document, registry, findings)
    else:
        hint = did_you_mean(element.tag, _ROOT_CHILDREN)
        findings.add(
            element.path, element.position, f"<{element.tag}> cannot stand in <root>{hint}"
        )


def _read_tree(element: Element, document: Document, findings: Findings) -> None:
    path = element.path
    check_attributes(element, _TREE_ATTRIBUTES, findings)
    check_no_text(element, findings)
    tree_id = element.attributes.get("ID", "")
    if not tree_id:
        findings.add(path, element.position, "attribute 'ID' is missing", "BehaviorTree")
        return
    if len(element.children) != 1:
        count = len(element.children)
        findings.note(element, f"needs exactly one child, has {count}")
    if tree_id in document.trees:
        first = document.trees[tree_id]
        findings.note(
            element, f"this ID is taken by the tree at {first.path}:{first.position}", "ID"
        )
        return
    document.trees[tree_id] = element


def _find_main(root: Element, document: Document, findings: Findings) -> str:
    main = root.attributes.get("main_tree_to_execute")
    if main is None:
        if len(document.trees) == 1:
            return next(iter(document.trees))
        reason = "the file has no BehaviorTree"
        if document.trees:
            reason = (
                "the file has several trees, so <root> must say main_tree_to_execute="
                f"{'|'.join(document.trees)}"
            )
        findings.add(document.path, root.position, reason, "root")
        return ""
    if main not in document.trees:
        findings.add(
            document.path,
            root.at("main_tree_to_execute"),
            f"main_tree_to_execute: there is no tree '{main}'{did_you_mean(main, document.trees)}",
            "root",
        )
        return ""
    return main


def _read_models(
    models: Element, document: Document, registry: NodeRegistry, findings: Findings
) -> None:
    for model in read_models(models, findings):
        if model.kind is NodeKind.SUBTREE:
            document.subtree_ports[model.node_id] = {
                name: port.attributes.get("default") or None for name, port in model.ports.items()
            }
        elif model.node_id in registry:
            _compare_model(model.element, model.ports, registry[model.node_id], findings)


def _compare_model(
    model: Element, ports: dict[str, Element], node: type[Node], findings: Findings
) -> None:
    path = model.path
    if node.kind.value != model.tag:
        findings.note(model, f"described as {model.tag}, but the node is of kind {node.kind.value}")
    known = [port.name for port in node.ports]
    for name, element in ports.items():
        if name not in known:
            hint = did_you_mean(name, known)
            findings.add(
                path, element.at("name"), f"the node has no port '{name}'{hint}", model.label
            )


MAX_INCLUDES: Final = 50


class Includes:
    """Reads included files, each once.

    Args:
        main: the file that was asked for; its folder bounds what may be included.
    """

    def __init__(self, main: Path) -> None:
        self._folder = main.resolve().parent if main.is_file() else None
        self._main = main.resolve()
        self.sources: dict[Path, bytes] = {}  # of the included files, by path

    def read(self, include: Element, findings: Findings) -> list[Element]:
        """Return the root of the included file; nothing when it was read before or is refused.

        Args:
            include: the element that names the file.
            findings: where they are added.

        Raises:
            TreeError: the file cannot be read or is no XML.
        """
        attributes = include.attributes
        message = ""
        if set(attributes) != {"path"} or not attributes["path"]:
            message = "needs exactly the attribute 'path'"
        elif self._folder is None:
            message = "only a tree that is loaded from a file can include another"
        elif len(self.sources) >= MAX_INCLUDES:
            message = f"more than {MAX_INCLUDES} files are included"
        else:
            return self._read(include, findings, self._folder)
        findings.add(include.path, include.at("path"), message, "include")
        return []

    def _read(self, include: Element, findings: Findings, folder: Path) -> list[Element]:
        name = include.attributes["path"]
        try:
            target = (include.path.parent / name).resolve()
            there = target.is_file()
        except OSError as error:  # a name may be too long for the system
            message = f"'{name:.40}...': {error.strerror}"
        else:
            if target == self._main or target in self.sources:
                return []
            if not target.is_relative_to(folder):
                message = f"'{name}' lies outside the folder {folder}"
            elif not there:
                message = f"'{name}': no such file beside {include.path}"
            else:
                self.sources[target] = read_source(target)
                return [parse_source(self.sources[target], target)]
        findings.add(include.path, include.at("path"), message, "include")
        return []
