"""The scripts of `benchmarks/`: each tells its usage, and each that is named exists."""

from __future__ import annotations

import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPTS = sorted(
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for folder in ("", "rooms")
    for path in (ROOT / "benchmarks" / folder).glob("*.py")
    if not path.name.startswith("loopback")  # run by the Python that has Olympe
    and 'if __name__ == "__main__"' in path.read_text(encoding="utf-8")
)
NAMED = re.compile(r"(?<![\w/])benchmarks(?:(?:/[\w-]+)+\.\w+|(?:\.\w+)+)")


def texts() -> Iterator[Path]:
    yield from (path for path in ROOT.glob("*.md") if path.name != "CHANGELOG.md")
    for folder in ("docs", "uav_bt", "perception", "behaviours", "sim_bridge"):
        yield from (ROOT / folder).rglob("*.md")
        yield from (ROOT / folder).rglob("*.py")


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_script_tells_its_usage(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", [name, "--help"])
    with pytest.raises(SystemExit) as ended:
        import_module(name).main()
    assert ended.value.code == 0
    assert "usage:" in capsys.readouterr().out


def test_each_named_script_exists() -> None:
    missing = []
    for path in texts():
        for name in NAMED.findall(path.read_text(encoding="utf-8")):
            file = ROOT / (name if "/" in name else f"{name.replace('.', '/')}.py")
            if not file.exists() and not (file.with_suffix("") / "__main__.py").exists():
                missing.append(f"{path.relative_to(ROOT)}: {name}")
    assert missing == []
