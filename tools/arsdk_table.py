"""Writes the table of ARSDK messages that the loopback ANAFI speaks.

The numbers, names and types come from the command definitions that Parrot ships in the Olympe wheel
(``arsdk/xml/*.xml``). Run with the folder of an installed or unpacked wheel::

    python tools/arsdk_table.py .../site-packages/arsdk/xml > sim_bridge/loopback/messages.txt
"""

from __future__ import annotations

import argparse
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

HEADER = """\
# ARSDK messages, written by tools/arsdk_table.py from the definitions in the Olympe wheel.
# enum NAME VALUE...             values count from 0; as a bit field they name bits
# project.class.number DIRECTION BUFFER NAME [argument:type ...]
#   DIRECTION command | event; BUFFER ack | noack | prio
"""

ABSENT = {"cellular", "followme", "sequoia", "stereo_vision_sensor", "thermal", "thermal_cam"}
"""Parts of other drones, and of a phone's application."""

BUFFERS = {"NON_ACK": "noack", "HIGH_PRIO": "prio"}


Enums = dict[tuple[str, ...], str]  # the names of lists of values; equal lists share a name


def values_of(element: ET.Element, tag: str) -> tuple[str, ...]:
    """Return the names of an enumeration's values, in order."""
    return tuple(value.attrib["name"] for value in element.findall(tag))


def arguments(
    message: ET.Element, name: str, named: dict[str, tuple[str, ...]], enums: Enums
) -> Iterator[str]:
    """Yield ``name:type`` for each argument."""
    project = name.partition(".")[0]
    for argument in message.findall("arg"):
        kind, own = argument.attrib["type"], argument.attrib["name"]
        if kind == "enum":
            kind = f"enum:{enums.setdefault(values_of(argument, 'enum'), f'{name}.{own}')}"
        elif kind.startswith("enum:"):
            of = kind.removeprefix("enum:")
            kind = f"enum:{enums.setdefault(named[of], f'{project}.{of}')}"
        elif kind.startswith("bitfield:"):
            _, integer, of = kind.split(":")
            kind = f"bits-{integer}:{enums.setdefault(named[of], f'{project}.{of}')}"
        yield f"{own}:{kind}"


def messages(root: ET.Element) -> Iterator[tuple[str, bool, str, ET.Element]]:
    """Yield (number, is an event, name, element) of each message of a file."""
    project, name = root.attrib["id"], root.attrib["name"]
    for one in root.findall("class"):
        event = one.attrib["name"].endswith(("State", "Event"))
        for message in one.findall("cmd"):
            number = f"{project}.{one.attrib['id']}.{message.attrib['id']}"
            yield number, event, f"{name}.{one.attrib['name']}.{message.attrib['name']}", message
    for message in root.findall("msgs/*"):
        number = f"{project}.0.{message.attrib['id']}"
        yield number, message.tag == "evt", f"{name}.{message.attrib['name']}", message


def table(folder: Path) -> str:
    """Return the table of all files of a folder."""
    files = [path for path in sorted(folder.glob("*.xml")) if path.stem not in ABSENT]
    roots = [ET.parse(path).getroot() for path in files]  # noqa: S314 (ours)
    generic = next((root for root in roots if root.get("name") == "generic"), None)
    shared = {} if generic is None else named_enums(generic)
    lines: list[str] = []
    enums: Enums = {}
    for root in roots:
        named = shared | named_enums(root)
        for number, event, name, message in messages(root):
            words = [
                number,
                "event" if event else "command",
                BUFFERS.get(message.get("buffer", ""), "ack"),
                name,
                *arguments(message, name, named, enums),
            ]
            lines.append(" ".join(words))
    listed = [f"enum {name} {' '.join(values)}" for values, name in enums.items()]
    return HEADER + "\n".join([*listed, *lines]) + "\n"


def named_enums(root: ET.Element) -> dict[str, tuple[str, ...]]:
    """Return the enumerations that a file gives a name."""
    return {one.attrib["name"]: values_of(one, "value") for one in root.findall("enums/enum")}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path, help="the wheel's arsdk/xml")
    sys.stdout.write(table(parser.parse_args().folder))


if __name__ == "__main__":
    main()
