"""An editor without a screen: a pygls client that starts our server and uses its pipes."""

from __future__ import annotations

import asyncio
import sys
import threading
from collections.abc import Coroutine
from pathlib import Path
from queue import Queue
from typing import Any

from lsprotocol import types
from pygls.lsp.client import LanguageClient

_TIMEOUT_S = 60


class Editor:
    """Opens and changes documents, and sends requests to one running server.

    Args:
        arguments: arguments of `uav-bt lsp`.
        snippets: whether the client announces support of snippets.
        folders: open folders; with folders the client announces that it watches files.
    """

    def __init__(
        self, *arguments: str, snippets: bool = False, folders: tuple[Path, ...] = ()
    ) -> None:
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self._arguments = arguments
        self._published: Queue[types.PublishDiagnosticsParams] = Queue()
        self._versions: dict[str, int] = {}
        self.watched: list[str] = []  # patterns that the server asked to be informed of
        self._wait(self._begin(snippets, folders))

    def _wait(self, work: Coroutine[Any, Any, Any]) -> Any:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(_TIMEOUT_S)

    def _registered(self, params: types.RegistrationParams) -> None:
        for one in params.registrations:
            self.watched += [str(each["globPattern"]) for each in one.register_options["watchers"]]

    async def _begin(self, snippets: bool, folders: tuple[Path, ...]) -> None:  # noqa: FBT001
        self._client = LanguageClient("tests", "1")
        published = self._client.feature(types.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)
        published(lambda params: self._published.put(params))  # noqa: PLW0108 - it is marked, too
        registered = self._client.feature(types.CLIENT_REGISTER_CAPABILITY)
        registered(lambda params: self._registered(params))  # noqa: PLW0108 - it is marked, too
        command = ("-m", "uav_bt", "lsp", *self._arguments)
        await self._client.start_io(sys.executable, *command)
        item = types.ClientCompletionItemOptions(snippet_support=snippets)
        completion = types.CompletionClientCapabilities(completion_item=item)
        document = types.TextDocumentClientCapabilities(completion=completion)
        watching = types.DidChangeWatchedFilesClientCapabilities(dynamic_registration=bool(folders))
        workspace = types.WorkspaceClientCapabilities(did_change_watched_files=watching)
        answer = await self._client.initialize_async(
            types.InitializeParams(
                types.ClientCapabilities(text_document=document, workspace=workspace),
                workspace_folders=[_folder(one) for one in folders],
            )
        )
        self.capabilities = answer.capabilities
        self._client.initialized(types.InitializedParams())

    @property
    def process_id(self) -> int:
        """Process id of the server."""
        return int(self._client._server.pid)

    @property
    def alive(self) -> bool:
        """Whether the server still runs."""
        return self._client._server.returncode is None

    def close(self) -> int:
        """Shut the server down, and return its exit code."""
        self._wait(self._client.shutdown_async(None))
        self._client.exit(None)
        process = self._client._server
        self._wait(process.wait())
        self._wait(self._client.stop())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()
        return int(process.returncode)

    # --- documents --------------------------------------------------------------------------------

    def open(self, uri: str, text: str) -> None:
        """Open a document."""
        self._versions[uri] = 1
        item = types.TextDocumentItem(uri, "xml", 1, text)
        self._send("text_document_did_open", types.DidOpenTextDocumentParams(item))

    def change(self, uri: str, *changes: Any) -> None:
        """Change a document: whole texts, or `TextDocumentContentChangePartial`."""
        self._versions[uri] += 1
        whole = types.TextDocumentContentChangeWholeDocument
        events = [whole(one) if isinstance(one, str) else one for one in changes]
        which = types.VersionedTextDocumentIdentifier(self._versions[uri], uri)
        self._send("text_document_did_change", types.DidChangeTextDocumentParams(which, events))

    def close_document(self, uri: str) -> None:
        """Close a document."""
        del self._versions[uri]
        which = types.TextDocumentIdentifier(uri)
        self._send("text_document_did_close", types.DidCloseTextDocumentParams(which))

    def save(self, uri: str) -> None:
        """Notify the server that a document was saved."""
        params = types.DidSaveTextDocumentParams(types.TextDocumentIdentifier(uri))
        self._send("text_document_did_save", params)

    def move(self, old: Path | None, new: Path | None) -> None:
        """Notify the server that one folder was closed and another opened."""
        gone, come = ([] if one is None else [_folder(one)] for one in (old, new))
        event = types.WorkspaceFoldersChangeEvent(added=come, removed=gone)
        params = types.DidChangeWorkspaceFoldersParams(event)
        self._send("workspace_did_change_workspace_folders", params)

    def disk_changed(self, *paths: Path) -> None:
        """Notify the server that files have changed on the disk."""
        events = [types.FileEvent(path.as_uri(), types.FileChangeType.Changed) for path in paths]
        params = types.DidChangeWatchedFilesParams(events)
        self._send("workspace_did_change_watched_files", params)

    def _send(self, notification: str, params: Any) -> None:
        self._loop.call_soon_threadsafe(getattr(self._client, notification), params)

    def diagnostics(self, uri: str) -> list[types.Diagnostic]:
        """Wait until a document's newest text was checked, and return the diagnostics."""
        while True:
            found = self._published.get(timeout=_TIMEOUT_S)
            if found.uri == uri and found.version in {None, self._versions.get(uri)}:
                return list(found.diagnostics)

    # --- requests ---------------------------------------------------------------------------------

    def ask(self, request: str, params: Any) -> Any:
        """Send a request, such as `text_document_hover`, and return the answer."""
        return self._wait(getattr(self._client, f"{request}_async")(params))

    def complete(self, uri: str, line: int, character: int) -> dict[str, types.CompletionItem]:
        """Return the completions at a position, by label."""
        items = self.ask(
            "text_document_completion", _at(types.CompletionParams, uri, line, character)
        )
        return {item.label: item for item in items}

    def hover(self, uri: str, line: int, character: int) -> str:
        """Return the hover text at a position, empty without one."""
        found = self.ask("text_document_hover", _at(types.HoverParams, uri, line, character))
        return "" if found is None else str(found.contents.value)

    def define(self, uri: str, line: int, character: int) -> list[types.Location]:
        """Return the definitions of the name at a position."""
        params = _at(types.DefinitionParams, uri, line, character)
        return list(self.ask("text_document_definition", params))

    def format(self, uri: str) -> list[types.TextEdit]:
        """Return the edits that format a document."""
        params = types.DocumentFormattingParams(
            types.TextDocumentIdentifier(uri), types.FormattingOptions(2, insert_spaces=True)
        )
        return list(self.ask("text_document_formatting", params))

    def rename(self, uri: str, line: int, character: int, new: str) -> dict[str, Any]:
        """Return the edits that rename the name at a position, by document."""
        where = types.Position(line, character)
        params = types.RenameParams(
            text_document=types.TextDocumentIdentifier(uri), position=where, new_name=new
        )
        return dict(self.ask("text_document_rename", params).changes)

    def fixes(self, uri: str, *found: types.Diagnostic) -> list[types.CodeAction]:
        """Return the quick fixes of diagnostics."""
        params = types.CodeActionParams(
            types.TextDocumentIdentifier(uri), found[0].range, types.CodeActionContext(list(found))
        )
        return list(self.ask("text_document_code_action", params))


def _folder(path: Path) -> types.WorkspaceFolder:
    return types.WorkspaceFolder(path.as_uri(), path.name)


def _at(kind: Any, uri: str, line: int, character: int) -> Any:
    return kind(types.TextDocumentIdentifier(uri), types.Position(line, character))


def applied(text: str, edits: list[types.TextEdit]) -> str:
    """Return a text of ASCII characters after edits."""
    lines = text.splitlines(keepends=True)
    starts = [sum(map(len, lines[:number])) for number in range(len(lines) + 1)]

    def offset(position: types.Position) -> int:
        return starts[position.line] + position.character

    for edit in sorted(edits, key=lambda one: offset(one.range.start), reverse=True):
        text = text[: offset(edit.range.start)] + edit.new_text + text[offset(edit.range.end) :]
    return text
