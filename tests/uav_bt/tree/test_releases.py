"""`check --engine`: what releases of BehaviorTree.CPP refuse of files that this loader takes."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from uav_bt.tree import NodeRegistry
from uav_bt.tree.loading.findings import ERROR, WARNING, Finding
from uav_bt.tree.loading.loader import check_file, check_text
from uav_bt.tree.loading.releases import RELEASES, Change
from uav_bt.tree.loading.rules import Rule
from uav_bt.tree.script.before_4_9 import read_before_4_9

ROOT = Path(__file__).parents[3]
SHIPPED = sorted((ROOT / "trees").glob("*.xml"))
RECORDED = [
    json.loads(line)
    for line in (ROOT / "tests" / "data" / "engine_4_8.jsonl").read_text("utf-8").splitlines()
]
REGISTRY = NodeRegistry()
NAMELESS = '<root BTCPP_format="4"><BehaviorTree><AlwaysSuccess/></BehaviorTree>'
SWITCH = (
    '<Switch2 variable="{v}" case_1="1" case_2="2"><AlwaysSuccess/><AlwaysSuccess/><AlwaysSuccess/>'
    "</Switch2>"
)
INNER = '<SubTree ID="Inner" n="3"/>'


def found(xml: str, *releases: str) -> list[Finding]:
    """Return what is said of releases, and assert that nothing else is wrong."""
    findings = check_text(xml, REGISTRY, path=Path("f.xml"), engines=releases)
    others = [each for each in findings if each.rule is not Rule.ENGINE]
    assert not [each for each in others if each.severity == ERROR], others
    return [each for each in findings if each.rule is Rule.ENGINE]


def file(body: str, rest: str = "") -> str:
    """Return a tree file around its main tree's root node."""
    return (
        '<root BTCPP_format="4" main_tree_to_execute="Main">\n<BehaviorTree ID="Main">\n'
        f"{body}\n</BehaviorTree>\n{rest}</root>"
    )


def script(code: str) -> str:
    """Return a file with a script."""
    return file(f'<Script code="{code}"/>')


def inner(body: str, door: str = INNER, rest: str = "") -> str:
    """Return a file whose main tree is a SubTree."""
    return file(door, f'<BehaviorTree ID="Inner">\n{body}\n</BehaviorTree>\n{rest}')


