"""Commands and options of earlier versions that were deleted, and what to use instead."""

from __future__ import annotations

from typing import Final

import click

from uav_bt.errors import InputError

# By the words of the call. An option stands behind its command.
_INSTEAD: Final = {
    "net train teacher": "'uav-bt lab train LAB' trains teacher and network of a lab",
    "net train segmentation": "'uav-bt lab train LAB' trains teacher and network of a lab",
    "net export segmentation": "'uav-bt lab train LAB' writes the network in 8-bit integers",
    "net evaluate segmentation": "'uav-bt lab check LAB' scores a network on picks, and "
    "benchmarks/segmentation.py on the twin's exact classes",
    "tree migrate": "use convert_v3_to_v4.py, which comes with BehaviorTree.CPP",
    "net pick": "'uav-bt lab pick LAB' picks on the images in the folder frames/ of a lab",
    "view --video": "'uav-bt fly --video FILE' makes the film in flight, and in Python "
    "RecordedFlight(RECORD).film(FILE) makes it from a record",
    "view --speed": "RecordedFlight(RECORD).film(FILE, speed=2.0) makes a fast film of a record",
    "serve-anafi --media-name": "leave it out: the stream is called as on the real device",
    "check --engine": "leave it out: files are read as engine 4.10 reads them",
}


class DeletedError(click.ClickException):
    """A deleted command or option was called. The message names the replacement."""

    exit_code = InputError.exit_code


def refuse_deleted(ctx: click.Context, word: str) -> None:
    """Refuse a command or an option that was deleted.

    Args:
        ctx: the context of the group of the command, or of the command of the option.
        word: the name of the command or of the option.

    Raises:
        DeletedError: the command or option was deleted.
    """
    words = [word]
    while ctx.parent is not None:
        words.insert(0, str(ctx.info_name))
        ctx = ctx.parent
    call = " ".join(words)
    if call in _INSTEAD:
        raise DeletedError(f"'uav-bt {call}' was deleted: {_INSTEAD[call]}")
