"""How `fuzz_files.py` damages files: their bytes, their words, and the content of records."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Callable, Mapping
from random import Random
from typing import Any, Final

from mcap.reader import make_reader
from mcap.records import Schema
from mcap.writer import CompressionType, Writer

Mutation = Callable[[bytes, Random], bytes]

_BYTES: Final = (
    b"\0",
    b"\xff",
    b"\x7f",
    b"\x80",
    b"\n",
    b"\r",
    b"\t",
    b"\x1b",
    b"\xff\xfe",
    b"\xed\xa0",
)
_WORDS: Final = (
    *(
        "",
        "0",
        "-1",
        "1e999",
        "-1e999",
        "nan",
        ".inf",
        "1e308",
        "9" * 400,
        "9" * 5000,
        "0x" + "f" * 5000,
    ),
    *(
        "null",
        "true",
        "~",
        "[]",
        "{}",
        "''",
        '""',
        "*a",
        "&a",
        "!!int x",
        "!!timestamp x",
        "!!binary x",
    ),
    *(
        "{@height}",
        "{x}",
        "{=}",
        "../../etc/passwd",
        "/dev/zero",
        "x" * 300,
        "x" * 30_000,
        "\ud7ff\uffff",
    ),
    *(
        "<a>" * 200,
        "[" * 500,
        "{a: " * 500,
        "- " * 500,
        "(" * 500,
        "&lt;",
        "<![CDATA[",
        "<!--",
        "2026-13-45",
    ),
)
_WORD: Final = re.compile(r"[A-Za-z_]+|[-+]?[0-9][0-9.eE]*|[{}\[\]<>\"'=:,/#&*!|-]")
_VALUES: Final[tuple[Any, ...]] = (
    *(
        None,
        True,
        -1,
        0,
        1,
        2**31,
        2**63,
        -(2**63),
        10**30,
        1e308,
        -1e308,
        1e-320,
        0.5,
        "",
        "x",
        "NaN",
    ),
    *("Infinity", "-Infinity", "x" * 10_000, [], [None], [[]], {}, {"type": "Land"}, {"type": "?"}),
    *([0.0] * 5, "../x", "/dev/null", "Mission/x", "SUCCESS", "\ud7ff"),
)


def bytes_changed(data: bytes, rng: Random) -> bytes:
    """Change, drop, repeat or move some bytes, or cut the end off."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 5, 30))):
        at = rng.randrange(len(out) + 1)
        size = rng.choice((1, 1, 4, 8, 100, 1000))
        part = bytes(out[at : at + size])
        new = rng.choice(
            (
                rng.randbytes(size),
                b"",
                part * 2,
                part * 50,
                rng.choice(_BYTES),
                bytes(size),
                b"\xff" * size,
            )
        )
        out[at : at + rng.choice((0, size))] = new
    if rng.random() < 0.1:
        del out[rng.randrange(len(out) + 1) :]
    return bytes(out)


