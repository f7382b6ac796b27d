"""Checks behind the typing: each document by itself, the newest text, never two at once."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from typing import Final

from uav_bt.lsp.page import Page
from uav_bt.tree.loading.findings import WHOLE_FILE, Finding

_log: Final = logging.getLogger(__name__)

# Editors ask for completion right behind a keystroke: it is answered before the check takes its
# share of the interpreter. Of several keystrokes that have come meanwhile the last is checked.
_HEAD_START_S: Final = 0.005


class Checks:
    """Checks documents in a thread, so that other requests are answered meanwhile.

    Args:
        check: returns the findings of a page; called in the thread.
        page: returns a document's newest text, None when it was closed.
        publish: takes the findings of a page.
    """

    def __init__(
        self,
        check: Callable[[Page], tuple[Finding, ...]],
        page: Callable[[str], Page | None],
        publish: Callable[[str, Page, tuple[Finding, ...]], None],
    ) -> None:
        self._check = check
        self._page = page
        self._publish = publish
        self._running: dict[str, asyncio.Task[None]] = {}
        self._changed: set[str] = set()

    def request(self, uri: str) -> None:
        """Check a document now, or again when the check that runs has ended."""
        self._changed.add(uri)
        if uri not in self._running:
            task = asyncio.get_running_loop().create_task(self._run(uri))
            self._running[uri] = task
            task.add_done_callback(lambda _: self._running.pop(uri, None))

    async def _run(self, uri: str) -> None:
        while uri in self._changed:
            await asyncio.sleep(_HEAD_START_S)
            self._changed.discard(uri)
            page = self._page(uri)
            if page is None:
                return
            findings = await asyncio.to_thread(self._findings, page)
            # Findings of a text that has changed meanwhile would be shown at wrong places.
            if uri not in self._changed and self._page(uri) is not None:
                self._publish(uri, page, findings)

    def _findings(self, page: Page) -> tuple[Finding, ...]:
        try:
            return self._check(page)
        except Exception as error:  # noqa: BLE001 - an editor's session must outlive a fault of ours
            _log.exception("checking %s", page.path)
            message = f"could not be checked: unexpected {type(error).__name__}: {error}"
            return (Finding(str(page.path), WHOLE_FILE, message),)