# For each change: what it is about, and what the message says to write instead.
EXAMPLES: dict[Change, list[tuple[str, str]]] = {
    Change.MINUS_AFTER_EQUALS: [(script("x := 1==-1"), script("x := 1==(-1)"))],
    Change.KIND_TAG: [
        (
            file('<Action ID="Sequence"><AlwaysSuccess/></Action>'),
            file("<Sequence><AlwaysSuccess/></Sequence>"),
        ),
        (
            file('<Decorator ID="Fallback"><AlwaysSuccess/><AlwaysSuccess/></Decorator>'),
            file('<Control ID="Fallback"><AlwaysSuccess/><AlwaysSuccess/></Control>'),
        ),
    ],
    Change.WORDS: [
        (script("x := 1;"), script("x := 1")),
        (script("; x := 1"), script("x := 1")),
        (script("x := 1;; y := 2"), script("x := 1; y := 2")),
        (script("x := 1 y := 2"), script("x := 1; y := 2")),
        (script("trueish := 1"), script("is_true := 1")),
        (script("x := 'ä'"), file('<SetBlackboard value="ä" output_key="x"/>')),
        (script("x := 1..'a'"), script("x := 1 ..'a'")),
        (file('<Sleep msec="1" _onSuccess="x := 1;"/>'), file('<Sleep msec="1" _post="x := 1"/>')),
        (
            inner("<AlwaysSuccess/>", '<SubTree ID="Inner" _skipIf="true;"/>'),
            inner("<AlwaysSuccess/>", '<SubTree ID="Inner" _skipIf="true"/>'),
        ),
    ],
    Change.OPERATORS: [
        (script("x := 1 &amp; 2 + 3"), script("x := 1 &amp; (2 + 3)")),
        (script("x := !true + 1"), script("x := (!true) + 1")),
        (script("x := 'a' .. 1 + 2"), script("x := 'a' .. (1 + 2)")),
        (script("x := 1 ? 2 : 3 ? 4 : 5"), script("x := 1 ? 2 : (3 ? 4 : 5)")),
        (script("x := y := 1"), script("x := (y := 1)")),
        (script("x := 9223372036854775808"), script("x := 9223372036854775807")),
        (script("x := 1e400"), script("x := 1e300")),
        (script(" "), script("")),
    ],
    Change.TRY_CATCH: [
        (
            file("<TryCatch><Sleep msec='1'/><AlwaysSuccess/></TryCatch>"),
            file(
                "<Fallback><Sequence><Sleep msec='1'/></Sequence>"
                "<ForceFailure><AlwaysSuccess/></ForceFailure></Fallback>"
            ),
        )
    ],
    Change.NO_ID: [(f"{NAMELESS}<TreeNodesModel/></root>", f"{NAMELESS}</root>")],
    Change.AND_BESIDE_OR: [
        (
            script("x := true || true &amp;&amp; false"),
            script("x := true || (true &amp;&amp; false)"),
        ),
    ],
    Change.SWITCH_TEXT: [
        (
            file(f'<LoopInt queue="1;2" value="{{v}}">{SWITCH}</LoopInt>'),
            file(
                '<LoopInt queue="1;2" value="{n}"><Sequence><Script code="v := n"/>'
                f"{SWITCH}</Sequence></LoopInt>"
            ),
        ),
        (
            file(f'<Sequence><Sleep msec="{{v}}"/>{SWITCH}</Sequence>'),
            file(f'<Sequence>{SWITCH}<Sleep msec="{{v}}"/></Sequence>'),
        ),
        (
            file(f'<Sequence><Repeat num_cycles="{{v}}">{SWITCH}</Repeat></Sequence>'),
            file(f'<LoopString queue="1;2" value="{{v}}">{SWITCH}</LoopString>'),
        ),
    ],
    Change.NUMBER_ENTRY: [
        (
            inner('<Script code="n += 1"/>'),
            file(
                '<Sequence><Script code="three := 3"/><SubTree ID="Inner" n="{three}"/></Sequence>',
                '<BehaviorTree ID="Inner"><Script code="n += 1"/></BehaviorTree>',
            ),
        ),
        (inner('<Script code="y := n * 2"/>'), inner('<ScriptCondition code="n == 3"/>')),
        (inner('<AlwaysSuccess _while="n"/>'), inner('<AlwaysSuccess _while="n &lt; 4"/>')),
        (inner('<Script code="n := 4"/>'), inner("<Script code=\"y := n .. 'm'\"/>")),
        (
            inner(
                '<SubTree ID="Deeper" m="{n}"/>',
                rest='<BehaviorTree ID="Deeper"><Script code="m += 1"/></BehaviorTree>',
            ),
            inner('<Repeat num_cycles="{n}"><AlwaysSuccess/></Repeat>'),
        ),
        (
            inner(
                '<Script code="y := n + 1"/>',
                '<SubTree ID="Inner"/>',
                '<TreeNodesModel><SubTree ID="Inner"><input_port name="n" default="3"/></SubTree>'
                "</TreeNodesModel>",
            ),
            inner('<Script code="y := n + 1"/>', '<SubTree ID="Inner" n="text"/>'),
        ),
    ],
    Change.REACTIVE_KIND_TAG: [
        (
            file('<ReactiveSequence><Action ID="AlwaysSuccess"/></ReactiveSequence>'),
            file("<ReactiveSequence><AlwaysSuccess/></ReactiveSequence>"),
        ),
        (
            file('<Control ID="ReactiveSequence"><Action ID="AlwaysSuccess"/></Control>'),
            file('<Control ID="ReactiveFallback"><Action ID="AlwaysSuccess"/></Control>'),
        ),
    ],
    Change.DOUBLE_QUOTES: [(script("x := &quot;a&quot;"), script("x := 'a'"))],
    Change.LETTERS: [(script("wärme := 1"), script("warmth := 1"))],
}
WARNED = {Change.AND_BESIDE_OR, Change.NUMBER_ENTRY}
CASES = [
    pytest.param(change, bad, good, release, id=f"{change.name}-{number}-{release}")
    for change, examples in EXAMPLES.items()
    for number, (bad, good) in enumerate(examples)
    for release in RELEASES
]
# By hand, beside the table in the code: which releases are concerned.
CONCERNED = {
    Change.MINUS_AFTER_EQUALS: {"4.6"},
    Change.KIND_TAG: {"4.6"},
    Change.WORDS: {"4.6", "4.8"},
    Change.OPERATORS: {"4.6", "4.8"},
    Change.TRY_CATCH: {"4.6", "4.8"},
    Change.NO_ID: {"4.6", "4.8"},
    Change.AND_BESIDE_OR: {"4.6", "4.8"},
    Change.NUMBER_ENTRY: {"4.6", "4.8"},
    Change.SWITCH_TEXT: {"4.6", "4.8", "4.10"},
    Change.REACTIVE_KIND_TAG: {"4.8", "4.10"},
    Change.DOUBLE_QUOTES: {"4.10"},
    Change.LETTERS: {"4.10"},
}


