"""An editor without a screen: a pygls client that starts our server and uses its pipes."""

from __future__ import annotations

import asyncio
import sys
import threading
from collections.abc import Coroutine
from pathlib import Path
from queue import Empty, Queue
from typing import Any

from lsprotocol import types
from pygls.lsp.client import LanguageClient

_TIMEOUT_S = 60


class Editor:
    """Opens and changes documents, and sends requests to one running server.

    Args:
        folder: the editor's folder.
        arguments: arguments of `uav-bt lsp`.
    """

    def __init__(self, folder: Path, *arguments: str) -> None:
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self._published: Queue[types.PublishDiagnosticsParams] = Queue()
        self.messages: Queue[types.ShowMessageParams] = Queue()
        self._versions: dict[str, int] = {}
        self._wait(self._begin(folder, arguments))

    def _wait(self, work: Coroutine[Any, Any, Any]) -> Any:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(_TIMEOUT_S)

    async def _begin(self, folder: Path, arguments: tuple[str, ...]) -> None:
        self._client = LanguageClient("tests", "1")
        published = self._client.feature(types.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)
        published(lambda params: self._published.put(params))  # noqa: PLW0108 - it is marked, too
        shown = self._client.feature(types.WINDOW_SHOW_MESSAGE)
        shown(lambda params: self.messages.put(params))  # noqa: PLW0108 - it is marked, too
        await self._client.start_io(sys.executable, "-m", "uav_bt", "lsp", *arguments)
        start = types.InitializeParams(types.ClientCapabilities(), root_uri=folder.as_uri())
        await self._client.initialize_async(start)
        self._client.initialized(types.InitializedParams())

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

    def open(self, uri: str, text: str) -> list[types.Diagnostic]:
        """Open a document, and return its diagnostics."""
        self._versions[uri] = 1
        item = types.TextDocumentItem(uri, "xml", 1, text)
        self._send("text_document_did_open", types.DidOpenTextDocumentParams(item))
        return self.diagnostics(uri)

    def change(self, uri: str, *texts: str) -> list[types.Diagnostic]:
        """Change a document, once for each text, and return the diagnostics of the last one."""
        for text in texts:
            self._versions[uri] += 1
            which = types.VersionedTextDocumentIdentifier(self._versions[uri], uri)
            event = types.TextDocumentContentChangeWholeDocument(text)
            params = types.DidChangeTextDocumentParams(which, [event])
            self._send("text_document_did_change", params)
        return self.diagnostics(uri)

    def save(self, uri: str) -> None:
        """Notify the server that a document was saved; older diagnostics are forgotten."""
        try:
            while True:
                self._published.get_nowait()
        except Empty:
            params = types.DidSaveTextDocumentParams(types.TextDocumentIdentifier(uri))
            self._send("text_document_did_save", params)

    def close_document(self, uri: str) -> list[types.Diagnostic]:
        """Close a document, and return its diagnostics."""
        del self._versions[uri]
        which = types.TextDocumentIdentifier(uri)
        self._send("text_document_did_close", types.DidCloseTextDocumentParams(which))
        return self.diagnostics(uri)

    def _send(self, notification: str, params: Any) -> None:
        self._loop.call_soon_threadsafe(getattr(self._client, notification), params)

    def diagnostics(self, uri: str) -> list[types.Diagnostic]:
        """Wait until a document's newest text was checked, and return the diagnostics."""
        while True:
            found = self._published.get(timeout=_TIMEOUT_S)
            if found.uri == uri and found.version == self._versions.get(uri):
                return list(found.diagnostics)

    # --- requests ---------------------------------------------------------------------------------

    def complete(self, uri: str, line: int, character: int) -> dict[str, types.CompletionItem]:
        """Return the completions at a position, by label."""
        params = types.CompletionParams(_document(uri), types.Position(line, character))
        items = self._wait(self._client.text_document_completion_async(params))
        return {item.label: item for item in items}

    def hover(self, uri: str, line: int, character: int) -> str:
        """Return the hover text at a position, empty without one."""
        params = types.HoverParams(_document(uri), types.Position(line, character))
        found = self._wait(self._client.text_document_hover_async(params))
        return "" if found is None else str(found.contents.value)


def _document(uri: str) -> types.TextDocumentIdentifier:
    return types.TextDocumentIdentifier(uri)
