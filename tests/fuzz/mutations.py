"""Mutations of a file's bytes: of bytes, words, lines, JSON values and arrays."""

import io
import json
import re
import zlib
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np

NASTY_WORDS = [
    "nan", "inf", "-inf", "1e308", "-1e308", "1e101", "1e400", "1e-320", "0", "-0.0", "-1", "1", "3", "255", "256", "65536",
    "2147483648", "4294967296", "9223372036854775807", "9223372036854775808", "99999999999999999999", "1" + "0" * 400,
    "1" + "0" * 5000, "1.5", "0x10", "1_000", "٣", "", "a", "a\0b", "\\ud800", "../../etc/passwd", "/dev/zero", "#", "é",
]  # fmt: skip
NASTY_VALUES: list[Any] = [
    None, True, False, 0, -1, 1, 3, 1.5, -0.0, 1e308, 1e101, 1e-320, float("nan"), float("inf"), -float("inf"), 2**31, 2**63,
    2**64, 10**30, 10**400, "", "a", "nan", "1e999", "\0", "\ud800", "../..", "/dev/zero", [], {}, [[]], [1, [2]], [None],
    {"a": 1}, [0] * 200, [[0] * 4] * 4, "x" * 5000, [[[[[[[[[[1]]]]]]]]]],
]  # fmt: skip
_WORD = re.compile(rb"[^\s,:\[\]{}\"]+")


def mutate(data: bytes, name: str, rng: np.random.Generator) -> bytes:
    """The file's content with one to three mutations that suit it."""
    kinds: list[Callable[[bytes, np.random.Generator], bytes]] = [_bytes]
    if name.endswith((".trace", ".flips")):
        kinds = [_bytes, _blocks, _blocks, _blocks, _blocks]
    elif name.endswith(".npz"):
        kinds = [_bytes, _archive, _archive]
    elif name.endswith((".json", ".sfm", ".gltf")):
        kinds = [_bytes, _words, _json, _json, _json]
    elif b"\0" not in data[:1000]:
        kinds = [_bytes, _words, _words, _lines]
    for _ in range(rng.integers(1, 4)):
        data = kinds[rng.integers(len(kinds))](data, rng)
    return data


def _bytes(data: bytes, rng: np.random.Generator) -> bytes:
    """A bit flipped, bytes overwritten, removed, inserted, repeated, or the end cut off."""
    changed = bytearray(data)
    if not changed:
        return b"\0"
    at, length = int(rng.integers(len(changed))), int(2 ** rng.uniform(0, 6))
    kind = rng.integers(7)
    if kind == 0:
        changed[at] ^= 1 << int(rng.integers(8))
    elif kind == 1:
        changed[at : at + length] = rng.bytes(length)
    elif kind == 2:
        del changed[at : at + length]
    elif kind == 3:
        changed[at:at] = rng.bytes(length)
    elif kind == 4:
        changed[at:at] = changed[at : at + length] * int(rng.integers(1, 9))
    elif kind == 5:
        del changed[at:]
    else:
        value = int(rng.choice([0, 1, 0x7F, 0xFF])).to_bytes(1, "little")
        changed[at : at + 8] = value * len(changed[at : at + 8])
    return bytes(changed)


def _words(data: bytes, rng: np.random.Generator) -> bytes:
    words = list(_WORD.finditer(data))
    if not words:
        return _bytes(data, rng)
    word = words[rng.integers(len(words))]
    new = NASTY_WORDS[rng.integers(len(NASTY_WORDS))].encode()
    if rng.random() < 0.5:  # another plausible number, so that more than the reader is reached
        with suppress(ValueError):
            new = repr(_near(float(word.group()), rng)).encode()
    return data[: word.start()] + new + data[word.end() :]


def _near(number: float, rng: np.random.Generator) -> float:
    with np.errstate(all="ignore"):
        return float(
            number * [-1, 0.9, 1.001, 2, 10, 1e3, 1e6, 1e12, 1e30, 1e90][rng.integers(10)] + rng.integers(-1, 2)
        )


def _lines(data: bytes, rng: np.random.Generator) -> bytes:
    """A line removed, repeated, moved or emptied."""
    lines = data.split(b"\n")
    at, other, kind = int(rng.integers(len(lines))), int(rng.integers(len(lines))), rng.integers(4)
    if kind == 0:
        del lines[at]
    elif kind == 1:
        lines[at:at] = [lines[at]] * int(rng.integers(1, 20))
    elif kind == 2:
        lines[at], lines[other] = lines[other], lines[at]
    else:
        lines[at] = b""
    return b"\n".join(lines)


