"""Deleted commands and options: one line says what to use instead."""

from __future__ import annotations

import pytest

from tests.worlds.cli import run


@pytest.mark.parametrize(
    ("line", "call", "instead"),
    [
        ("net train teacher --picks a.csv", "net train teacher", "uav-bt lab train LAB"),
        ("net train segmentation", "net train segmentation", "uav-bt lab train LAB"),
        ("net export segmentation", "net export segmentation", "uav-bt lab train LAB"),
        ("net evaluate segmentation", "net evaluate segmentation", "uav-bt lab check LAB"),
        ("tree diff a.xml b.xml", "tree diff", "compare them with 'git diff'"),
        ("tree migrate old.xml --out new.xml", "tree migrate", "use convert_v3_to_v4.py, which"),
        ("net pick photos", "net pick", "'uav-bt lab pick LAB' picks on the images"),
        ("serve-anafi --media-name x", "serve-anafi --media-name", "called as on the real device"),
        ("check land_only --engine 4.8", "check --engine", "leave it out: files are read as"),
        ("check --engine=4.10 land_only", "check --engine", "as engine 4.10 reads them"),
    ],
)
def test_a_deleted_command_or_option_names_what_to_use_instead(
    line: str, call: str, instead: str
) -> None:
    result = run(*line.split())
    assert result.exit_code == 2
    assert result.stdout == ""
    (message,) = result.stderr.splitlines()
    assert message.startswith(f"Error: 'uav-bt {call}' was deleted: ")
    assert instead in message


def test_an_option_that_never_was_is_wrong_usage() -> None:
    result = run("check", "land_only", "--motor", "4.8")
    assert result.exit_code == 2
    assert "No such option" in result.stderr
    assert "deleted" not in result.stderr


def test_a_deleted_word_is_free_in_other_groups() -> None:
    result = run("record", "diff")
    assert result.exit_code == 2
    assert "there is no command 'diff'" in result.stderr