def test_every_change_has_examples() -> None:
    assert set(EXAMPLES) == set(CONCERNED) == set(Change)


@pytest.mark.parametrize(("change", "bad", "good", "release"), CASES)
def test_a_release_takes_the_cure_and_refuses_what_it_must(
    change: Change, bad: str, good: str, release: str
) -> None:
    findings = found(bad, release)
    if release in CONCERNED[change]:
        (finding,) = findings
        assert finding.severity == (WARNING if change in WARNED else ERROR)
        assert f"engine {release}" in finding.message
    else:
        assert findings == []
    assert found(good, release) == []


def test_without_a_release_nothing_is_said() -> None:
    for examples in EXAMPLES.values():
        for bad, _ in examples:
            assert found(bad) == []


@pytest.mark.parametrize("case", RECORDED, ids=range(len(RECORDED)))
def test_it_says_of_4_8_what_the_engine_said(case: dict[str, str]) -> None:
    """Verdicts of a running engine, release 4.8.2 (`tests/engine_verdicts.py`)."""
    refused = [each for each in found(case["xml"], "4.8") if each.severity == ERROR]
    assert bool(refused) != case["taken"], refused


def test_the_recorded_verdicts_are_of_both_kinds() -> None:
    taken = [case["taken"] for case in RECORDED]
    assert min(taken.count(True), taken.count(False)) > 80


def test_one_finding_names_all_releases_that_were_asked_for() -> None:
    xml = file("<Sequence>\n<TryCatch><AlwaysSuccess/><AlwaysSuccess/></TryCatch>\n</Sequence>")
    (finding,) = found(xml, "4.6", "4.8", "4.8", "4.10")
    assert str(finding) == (
        "f.xml:4:1: TryCatch: node 'TryCatch': refused by engine 4.6 and 4.8, taken since 4.9.0; "
        "write <Fallback><Sequence>...</Sequence><ForceFailure>the last child</ForceFailure>"
        "</Fallback>"
    )


def test_scripts_of_a_tree_that_nothing_uses_are_only_odd() -> None:
    spare = '<BehaviorTree ID="Spare"><Script code="x := 1;"/></BehaviorTree>'
    (finding,) = found(file("<AlwaysSuccess/>", spare), "4.8")
    assert finding.severity == WARNING
    (finding,) = found(file("<AlwaysSuccess/>", SPARE), "4.8")
    assert finding.severity == ERROR