def _json(data: bytes, rng: np.random.Generator) -> bytes:
    """A value replaced, removed, repeated, exchanged with another one, or nested deeply."""
    try:
        content = json.loads(data)
    except (ValueError, RecursionError):
        return _bytes(data, rng)
    places = _places(content)
    if not places:
        return _bytes(data, rng)
    holder, key = places[rng.integers(len(places))]
    other, other_key = places[rng.integers(len(places))]
    kind = rng.integers(8)
    if kind < 2 and isinstance(holder[key], int | float):
        holder[key] = _near(float(min(holder[key], 10**300)), rng)
    elif kind < 4:
        holder[key] = NASTY_VALUES[rng.integers(len(NASTY_VALUES))]
    elif kind == 4:
        del holder[key]
    elif kind == 5:
        holder[key] = json.loads(json.dumps(other[other_key]))
    elif kind == 6:
        holder[key] = json.loads("[" * 300 + "]" * 300)
    elif isinstance(holder, list):
        holder.extend([holder[key]] * int(rng.integers(1, 20)))
    else:
        holder["unknown"] = holder.pop(key)
    return json.dumps(content).encode()


def _places(content: Any) -> list[tuple[Any, Any]]:
    """Every value below the top as its holder and its key."""
    found: list[tuple[Any, Any]] = []
    waiting = [content]
    while waiting:
        holder = waiting.pop()
        keys = holder.keys() if isinstance(holder, dict) else range(len(holder)) if isinstance(holder, list) else ()
        for key in keys:
            found.append((holder, key))
            waiting.append(holder[key])
    return found


def _archive(data: bytes, rng: np.random.Generator) -> bytes:
    """An array of a NumPy archive with other values, shape or type, removed or renamed; the checksums are right."""
    try:
        with np.load(io.BytesIO(data)) as archive:
            arrays = dict(archive)
    except Exception:  # damaged by an earlier mutation
        return _bytes(data, rng)
    if arrays:
        _change_array(arrays, rng)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=True, **arrays)
    return buffer.getvalue()


def _change_array(arrays: dict[str, np.ndarray], rng: np.random.Generator) -> None:
    name = list(arrays)[rng.integers(len(arrays))]
    array, kind = arrays[name], rng.integers(9)
    if name == "text_header" and kind < 6:
        arrays[name] = np.frombuffer(_json(array.tobytes(), rng), np.uint8)
    elif kind < 3 and array.size:
        value = [np.nan, np.inf, -1, 0, 1, 5, 7, 99, 127, 1e101, 1e308, 2**40, 2**62, -(2**62)][rng.integers(14)]
        with np.errstate(all="ignore"):
            changed = array.copy().reshape(-1)
            changed[rng.integers(changed.size)] = np.array(value).astype(changed.dtype)
        arrays[name] = changed.reshape(array.shape)
    elif kind == 3:
        arrays[name] = array[..., :-1] if array.ndim else array.reshape(1)
    elif kind == 4:
        arrays[name] = np.concatenate([array, array]) if array.ndim else array.reshape(1, 1)
    elif kind == 5:
        types = ["f2", "f4", "f8", "i1", "i8", "u8", "c16", "U3", "O", "?", "M8[s]", ">f8", ">i8", "V4"]
        with np.errstate(all="ignore"):
            try:
                arrays[name] = array.astype(types[rng.integers(len(types))])
            except (TypeError, ValueError):
                arrays[name] = np.array([b"abcd"])
    elif kind == 6:
        del arrays[name]
    elif kind == 7:
        arrays[f"{name}x"] = arrays.pop(name)
    else:
        arrays[name] = np.zeros((0, *array.shape[1:]), array.dtype)


def _blocks(data: bytes, rng: np.random.Generator) -> bytes:
    """A block of a record with a mutated payload, removed, repeated or exchanged; the checksums are right."""
    magic, _, rest = data.partition(b"\n")
    payloads = []
    while len(rest) >= 12:
        length = int.from_bytes(rest[:8], "little")
        payloads.append(rest[12 : 12 + length])
        rest = rest[12 + length :]
    if not payloads:
        return _bytes(data, rng)
    at, kind = int(rng.integers(len(payloads))), rng.integers(8)
    if kind < 5:
        payloads[at] = _archive(payloads[at], rng)
    elif kind == 5:
        payloads[at] = _bytes(payloads[at], rng)
    elif kind == 6:
        del payloads[at]
    else:
        payloads[at:at] = [payloads[int(rng.integers(len(payloads)))]]
    blocks = (len(p).to_bytes(8, "little") + zlib.crc32(p).to_bytes(4, "little") + p for p in payloads)
    return magic + b"\n" + b"".join(blocks)
