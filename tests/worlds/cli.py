"""Helpers of the command line's tests: calls, and minimal missions."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import click
from click.testing import CliRunner, Result

from uav_bt.cli.root import COMMANDS, uav_bt

HOP = '<Sequence><TakeOff height_m="1.0"/><Land/></Sequence>'
"""Take-off and landing on the mark, without a network: some seconds of flight."""


def run(*arguments: object) -> Result:
    """Run `uav-bt` in this process."""
    return CliRunner().invoke(uav_bt, [str(argument) for argument in arguments])


def tree_file(folder: Path, body: str, name: str = "mission.xml") -> Path:
    """Write a tree file around the XML of its root node."""
    path = folder / name
    path.write_text(
        f'<root BTCPP_format="4">\n<BehaviorTree ID="Main">\n{body}\n</BehaviorTree>\n</root>\n',
        encoding="utf-8",
    )
    return path


def assert_refused(result: Result, *words: str) -> None:
    """Assert exit code 2 and one message with these words, and no traceback."""
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    assert "Traceback" not in result.stderr
    for word in words:
        assert word in result.stderr, result.stderr


def all_commands() -> Iterator[tuple[tuple[str, ...], click.Command]]:
    """Yield every command that is not a group, with the words of its call."""
    context = click.Context(uav_bt, info_name="uav-bt")
    for words in COMMANDS:
        command: click.Command = uav_bt
        for word in words.split():
            assert isinstance(command, click.Group)
            found = command.get_command(context, word)
            assert found is not None
            command = found
        yield tuple(words.split()), command