def test_what_a_file_includes_is_looked_at(tmp_path: Path) -> None:
    (tmp_path / "part.xml").write_text(EXAMPLES[Change.NO_ID][0][0], encoding="utf-8")
    main = tmp_path / "main.xml"
    main.write_text(
        '<root BTCPP_format="4"><include path="part.xml"/>'
        '<BehaviorTree ID="Main"><AlwaysSuccess/></BehaviorTree></root>',
        encoding="utf-8",
    )
    findings = check_file(main, REGISTRY, tree_id="Main", engines=["4.8"])
    assert [Path(each.path).name for each in findings if each.rule is Rule.ENGINE] == ["part.xml"]


def test_a_file_with_errors_is_looked_at_too() -> None:
    xml = file('<Sequence><Slep/><Script code="x := 1;"/></Sequence>')
    findings = check_text(xml, REGISTRY, path=Path("f.xml"), engines=["4.8"])
    assert {each.rule for each in findings} == {Rule.UNKNOWN_NODE, Rule.ENGINE}


def test_a_script_that_does_not_parse_is_refused_once() -> None:
    findings = check_text(script("x := "), REGISTRY, path=Path("f.xml"), engines=RELEASES)
    assert [each.rule for each in findings] == [Rule.SCRIPT]


def test_an_older_parser_reads_brackets_and_questions_as_levels() -> None:
    for source in ("(1 + 2) & 3", "1 + 2 ? 3 | 4 : 5", "x := (1 ? 2 : 3) ? 4 : 5", "1 || (1 && 0)"):
        assert read_before_4_9(source) == read_before_4_9("1"), source
    assert read_before_4_9("1 && 0 || 1").differs is None


# --- the shipped missions -------------------------------------------------------------------------

SPARE = (
    '<BehaviorTree ID="Spare"><TryCatch><AlwaysSuccess/><AlwaysSuccess/></TryCatch></BehaviorTree>'
)
MUTATIONS = {
    Change.TRY_CATCH: (r"</BehaviorTree>", f"</BehaviorTree>{SPARE}"),
    Change.WORDS: (r"<(Land|Hover)\b", r"<\1 _onSuccess='done := 1;'"),
    Change.DOUBLE_QUOTES: (r"<(Land|Hover)\b", r"<\1 _onSuccess='done := &quot;yes&quot;'"),
    Change.MINUS_AFTER_EQUALS: (r"<(Land|Hover)\b", r"<\1 _skipIf='1==-1'"),
}


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_all_releases_take_the_shipped_missions_and_refuse_what_is_changed(path: Path) -> None:
    source = path.read_text(encoding="utf-8")
    registry = NodeRegistry.installed()

    def refusing(text: str) -> set[str]:
        return {
            release
            for release in RELEASES
            for each in check_text(text, registry, path=path, engines=[release])
            if each.rule is Rule.ENGINE
        }

    assert refusing(source) == set()
    for change, (place, what) in MUTATIONS.items():
        changed = re.sub(place, what, source, count=1)
        assert changed != source
        assert refusing(changed) == CONCERNED[change], change


# --- the page -------------------------------------------------------------------------------------


def test_the_page_has_every_change_with_its_version() -> None:
    page = (ROOT / "docs" / "tree-files.md").read_text(encoding="utf-8")
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in page.splitlines()]
    told = {row[0]: row for row in rows if len(row) == len(RELEASES) + 3}
    for change in Change:
        what, version, *verdicts, _ = told[change.what]
        assert version == (".".join(map(str, change.since)) if change.words else "")
        for verdict, release in zip(verdicts, RELEASES, strict=True):
            refused = "otherwise" if change in WARNED else "no"
            taken = "yes" if change.words else "not known"
            assert verdict.split(",")[0] == (refused if change.concerns(release) else taken), what
