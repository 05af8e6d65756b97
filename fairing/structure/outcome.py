"""What the worker found, in words: why photos could not be placed.

Facts, as the worker writes them; photos are named by index:

| name | content |
|---|---|
| `features` | number of features of each photo |
| `pairs` | [i, j, number of matches that fit a pair of cameras] |
| `groups` | the photos of each model, the largest model first |
| `focal_lengths` | of the cameras of the first model, px |
| `reprojection` | mean reprojection error of the first model, px |
| `pycolmap` | version |
"""

from collections.abc import Sequence
from typing import Any

FEW_FEATURES = 200
"""A photo with fewer is blank, blurred or very small."""


def reasons_for_missing(facts: dict[str, Any], names: Sequence[str]) -> dict[int, str]:
    """The reason for each photo that was not placed, by index.

    Args:
        names: of all photos, by index.
    """
    groups = facts["groups"]
    placed = set(groups[0]) if groups else set()
    best: dict[int, tuple[int, int]] = {}
    best_of_all: dict[int, tuple[int, int]] = {}
    for i, j, count in facts["pairs"]:
        for photo, other in ((i, j), (j, i)):
            best_of_all[photo] = max(best_of_all.get(photo, (0, 0)), (count, other))
            if other in placed:
                best[photo] = max(best.get(photo, (0, 0)), (count, other))
    reasons = {}
    for key, n_features in facts["features"].items():
        photo = int(key)
        if photo in placed:
            continue
        group = next((group for group in groups[1:] if photo in group), None)
        if n_features < FEW_FEATURES:
            reasons[photo] = f"only {n_features} features: blank, blurred or too small"
        elif photo not in best_of_all:
            reasons[photo] = "shows nothing that another photo shows from a similar place"
        elif group is not None and photo not in best:
            reasons[photo] = f"belongs to a group of {len(group)} photos that no photo joins to the others"
        elif photo not in best:
            count, other = best_of_all[photo]
            reasons[photo] = f"matches only photos that are not placed ({count} features of {names[other]})"
        else:
            count, other = best[photo]
            reasons[photo] = f"too few matches with placed photos (at most {count}, with {names[other]})"
    return reasons


def nothing_placed(facts: dict[str, Any], n_photos: int) -> str:
    """Why no cameras were found for any photos, and what to do."""
    most = max((count for _, _, count in facts["pairs"]), default=0)
    matching = len({photo for i, j, _ in facts["pairs"] for photo in (i, j)})
    found = f"{matching} of {n_photos} photos match another (at most {most} features)"
    return (
        f"expected photos that overlap, found no two from which cameras can be computed: {found}; take photos of a textured, "
        "matt surface from places a few steps apart, each part in three photos or more"
    )
