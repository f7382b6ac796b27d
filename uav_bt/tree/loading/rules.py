"""What kinds of findings there are, under names that stay."""

from __future__ import annotations

from enum import Enum


class Rule(Enum):
    """What a finding is about: the name that stays, and a line on it."""

    FILE = "file", "A file cannot be read, is no XML, or is larger than a tree file may be."
    ROOT = "root", "The root element, its format and the tree to be flown."
    INCLUDE = "include", "Included files are found, and lie where they may."
    TREE_ID = "tree-id", "Trees have IDs that the engine takes, each its own."
    UNKNOWN_TREE = "unknown-tree", "A SubTree names one tree that exists and does not contain it."
    UNKNOWN_NODE = "unknown-node", "A node is of the format, installed, or of a palette."
    CHILDREN = "children", "A node has as many children, and of the kinds, that it can have."
    ATTRIBUTE = "attribute", "A node has the attributes that its ports need, with values that fit."
    SCRIPT = "script", "Scripts and conditions can be parsed and do what they seem to do."
    BOARD_KEY = "board-key", "Keys of the mission board exist and hold what the port takes."
    VARIABLE = "variable", "Variables are written before they are read, with types that fit."
    NODE_MODEL = "node-model", "A TreeNodesModel describes nodes as they are."
    NO_MEANING = "no-meaning", "Something in the file means nothing to the engine."
    NOT_INSTALLED = "not-installed", "Policies, networks and files that leaves name are there."
    LIMIT = "limit", "A value lies beyond what a mission is allowed unless its site says so."
    OTHER = "tree-file", "A tree file loads."

    def __init__(self, id_: str, text: str) -> None:
        self.id = id_
        self.text = text