def bits_changed(data: bytes, rng: Random) -> bytes:
    """Turn single bits over."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 2, 10, 100))):
        out[rng.randrange(len(out))] ^= 1 << rng.randrange(8)
    return bytes(out)


def words_changed(data: bytes, rng: Random) -> bytes:
    """Put odd words, or others of the same file, in the place of some."""
    text = data.decode(errors="replace")
    words = list(_WORD.finditer(text))
    if not words:
        return bytes_changed(data, rng)
    for match in sorted(rng.choices(words, k=rng.choice((1, 1, 2, 4))), key=lambda m: -m.start()):
        other = rng.choice((rng.choice(_WORDS), rng.choice(words)[0], match[0] * 2))
        text = text[: match.start()] + other + text[match.end() :]
    return text.encode(errors="surrogatepass")


def lines_changed(data: bytes, rng: Random) -> bytes:
    """Drop, repeat, move or indent lines."""
    lines = data.splitlines(keepends=True) or [b""]
    for _ in range(rng.choice((1, 2, 4))):
        at, to = rng.randrange(len(lines)), rng.randrange(len(lines))
        part = lines[at : at + rng.choice((1, 1, 3))]
        lines[to:to] = rng.choice((part, part * 20, [b"  " + line for line in part]))
        if rng.random() < 0.5:
            del lines[rng.randrange(len(lines))]
    return b"".join(lines)


def json_lines_changed(data: bytes, rng: Random) -> bytes:
    """Change values within a line of JSON, whose form stays good."""
    lines = data.splitlines() or [b"{}"]
    at = rng.randrange(len(lines))
    lines[at] = _value_changed(lines[at], rng)
    return b"\n".join(lines) + b"\n"


def json_changed(data: bytes, rng: Random) -> bytes:
    """Change values within a file of JSON, whose form stays good."""
    return _value_changed(data, rng)


def content_changed(data: bytes, rng: Random) -> bytes:
    """Write a record anew, whole and with right checksums, with other messages and metadata."""
    reader, out = make_reader(io.BytesIO(data)), io.BytesIO()
    compression = rng.choice(list(CompressionType))
    writer = Writer(out, chunk_size=rng.choice((1, 10_000, 4_000_000)), compression=compression)
    writer.start()
    share = rng.choice((0.003, 0.03, 0.3))
    only = rng.choice((None, None, "json", "protobuf"))
    for meta in reader.iter_metadata():
        if rng.random() < 0.3:
            name = rng.choice(list(meta.metadata))
            meta.metadata[name] = _text_changed(meta.metadata[name], rng)
        writer.add_metadata(meta.name, meta.metadata)
    for file in reader.iter_attachments():
        changed = rng.random() < 0.1
        name = rng.choice(("../x", "/x", "", "a" * 300, ".", file.name)) if changed else file.name
        content = words_changed(file.data, rng) if rng.random() < 0.1 else file.data
        writer.add_attachment(file.create_time, file.log_time, name, file.media_type, content)
    ids: dict[int, int] = {}
    for schema, channel, message in reader.iter_messages():
        if channel.id not in ids:
            known = schema or Schema(id=0, name="", encoding="", data=b"")
            number = writer.register_schema(known.name, known.encoding, known.data)
            ids[channel.id] = writer.register_channel(
                channel.topic, channel.message_encoding, number
            )
        content, time_ns = message.data, message.log_time
        if rng.random() < share and only in (None, channel.message_encoding):
            is_json = channel.message_encoding == "json"
            content = (_value_changed if is_json else bytes_changed)(content, rng)
            time_ns = rng.choice((time_ns, time_ns, 0, 2**63, time_ns + 10**12))
        if rng.random() > share / 10:
            writer.add_message(ids[channel.id], time_ns, content, time_ns)
    writer.finish()
    return out.getvalue()


def _text_changed(text: str, rng: Random) -> str:
    if text[:1] in ("{", "[") and rng.random() < 0.7:
        return _value_changed(text.encode(), rng).decode(errors="replace")
    return words_changed(text.encode(), rng).decode(errors="replace")


def _value_changed(data: bytes, rng: Random) -> bytes:
    try:
        value = json.loads(data)
    except ValueError:
        return bytes_changed(data, rng)
    if rng.random() < 0.1:
        return words_changed(data, rng)
    holders: list[tuple[Any, Any]] = []

    def walk(one: Any) -> None:
        pairs = (
            one.items()
            if isinstance(one, dict)
            else enumerate(one)
            if isinstance(one, list)
            else ()
        )
        for key, inner in pairs:
            holders.append((one, key))
            walk(inner)

    walk(value)
    if not holders:
        return json.dumps(rng.choice(_VALUES)).encode()
    for _ in range(rng.choice((1, 1, 3))):
        holder, key = rng.choice(holders)
        if rng.random() < 0.2 and isinstance(holder, dict):
            holder.pop(key, None)
        elif isinstance(holder, dict) or key < len(holder):
            holder[key] = rng.choice(_VALUES)
    return json.dumps(value).encode()


_TEXT: Final = (bytes_changed, words_changed, words_changed, lines_changed)
_BINARY: Final = (bytes_changed, bits_changed)

MUTATIONS: Final[Mapping[str, tuple[Mutation, ...]]] = {
    ".xml": _TEXT,
    ".yaml": _TEXT,
    ".csv": _TEXT,
    ".jsonl": (*_TEXT, json_lines_changed, json_lines_changed),
    ".json": (*_TEXT, json_changed, json_changed),
    ".mcap": (*_BINARY, *(content_changed,) * 4),
    ".onnx": _BINARY,
    ".safetensors": _BINARY,
    ".btlog": _BINARY,
}
"""By the suffix of the files."""
