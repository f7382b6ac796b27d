"""Language server of tree files, over standard input and output."""

from __future__ import annotations

import functools
import gc
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from lsprotocol import types
from pygls import uris
from pygls.exceptions import JsonRpcInvalidParams
from pygls.lsp.server import LanguageServer

from uav_bt import __version__
from uav_bt.errors import InputError, TreeError
from uav_bt.lsp.checks import Checks
from uav_bt.lsp.complete import Completer
from uav_bt.lsp.desk import Desk
from uav_bt.lsp.diagnostics import Reports, code_actions, diagnostic
from uav_bt.lsp.explain import hover
from uav_bt.lsp.find import definitions, references, symbols, use_at
from uav_bt.lsp.names import What
from uav_bt.lsp.nodes import Nodes
from uav_bt.lsp.page import Page
from uav_bt.lsp.rename import renamed
from uav_bt.lsp.workspace import Folders
from uav_bt.tree.editing.layout import format_source
from uav_bt.tree.loading.findings import Finding
from uav_bt.tree.loading.lookup import TREE_SUFFIXES
from uav_bt.tree.registry import NodeRegistry
from uav_bt.types.place import FILE_SUFFIXES

_PALETTE: Final = "palette"  # owner of the palette's findings; no document has this URI
_TRIGGERS: Final = ["<", " ", '"', "{", "@", "/"]


def serve(registry: NodeRegistry, palette: Path | None = None) -> None:
    """Serve one editor until it closes the connection.

    Args:
        registry: the nodes that are installed.
        palette: a file that describes further nodes.
    """
    server = make_server(registry, palette)
    gc.freeze()  # modules and nodes stay: a collection while one types need not look at them
    server.start_io()


def make_server(registry: NodeRegistry, palette: Path | None = None) -> LanguageServer:
    """Return a server with all its features.

    Args:
        registry: the nodes that are installed.
        palette: a file that describes further nodes.
    """
    server = LanguageServer("uav-bt", __version__)
    session = _Session(server, Nodes(registry, palette))
    completion = types.CompletionOptions(trigger_characters=_TRIGGERS)
    actions = types.CodeActionOptions(code_action_kinds=[types.CodeActionKind.QuickFix])
    features: tuple[tuple[str, Callable[..., Any], object], ...] = (
        (types.INITIALIZED, session.began, None),
        (types.WORKSPACE_DID_CHANGE_WORKSPACE_FOLDERS, session.moved, None),
        (types.WORKSPACE_DID_CHANGE_WATCHED_FILES, session.disk_changed, None),
        (types.TEXT_DOCUMENT_DID_OPEN, session.opened, None),
        (types.TEXT_DOCUMENT_DID_CHANGE, session.changed, None),
        (types.TEXT_DOCUMENT_DID_SAVE, session.saved, None),
        (types.TEXT_DOCUMENT_DID_CLOSE, session.closed, None),
        (types.TEXT_DOCUMENT_COMPLETION, session.complete, completion),
        (types.TEXT_DOCUMENT_HOVER, session.hover, None),
        (types.TEXT_DOCUMENT_DEFINITION, session.define, None),
        (types.TEXT_DOCUMENT_REFERENCES, session.refer, None),
        (types.TEXT_DOCUMENT_DOCUMENT_SYMBOL, session.outline, None),
        (types.TEXT_DOCUMENT_FORMATTING, session.format, None),
        (types.TEXT_DOCUMENT_CODE_ACTION, session.act, actions),
        (types.TEXT_DOCUMENT_PREPARE_RENAME, session.prepare_rename, None),
        (types.TEXT_DOCUMENT_RENAME, session.rename, types.RenameOptions(prepare_provider=True)),
    )
    for name, handler, options in features:
        server.feature(name, options)(_handler(handler))
    return server


def _handler(method: Callable[..., Any]) -> Callable[..., Any]:
    """Return a method as a function, because the library notes the request's name on it."""

    @functools.wraps(method)
    def answer(params: Any) -> Any:
        return method(params)

    return answer


