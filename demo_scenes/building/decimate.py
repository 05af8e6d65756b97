"""Decimation of a mesh by quadric error metrics (Garland and Heckbert, SIGGRAPH 1997): edges collapse, cheapest first."""

import heapq

import numpy as np

BORDER_WEIGHT = 10.0  # of the planes that hold border edges, relative to those of faces
LEAST_COSINE = 0.3  # between a face's normals before and after a collapse
LEAST_SHAPE = 0.1  # height of a face over its longest edge after a collapse, unless it was flatter before
REGULARIZATION = 1e-6  # pull of the optimal place to the edge's middle where the quadric leaves it free


def decimate(vertices: np.ndarray, faces: np.ndarray, n_faces: int) -> tuple[np.ndarray, np.ndarray]:
    """A mesh of about `n_faces` faces with the same borders; it stays an oriented two-manifold.

    Args:
        vertices: (n, 3) float.
        faces: (m, 3) int, an oriented two-manifold with or without border.

    Returns:
        Vertices (p, 3) and faces (q, 3), q <= n_faces unless no further edge can collapse.
    """
    state = _State(vertices, faces)
    heap = [(state.cost(a, b)[0], a, b, 0, 0) for a, b in sorted(state.edges())]
    heapq.heapify(heap)
    while state.n_faces > n_faces and heap:
        _, a, b, age_a, age_b = heapq.heappop(heap)
        if state.age.get(a) != age_a or state.age.get(b) != age_b or not state.collapse(a, b):
            continue
        for c in sorted(state.neighbours(a)):
            low, high = min(a, c), max(a, c)
            heapq.heappush(heap, (state.cost(low, high)[0], low, high, state.age[low], state.age[high]))
    return state.mesh()


class _State:
    """A mesh in the course of decimation; a vertex ages with each collapse into it, which outdates its queued edges."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        self.places = vertices.copy()
        self.faces: list[tuple[int, int, int] | None] = [(int(a), int(b), int(c)) for a, b, c in faces]
        self.n_faces = len(faces)
        self.ring: list[set[int]] = [set() for _ in vertices]
        for f, face in enumerate(faces.tolist()):
            for v in face:
                self.ring[v].add(f)
        self.age = dict.fromkeys(range(len(vertices)), 0)
        self.quadrics = self._quadrics(vertices, faces)

    def _quadrics(self, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
        """(n, 4, 4) float: squared distances to the planes of a vertex's faces and borders, weighted by area."""
        quadrics = np.zeros((len(vertices), 4, 4))
        corners = vertices[faces]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(cross, axis=1)
        normals = cross / area[:, None]
        planes = np.column_stack([normals, -(normals * corners[:, 0]).sum(axis=1)])
        for k in range(3):
            np.add.at(quadrics, faces[:, k], area[:, None, None] * planes[:, :, None] * planes[:, None, :])
        directed = {(face[k], face[(k + 1) % 3]): f for f, face in enumerate(faces.tolist()) for k in range(3)}
        for (a, b), f in directed.items():
            if (b, a) in directed:
                continue
            along = vertices[b] - vertices[a]
            across = np.cross(along, normals[f])
            across /= np.linalg.norm(across)
            plane = np.append(across, -across @ vertices[a])
            for v in (a, b):
                quadrics[v] += BORDER_WEIGHT * (along @ along) * np.outer(plane, plane)
        return quadrics

    def edges(self) -> set[tuple[int, int]]:
        ends = ((face[k], face[(k + 1) % 3]) for face in self.faces if face is not None for k in range(3))
        return {(min(a, b), max(a, b)) for a, b in ends}

    def neighbours(self, v: int) -> set[int]:
        return {w for f in self.ring[v] for w in self._corners(f)} - {v}

    def cost(self, a: int, b: int) -> tuple[float, np.ndarray]:
        """Quadric error of the collapsed edge, and where its vertex goes."""
        Q = self.quadrics[a] + self.quadrics[b]
        middle = (self.places[a] + self.places[b]) / 2
        hold = REGULARIZATION * np.trace(Q[:3, :3]) + 1e-300
        place = np.linalg.solve(Q[:3, :3] + hold * np.eye(3), hold * middle - Q[:3, 3])
        h = np.append(place, 1.0)
        # Among equals the shortest edge first.
        length = float(((self.places[a] - self.places[b]) ** 2).sum())
        return float(h @ Q @ h) + 1e-6 * length * hold / REGULARIZATION, place

    def collapse(self, a: int, b: int) -> bool:
        """Merge b into a, unless the surface would fold or stop being a manifold; returns whether it was done."""
        shared = self.ring[a] & self.ring[b]
        if len(self.neighbours(a) & self.neighbours(b)) != len(shared):
            return False
        if len(shared) == 2 and self._is_border(a) and self._is_border(b):
            return False
        place = self.cost(a, b)[1]
        for f in (self.ring[a] | self.ring[b]) - shared:
            corners = np.array([self.places[v] for v in self._corners(f)])
            moved = np.array([place if v in (a, b) else self.places[v] for v in self._corners(f)])
            before, after = (np.cross(c[1] - c[0], c[2] - c[0]) for c in (corners, moved))
            size = float(np.linalg.norm(before) * np.linalg.norm(after))
            if before @ after < LEAST_COSINE * size or _shape(moved) < min(LEAST_SHAPE, 0.7 * _shape(corners)):
                return False
        for f in shared:
            for v in self._corners(f):
                self.ring[v].discard(f)
            self.faces[f] = None
        self.n_faces -= len(shared)
        for f in self.ring[b]:
            x, y, z = (a if v == b else v for v in self._corners(f))
            self.faces[f] = (x, y, z)
            self.ring[a].add(f)
        self.ring[b] = set()
        self.places[a] = place
        self.quadrics[a] += self.quadrics[b]
        del self.age[b]
        self.age[a] += 1
        return True

    def mesh(self) -> tuple[np.ndarray, np.ndarray]:
        left = np.array([face for face in self.faces if face is not None])
        used, corners = np.unique(left, return_inverse=True)
        return self.places[used], corners.reshape(-1, 3)

    def _corners(self, f: int) -> tuple[int, int, int]:
        face = self.faces[f]
        assert face is not None
        return face

    def _is_border(self, v: int) -> bool:
        return len(self.neighbours(v)) != len(self.ring[v])


def _shape(corners: np.ndarray) -> float:
    """Smallest height of a triangle (3, 3) over its longest edge: at most 0.87."""
    longest = float(((corners - np.roll(corners, 1, axis=0)) ** 2).sum(axis=1).max())
    return float(np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0]))) / max(longest, 1e-300)
