"""Face normals, face quality, and the test for flipped, folded or collapsed faces."""

import numpy as np

from fairing.options import StepOptions


def face_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(m, 3) float: normals with length twice the faces' areas, from vertices (n, 3) float and faces (m, 3) int."""
    corners = vertices[faces]
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def unit_normals(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(m, 3) and (m,) float: the faces' unit normals, zero for a collapsed face, and twice their areas."""
    normals = face_normals(vertices, faces)
    doubled = np.linalg.norm(normals, axis=1)
    return normals / np.maximum(doubled, 1e-300)[:, None], doubled


def face_quality(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(m,) float: height over longest edge, from vertices (n, 3) float and faces (m, 3) int.

    0.87 for an equilateral triangle, 0 for a collapsed one.
    """
    corners = vertices[faces]
    edges = corners[:, [1, 2, 0]] - corners
    longest_squared = (edges**2).sum(-1).max(-1)
    return np.linalg.norm(face_normals(vertices, faces), axis=1) / np.maximum(longest_squared, 1e-300)


def folded_faces(
    before: np.ndarray, after: np.ndarray, start: np.ndarray, faces: np.ndarray, options: StepOptions
) -> np.ndarray:
    """(m,) bool: faces that a step flips, folds over or collapses.

    Args:
        before, after, start: (n, 3) float, world units: vertices before the step, after it and at the start of the run.
        faces: (m, 3) int.
    """
    old, new, first = (face_normals(v, faces) for v in (before, after, start))
    lengths = [np.maximum(np.linalg.norm(x, axis=1), 1e-300) for x in (old, new, first)]
    turn = (old * new).sum(1) / (lengths[0] * lengths[1])
    total_turn = (first * new).sum(1) / (lengths[2] * lengths[1])
    old_turn = (first * old).sum(1) / (lengths[2] * lengths[0])
    quality, old_quality = face_quality(after, faces), face_quality(before, faces)
    return (
        (turn < np.cos(np.deg2rad(options.max_turn)))
        | ((total_turn < 0.05) & (total_turn < old_turn))
        | ((quality < options.min_quality) & (quality < old_quality))
    )
