"""`uav-bt schema`, `render` and `new`: the tools around tree files."""

from __future__ import annotations

from pathlib import Path

from cli_world import assert_refused, run

from uav_bt.tree import NodeRegistry
from uav_bt.tree.schema import schema_xml

# --- schema ---------------------------------------------------------------------------------------


def test_the_schema_of_all_installed_nodes_is_printed_or_written(tmp_path: Path) -> None:
    expected = schema_xml(NodeRegistry.installed())
    assert run("schema").stdout == expected
    out = tmp_path / "uav-bt.xsd"
    result = run("schema", "--out", out)
    assert (result.exit_code, result.stdout) == (0, f"written: {out}\n")
    assert out.read_text(encoding="utf-8") == expected


def test_the_schema_knows_the_nodes_of_a_palette(tmp_path: Path) -> None:
    palette = tmp_path / "palette.xml"
    palette.write_text('<TreeNodesModel><Action ID="Dock"/></TreeNodesModel>', encoding="utf-8")
    assert 'name="node.Dock"' in run("schema", "--palette", palette).stdout


def test_a_schema_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    assert_refused(run("schema", "--out", tmp_path / "absent" / "x.xsd"), "absent")
