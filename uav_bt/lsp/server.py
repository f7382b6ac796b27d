"""Language server of tree files, over standard input and output."""

from __future__ import annotations

import asyncio
import io
import re
from functools import partial
from pathlib import Path
from typing import Any, Final

from lsprotocol import types
from pygls.lsp.server import LanguageServer
from pygls.workspace import TextDocument

from uav_bt import __version__
from uav_bt.errors import FileError
from uav_bt.lsp.names import Name, Names
from uav_bt.tree.loading.findings import Finding
from uav_bt.tree.loading.loader import check_text
from uav_bt.tree.loading.lookup import Library, Lookup, files_in
from uav_bt.tree.registry import NodeRegistry

_PAUSE_S: Final = 0.1  # in typing, before a text is checked
_TRIGGERS: Final = types.CompletionOptions(trigger_characters=["<", " ", '"', "{", "@", "/"])
# The part of a line that a finding is about: a tag's name, an attribute, or a character.
_MARKED: Final = re.compile(r"</?[^\s/>]+|[^\s=<>]+\s*=\s*(?:\"[^\"\n]*\"?|'[^'\n]*'?)|.|")


def serve(registry: NodeRegistry) -> None:
    """Serve one editor until it closes the connection."""
    server = LanguageServer("uav-bt", __version__, types.TextDocumentSyncKind.Full)
    session = _Session(server, registry)
    # The library sets attributes on a handler, which a method cannot have.
    server.feature(types.TEXT_DOCUMENT_DID_OPEN)(partial(session.read_again))
    server.feature(types.TEXT_DOCUMENT_DID_SAVE)(partial(session.read_again))
    server.feature(types.TEXT_DOCUMENT_DID_CHANGE)(partial(session.changed))
    server.feature(types.TEXT_DOCUMENT_DID_CLOSE)(partial(session.closed))
    server.feature(types.TEXT_DOCUMENT_COMPLETION, _TRIGGERS)(partial(session.complete))
    server.feature(types.TEXT_DOCUMENT_HOVER)(partial(session.hover))
    server.start_io()


class _Session:
    """One editor's documents and folder."""

    def __init__(self, server: LanguageServer, registry: NodeRegistry) -> None:
        self._server = server
        self._registry = registry
        self._lookups: dict[Path | None, Lookup] = {}  # by folder

    def read_again(self, _: object) -> None:
        """Check all documents with the files of the folder, which may have changed."""
        self._lookups.clear()
        for document in [*self._server.workspace.text_documents.values()]:
            self._check(document)

    async def changed(self, params: types.DidChangeTextDocumentParams) -> None:
        await asyncio.sleep(_PAUSE_S)
        document = self._server.workspace.get_text_document(params.text_document.uri)
        if document.version == params.text_document.version:  # neither changed again nor closed
            self._check(document)

    def closed(self, params: types.DidCloseTextDocumentParams) -> None:
        none = types.PublishDiagnosticsParams(params.text_document.uri, [])
        self._server.text_document_publish_diagnostics(none)

    def complete(self, params: types.CompletionParams) -> list[types.CompletionItem]:
        part, _, names = self._at(params)
        items = []
        for name in names:
            edit = types.TextEdit(part, name.text + name.more)
            # Neovim 0.11 filters by `filter_text` alone.
            item = types.CompletionItem(name.text, filter_text=name.text, text_edit=edit)
            item.documentation = _markdown(name.doc)
            items.append(item)
        return items

    def hover(self, params: types.HoverParams) -> types.Hover | None:
        part, text, names = self._at(params, behind=1)
        doc = _markdown(next((name.doc for name in names if name.text == text), ""))
        return None if doc is None else types.Hover(doc, part)

    def _at(self, params: Any, behind: int = 0) -> tuple[types.Range, str, list[Name]]:
        """Return the part of a document that the cursor is in, its text, and the names for it."""
        document = self._server.workspace.get_text_document(params.text_document.uri)
        text, codec, path = document.source, document.position_codec, Path(document.path)
        lines, line, column = _lines(text), params.position.line, params.position.character
        place = codec.position_from_client_units(lines, params.position)
        at = sum(map(len, lines[: place.line])) + place.character + behind
        start, end, found = Names(self._registry, self._lookup(path), path, text).at(at)
        first = types.Position(line, column - codec.client_num_units(text[start:at]))
        last = types.Position(line, column + codec.client_num_units(text[at:end]))
        return types.Range(first, last), text[start:end], found

    def _lookup(self, path: Path) -> Lookup:
        """Return the trees of the editor's folder as saved; outside of it the shipped ones."""
        root = self._server.workspace.root_path
        folder = None if root is None else Path(root).resolve()
        if folder is None or not path.resolve().is_relative_to(folder):
            folder = None
        if folder not in self._lookups:
            files: tuple[Path, ...] = ()
            try:
                files = files_in(folder) if folder is not None else ()
            except FileError as error:  # it has too many files
                shown = types.ShowMessageParams(types.MessageType.Warning, str(error))
                self._server.window_show_message(shown)
            self._lookups[folder] = Lookup(Library(files))
        return self._lookups[folder]

    def _check(self, document: TextDocument) -> None:
        path, text = Path(document.path), document.source
        data = text.encode(errors="surrogatepass")
        found = check_text(data, self._registry, path=path, lookup=self._lookup(path))
        lines = _lines(text)
        shown = [self._diagnostic(one, path, lines) for one in found]
        params = types.PublishDiagnosticsParams(document.uri, shown, document.version)
        self._server.text_document_publish_diagnostics(params)

    def _diagnostic(self, finding: Finding, path: Path, lines: list[str]) -> types.Diagnostic:
        """Return a finding as the editor shows it; one of another file is at the first line."""
        line, column = finding.position.line - 1, finding.position.column - 1
        message = ": ".join(filter(None, (finding.node, finding.message)))
        if finding.path != str(path):
            line, message = -1, str(finding)
        marked = _MARKED.match(lines[line], column) if 0 <= line < len(lines) else None
        if marked is None:  # the file as a whole
            line, column, part = 0, 0, lines[0].rstrip()
        else:
            part = marked[0]
        count = self._server.workspace.position_codec.client_num_units
        start = types.Position(line, count(lines[line][:column]))
        end = types.Position(line, start.character + count(part))
        severity = types.DiagnosticSeverity[finding.severity.capitalize()]
        return types.Diagnostic(types.Range(start, end), message, severity, source="uav-bt")


def _markdown(text: str) -> types.MarkupContent | None:
    return types.MarkupContent(types.MarkupKind.Markdown, text) if text else None


def _lines(text: str) -> list[str]:
    return [*io.StringIO(text, newline="")] or [""]
