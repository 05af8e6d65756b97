"""Validation of records read from trace files: fields, shapes, number types and ranges.

Runs are exchanged between people, so a file with correct checksums may still hold anything.
"""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from fairing.errors import InputError
from fairing.option_check import check_options
from fairing.options import options_from_dict
from fairing.util.guards import check_coordinates

OWN_TERMS, TERM_FACTS = "own_terms", ("name", "meaning", "file", "digest")
"""Key of a header: the terms of one's own, and the facts of each; the digest is that of its code."""
_LARGEST_COUNT = 1 << 40  # of levels, sweeps, blocks, iterations and rejections


class Field(NamedTuple):
    """What an array of a record must be.

    Attributes:
        kinds: NumPy's letters of the allowed number types.
        shape: lengths of the axes, or a letter for a length that several fields share.
        is_finite: whether NaN and infinity are refused.
    """

    kinds: str
    shape: tuple[int | str, ...] = ()
    is_finite: bool = False


@contextmanager
def naming_block(place: str) -> Iterator[None]:
    """Raises failures while a block is read as InputError that begins with its place."""
    try:
        yield
    except (ValueError, OverflowError) as error:  # InputError is a ValueError, too
        raise InputError(f"{place}: {error}") from None


def check_own_terms(header: dict[str, Any]) -> None:
    """Refuse a header whose terms of one's own make no sense.

    Raises:
        InputError: with what is expected.
    """
    found = header.get(OWN_TERMS, [])
    if not isinstance(found, list) or not all(
        isinstance(term, dict) and all(isinstance(term.get(fact), str) for fact in TERM_FACTS) for term in found
    ):
        raise InputError(
            f"header: expected {OWN_TERMS} as a list of {', '.join(TERM_FACTS)} each; record the run again"
        )


def read_header(texts: dict[str, str]) -> dict[str, Any]:
    """The header of a record from the texts of its first block.

    Raises:
        InputError: there is none, or it is no JSON object.
    """
    try:
        header = json.loads(texts["header"])
    except (KeyError, ValueError, RecursionError):
        header = None
    if not isinstance(header, dict):
        raise InputError("expected a header of facts in JSON, found none; record it again")
    return header


def check_run_header(header: dict[str, Any]) -> None:
    """Refuse a run's header without the scene and the options that every reader needs.

    Raises:
        InputError: a fact is missing, of another type, or an option out of range.
    """
    if not isinstance(header.get("scene"), str):
        raise InputError("header: expected the scene's name, found none; record the run again")
    views = header.get("views")
    if not isinstance(views, list) or not all(isinstance(name, str) for name in views):
        raise InputError("header: expected a list of photo names (views), found none; record the run again")
    if not isinstance(header.get("options"), dict):
        raise InputError("header: expected the run's options, found none; record the run again")
    check_options(options_from_dict(header["options"]))
    if not isinstance(header.get("refinement", {}), dict):
        raise InputError("header: expected what refinement of the cameras found, as an object; record the run again")
    check_own_terms(header)
    points = header.get("sparse_points")
    if points is not None and not (isinstance(points, dict) and {"count", "digest"} <= points.keys()):
        raise InputError("header: expected count and digest of sparse_points, found neither; record the run again")


def check_fields(values: dict[str, np.ndarray], expected: dict[str, Field], lengths: dict[str, int]) -> None:
    """Refuse missing, unknown and ill-shaped arrays.

    Args:
        values: arrays by field name.
        lengths: the lengths known already, by letter; the others are added as they are found.

    Raises:
        InputError: naming the field.
    """
    for name in expected:
        if name not in values:
            raise InputError(f"expected the field {name}, found only {', '.join(sorted(values)) or 'nothing'}")
    for name, array in values.items():
        if name not in expected:
            raise InputError(f"expected no field {name}; open it with the version that wrote it")
        field = expected[name]
        if array.ndim == len(field.shape):
            for length, known in zip(array.shape, field.shape, strict=True):
                if isinstance(known, str):
                    lengths.setdefault(known, length)
        shape = tuple(lengths.get(known, -1) if isinstance(known, str) else known for known in field.shape)
        if array.shape != shape or array.dtype.kind not in field.kinds:
            found = f"{array.dtype} of shape {array.shape}"
            raise InputError(f"{name}: expected {_KINDS[field.kinds]} of shape {shape}, found {found}")
        if field.is_finite and not np.isfinite(array).all():
            raise InputError(f"{name}: expected finite numbers, found NaN or infinity")


def check_ids(ids: np.ndarray, count: int, name: str) -> None:
    """Refuse ids outside 0 to count - 1.

    Args:
        ids: int array of any shape.

    Raises:
        InputError: naming the field.
    """
    if ids.size and (ids.min() < 0 or ids.max() >= count):
        bad = int(ids.min()) if ids.min() < 0 else int(ids.max())
        raise InputError(f"{name}: expected ids of 0 to {count - 1}, found {bad}")


def check_counts(values: np.ndarray, name: str) -> None:
    """Refuse negative or absurd counts.

    Args:
        values: int array of any shape.

    Raises:
        InputError: naming the field.
    """
    if values.size and not 0 <= int(values.min()) <= int(values.max()) <= _LARGEST_COUNT:
        raise InputError(f"{name}: expected counts from 0, found {int(values.min())} to {int(values.max())}")


def check_positions(positions: np.ndarray, name: str) -> None:
    """Refuse positions (u, 3), world units, that are not finite or implausibly large.

    Raises:
        InputError: naming the field.
    """
    check_coordinates(positions, name)


_KINDS = {"iu": "whole numbers", "f": "floating-point numbers"}
