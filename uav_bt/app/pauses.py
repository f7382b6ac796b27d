"""Python's garbage collector, kept from stopping a live mission."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def short_collections() -> Iterator[None]:
    """Let the collector look only at what is made while this lasts.

    What libraries and networks made when they were loaded lives on for ever, and a full collection
    that walks through all of it stops every thread for more than a tenth of a second.
    """
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