class _Session:
    """One editor's documents, and the answers to its requests."""

    def __init__(self, server: LanguageServer, nodes: Nodes) -> None:
        self._server = server
        self._nodes = nodes
        self._pages: dict[str, tuple[int | None, Page]] = {}
        self._folders = Folders()
        self._reports = Reports()
        self._desk = self._new_desk()
        self._checks = Checks(
            lambda page: self._folders.check(page, self._nodes.registry),
            self._page_if_open,
            self._publish,
        )

    def _new_desk(self) -> Desk:
        return Desk(self._nodes.registry, self._open_pages, self._folders.around, self._units)

    # --- what lies around the documents -----------------------------------------------------------

    def began(self, params: types.InitializedParams) -> None:
        """Take note of the editor's folders, and ask to be informed of changes on the disk."""
        del params
        self._take_folders()
        self._show_palette()
        workspace = self._server.client_capabilities.workspace
        files = None if workspace is None else workspace.did_change_watched_files
        if files is not None and files.dynamic_registration:
            patterns = [f"**/*{suffix}" for suffix in (*TREE_SUFFIXES, *FILE_SUFFIXES)]
            watchers = [types.FileSystemWatcher(pattern) for pattern in patterns]
            options = types.DidChangeWatchedFilesRegistrationOptions(watchers)
            method = types.WORKSPACE_DID_CHANGE_WATCHED_FILES
            self._server.client_register_capability(
                types.RegistrationParams([types.Registration("tree-files", method, options)])
            )

    def moved(self, params: types.DidChangeWorkspaceFoldersParams) -> None:
        """Take note of other folders."""
        del params
        self._take_folders()
        self._check_all()

    def _take_folders(self) -> None:
        workspace = self._server.workspace
        uris_given = [folder.uri for folder in workspace.folders.values()]
        roots = uris_given or [uri for uri in [workspace.root_uri] if uri]
        self._folders.take(map(_path, roots))

    def disk_changed(self, params: types.DidChangeWatchedFilesParams) -> None:
        """Check all open documents: a tree or an included file may be another."""
        changed = {_path(event.uri).resolve() for event in params.changes}
        if self._nodes.path is not None and self._nodes.path.resolve() in changed:
            self._nodes.read()
            self._desk = self._new_desk()
            self._show_palette()
        self._check_all()

    def _show_palette(self) -> None:
        path = self._nodes.path
        if path is not None:
            page = self._desk.page(path.resolve()) or Page("", path.absolute())
            self._publish(_PALETTE, page, self._nodes.findings)

    def _check_all(self) -> None:
        self._folders.note_change()
        for uri in self._open_uris():
            self._checks.request(uri)

    # --- documents --------------------------------------------------------------------------------

    def _units(self, text: str) -> int:
        count: int = self._server.workspace.position_codec.client_num_units(text)
        return count

    def _open_uris(self) -> list[str]:
        """Return the URIs of the open documents as the editor writes them.

        The keys of the library are decoded URIs, which the editor does not know.
        """
        return [document.uri for document in [*self._server.workspace.text_documents.values()]]

    def _page(self, uri: str) -> Page:
        document = self._server.workspace.get_text_document(uri)
        known = self._pages.get(uri)
        if known is None or known[0] != document.version or document.version is None:
            page = Page(document.source, _path(uri), self._units, uri)
            known = (document.version, page)
            if uri in self._open_uris():
                self._pages[uri] = known
        return known[1]

    def _page_if_open(self, uri: str) -> Page | None:
        return self._page(uri) if uri in self._open_uris() else None

    def _open_pages(self) -> list[Page]:
        return [self._page(uri) for uri in self._open_uris()]

    def opened(self, params: types.DidOpenTextDocumentParams) -> None:
        """Check a document that was opened."""
        self._pages.pop(params.text_document.uri, None)
        self._folders.note_change()  # not every editor informs of the disk
        self._checks.request(params.text_document.uri)

    def changed(self, params: types.DidChangeTextDocumentParams) -> None:
        """Check a document that was changed."""
        self._checks.request(params.text_document.uri)

    def saved(self, params: types.DidSaveTextDocumentParams) -> None:
        """Check all open documents: another may use the one that was saved."""
        del params
        self._check_all()

    def closed(self, params: types.DidCloseTextDocumentParams) -> None:
        """Forget a document."""
        uri = params.text_document.uri
        page = self._pages.pop(uri, (None, Page("", _path(uri), uri=uri)))[1]
        self._publish(uri, page, ())

    def _publish(self, uri: str, page: Page, findings: tuple[Finding, ...]) -> None:
        changed = self._reports.update(uri, findings)
        for path in (page.path, *sorted(changed - {page.path})):
            about = page if path == page.path else self._desk.page(path.resolve())
            if about is None:
                about = Page("", path)  # unreadable, as the finding says
            open_page = self._pages.get(about.uri)
            self._server.text_document_publish_diagnostics(
                types.PublishDiagnosticsParams(
                    uri=about.uri,
                    version=None if open_page is None else open_page[0],
                    diagnostics=[diagnostic(one, about) for one in self._reports.of(path)],
                )
            )

    # --- requests ---------------------------------------------------------------------------------

    def _at(self, params: Any) -> tuple[Page, int]:
        page = self._page(params.text_document.uri)
        return page, page.offset(params.position)

    def complete(self, params: types.CompletionParams) -> list[types.CompletionItem]:
        """Return the completions at the cursor."""
        page, offset = self._at(params)
        return Completer(self._desk, page, offset, snippets=self._takes_snippets()).items()

    def _takes_snippets(self) -> bool:
        document = self._server.client_capabilities.text_document
        completion = None if document is None else document.completion
        item = None if completion is None else completion.completion_item
        return bool(item is not None and item.snippet_support)

    def hover(self, params: types.HoverParams) -> types.Hover | None:
        """Return the text for the thing under the cursor."""
        return hover(self._desk, *self._at(params))

    def define(self, params: types.DefinitionParams) -> list[types.Location]:
        """Return where the thing under the cursor is defined."""
        return definitions(self._desk, *self._at(params))

    def refer(self, params: types.ReferenceParams) -> list[types.Location]:
        """Return where the name under the cursor stands."""
        declaration = params.context.include_declaration
        return references(self._desk, *self._at(params), declaration=declaration)

    def outline(self, params: types.DocumentSymbolParams) -> list[types.DocumentSymbol]:
        """Return a document's trees and nodes."""
        return symbols(self._page(params.text_document.uri))

    def format(self, params: types.DocumentFormattingParams) -> list[types.TextEdit]:
        """Lay a document out; one that is not well-formed stays as it is."""
        page = self._page(params.text_document.uri)
        try:
            data = page.text.encode(errors="surrogatepass")
            text = format_source(data, page.path).decode()
        except TreeError:
            return []
        return page.edits_to(text)

    def act(self, params: types.CodeActionParams) -> list[types.CodeAction]:
        """Return the quick fixes of the underlined findings."""
        uri = params.text_document.uri
        return code_actions(self._page(uri), uri, params)

    def prepare_rename(self, params: types.PrepareRenameParams) -> types.Range | None:
        """Return the name that would be replaced; None where nothing can be renamed."""
        page, offset = self._at(params)
        use = use_at(self._desk, page, offset)
        nameless = use is None or use.what is What.KEY
        return None if nameless or use is None else page.range(use.start, use.end)

    def rename(self, params: types.RenameParams) -> types.WorkspaceEdit:
        """Return the edits that rename a tree or a variable.

        Raises:
            JsonRpcInvalidParams: it cannot be renamed so.
        """
        try:
            return renamed(self._desk, *self._at(params), params.new_name)
        except InputError as error:
            raise JsonRpcInvalidParams(str(error)) from error


def _path(uri: str) -> Path:
    """Return the path of a document; for an unsaved one (`untitled:...`) its name."""
    found = uris.to_fs_path(uri) if uri.startswith("file:") else None
    return Path(found or uri)
