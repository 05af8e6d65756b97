"""Cells of any recorded moment, recomputed on demand: the paper's figure 3, for every face and view.

None of this is stored. A trace holds the vertices to the bit, a sweep's visibility and robust scale follow from them, and the
compiled functions of the run reproduce its cells, residuals and energies to the last bit.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fairing.cells.context import CellContext
from fairing.cells.visibility import Visibility
from fairing.errors import Cancelled, InputError
from fairing.kernels.faces import show_face
from fairing.run.session import Session


@dataclass(frozen=True, eq=False)
class CellDerivatives:
    """Derivatives of the cells of a face by the position of one of its corners, by world axis.

    Attributes:
        vertex: id of the corner.
        of_cells: (3, n, p) float: dI/dx = grad I . dupsilon/deta, grey levels / world unit; 0 where masked.
        of_residuals: (3, n, p) float: de/dx, what the normal equations use: without what the eigenspace takes up, if the options
            eliminate it.
    """

    vertex: int
    of_cells: np.ndarray
    of_residuals: np.ndarray


@dataclass(frozen=True, eq=False)
class FaceCells:
    """The cells of one face, n views, N x N samples in a right triangle, p samples (times three with colour).

    A sample lies at row r and column c of the cell. Corner 2 of the face is the cell's right angle at the top left,
    corner 0 lies to its right, corner 1 below it. `as_images` arranges values in this order.

    Attributes:
        face: id.
        moment: the moment they belong to.
        size: N.
        inset: border of the face that the cells leave out, as a fraction of its height.
        channels: 1 (grey) or 3.
        views: (n,) int: the view of each cell.
        observed: (n, p) float32: I, grey levels.
        reconstruction: (n, p) float32: U c, grey levels (with the mean cell and means added if the options subtract them).
        residual: (n, p) float32: e = I - U c, 0 where masked.
        counts: (n, p) bool: samples that the view really shows; the others are masked.
        weights: (n, p) float32: robust weight rho'(e) / e.
        rho: (n, p) float: robust norm of the residual; its sum over p times `pair_weight` is the view's energy.
        norm: name of the robust norm.
        sigma: scale parameter of the robust norm, grey levels.
        outlier_threshold: e_T, |e| beyond which a residual loses influence, grey levels; infinite if never.
        pair_weight: (n,) float: photo pixels per sample, times the photo's weight.
        view_energy: (n,) float: exactly as recorded.
        basis: (k, p) float32: basis images U, rows orthonormal; k = 0 if too few views see the face.
        singular_values: (n,) float, descending.
        coefficients: (n, k) float: c.
        corners_px: (n, 3, 2) float: the face's corners in the photos, px.
        derivatives: None if not requested, or if the face takes no part.
    """

    face: int
    moment: int
    size: int
    inset: float
    channels: int
    views: np.ndarray
    observed: np.ndarray
    reconstruction: np.ndarray
    residual: np.ndarray
    counts: np.ndarray
    weights: np.ndarray
    rho: np.ndarray
    norm: str
    sigma: float
    outlier_threshold: float
    pair_weight: np.ndarray
    view_energy: np.ndarray
    basis: np.ndarray
    singular_values: np.ndarray
    coefficients: np.ndarray
    corners_px: np.ndarray
    derivatives: CellDerivatives | None = None

    @property
    def takes_part(self) -> bool:
        """Whether the face has an energy (at least three views, k >= 1)."""
        return len(self.basis) > 0

    @property
    def energy(self) -> float:
        """E of Eq. 2 for this face, exactly as recorded."""
        total = 0.0
        for energy in self.view_energy.tolist():
            total += energy
        return total

    @cached_property
    def rows_and_columns(self) -> tuple[np.ndarray, np.ndarray]:
        """Row and column of every sample, (p / channels,) int each."""
        rows, columns = np.nonzero(np.add.outer(np.arange(self.size), np.arange(self.size)) < self.size)
        return rows, columns

    @property
    def spacing(self) -> float:
        """Of the barycentric weights of corners 0 and 1, from a sample to the next."""
        return (1 - 3 * self.inset) / self.size

    def barycentric(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """(q, 3) float: barycentric weights of the samples at rows and columns (q,) int."""
        ramp = self.inset + self.spacing * (np.stack([columns, rows], axis=1) + 1 / 3)
        return np.column_stack([ramp, 1 - ramp.sum(axis=1)])

    def as_images(self, values: np.ndarray) -> np.ndarray:
        """(n, N, N) float, or (n, N, N, 3) in colour, from values (n, p); NaN outside the triangle."""
        rows, columns = self.rows_and_columns
        planes = values.reshape(len(values), self.channels, len(rows))
        images = np.full((len(values), self.size, self.size, self.channels), np.nan)
        images[:, rows, columns] = planes.transpose(0, 2, 1)
        return images[..., 0] if self.channels == 1 else images


def face_cells(
    session: Session,
    face: int,
    moment: int | None = None,
    dimensions: int | None = None,
    vertex: int | None = None,
) -> FaceCells:
    """Cells of a face at a moment, under the visibility and robust scale of the sweep of the moment's next step.

    Their energy is the `face_energy_before` of that step if it is a Gauss-Newton step that includes the face (local searches
    and the smoothing of the start build cells of their own).

    Args:
        face: id.
        moment: default: the session's present moment.
        dimensions: k to use instead of the run's; the run is not changed.
        vertex: the corner of the face to compute derivatives by; default: none are computed.

    Raises:
        IndexError: no such face or moment.
        InputError: a corner of the face lies behind a camera at that moment, or k does not fit the views.
    """
    moment = session.moment if moment is None else moment
    if not 0 <= face < len(session.scene.mesh.faces):
        raise IndexError(f"face {face}: this mesh has faces 0 to {len(session.scene.mesh.faces) - 1}")
    vertices = session.trace.vertices_at(moment)
    sweep = session.sweep_state(moment)
    context = sweep.context if dimensions is None else _with_dimensions(sweep.context, face, dimensions)
    return cells_in_context(
        session, context, vertices, face, moment, float(sweep.sigma[face]), float(sweep.scale[face]), vertex
    )


def cells_of_all_faces(session: Session, moment: int, purpose: str, view: int | None = None) -> Iterator[FaceCells]:
    """The cells of `face_cells` of every face that takes part and has no corner behind a camera, in order.

    Args:
        moment: of the session.
        purpose: reported as the work in progress while the cells are used.
        view: only of the faces in which this photo takes part.

    Raises:
        InputError: no photo sees any face well enough.
        Cancelled: the session's cancellation was requested.
    """
    vertices, sweep = session.trace.vertices_at(moment), session.sweep_state(moment)
    is_wanted = sweep.context.takes_part
    if view is not None:
        is_wanted = is_wanted & (sweep.context.reasons[:, view] <= Visibility.PARTLY_SEEN)
    ids = np.flatnonzero(is_wanted).tolist()
    with session.work.doing(purpose, len(ids), "face") as work:
        for face in work.each(ids):
            if session.cancel_requested():
                raise Cancelled
            sigma, scale = float(sweep.sigma[face]), float(sweep.scale[face])
            try:
                cells = cells_in_context(session, sweep.context, vertices, face, moment, sigma, scale)
            except InputError:  # a corner lies behind a camera
                continue
            yield cells


def energies_by_dimension(session: Session, face: int, moment: int | None = None) -> np.ndarray:
    """Energy of a face for every possible number of eigenspace dimensions, at the run's sigma.

    To first order the misalignment of the cells spans three dimensions, so the first few k absorb most of the energy of a
    misplaced face, which should move the vertex instead.

    Args:
        face: id.
        moment: default: the session's present moment.

    Returns:
        (n - 2,) float: E with k = 1, 2 ... n - 2 for n views; empty for fewer than three views.
    """
    moment = session.moment if moment is None else moment
    largest = int(session.sweep_state(moment).context.n_views[face]) - 2
    return np.array([face_cells(session, face, moment, k).energy for k in range(1, largest + 1)])


def _with_dimensions(context: CellContext, face: int, dimensions: int) -> CellContext:
    """The context with another k for one face."""
    largest = max(0, int(context.n_views[face]) - 2)
    if not 1 <= dimensions <= largest:
        raise InputError(
            f"k = {dimensions}: face {face} is seen by {context.n_views[face]} photos, so k is 1 to {largest}"
        )
    k = context.kernel.face_dimensions.copy()
    k[face] = dimensions
    return replace(context, kernel=context.kernel._replace(face_dimensions=k))


def cells_in_context(
    session: Session,
    context: CellContext,
    vertices: np.ndarray,
    face: int,
    moment: int,
    sigma: float,
    squared_scale: float,
    vertex: int | None = None,
) -> FaceCells:
    """Cells of a face at any vertex positions.

    Args:
        context: the cells' fixed data.
        vertices: (n, 3) float, world units.
        face: id.
        moment: the moment to note in the result.
        sigma: scale parameter of the robust norm, grey levels.
        squared_scale: the same as the kernels use it, see `fairing.norms.norm.Norm.squared_scale`.
        vertex: see `face_cells`.

    Raises:
        InputError: a corner of the face lies behind a camera.
        ValueError: the vertex is not a corner of the face.
    """
    data, norm = context.kernel, context.norm
    pairs = context.pairs_of(face)
    n, k = pairs.stop - pairs.start, int(data.face_dimensions[face])
    grid = int(data.face_grid[face])
    p = int(data.grid_start[grid + 1] - data.grid_start[grid]) * data.channels
    raw, residual, weights, counts = (np.zeros((n, p), dtype=np.float32) for _ in range(4))
    bias = np.zeros(n, dtype=np.float32)
    basis, V = np.zeros((k + 1, p), dtype=np.float32), np.zeros((n, k + 1))
    singular_values, view_energy = np.zeros(n), np.zeros(n)
    corner = _corner_of(session, face, vertex)
    G, hats = np.zeros((0 if corner < 0 else 3, n, p), dtype=np.float32), np.zeros((3, p), dtype=np.float32)
    fitted = show_face(
        data, np.ascontiguousarray(vertices), face, corner, squared_scale,
        raw, bias, residual, weights, counts, basis, V, singular_values, view_energy, G, hats,
    )  # fmt: skip
    if fitted is None:
        raise InputError(f"face {face}: a corner lies behind a camera at moment {moment}, so it has no cells")
    views = data.pair_view[pairs]
    cameras = [session.scene.views[v].camera for v in views]
    corners = vertices[session.scene.mesh.faces[face]]
    return FaceCells(
        face=face,
        moment=moment,
        size=round((np.sqrt(8 * p / data.channels + 1) - 1) / 2),
        inset=float(data.face_inset[face]),
        channels=data.channels,
        views=views,
        observed=raw,
        reconstruction=_reconstruction(raw, fitted, bias[:, None], residual, counts > 0),
        residual=residual,
        counts=counts > 0,
        weights=weights,
        rho=norm.rho(np.abs(residual) / np.sqrt(squared_scale)) if k else np.zeros((n, p)),
        norm=norm.name,
        sigma=sigma,
        outlier_threshold=norm.outlier_threshold * float(np.sqrt(squared_scale)),
        pair_weight=data.pair_weight[pairs],
        view_energy=view_energy,
        basis=basis[:k],
        singular_values=singular_values,
        coefficients=V[:, :k] * singular_values[:k],
        corners_px=np.stack([camera.project(corners)[0] for camera in cameras]) if n else np.zeros((0, 3, 2)),
        derivatives=None
        if vertex is None or k == 0
        else _derivatives(session, vertex, hats[corner] * G, basis[:k], V[:, :k]),
    )


def _corner_of(session: Session, face: int, vertex: int | None) -> int:
    """Which corner of a face a vertex is; -1 without one."""
    corners = session.scene.mesh.faces[face].tolist()
    if vertex is not None and vertex not in corners:
        raise ValueError(f"vertex {vertex}: expected a corner of face {face}, one of {corners}")
    return -1 if vertex is None else corners.index(vertex)


def _derivatives(
    session: Session, vertex: int, of_cells: np.ndarray, basis: np.ndarray, V: np.ndarray
) -> CellDerivatives:
    """Derivatives of cells (3, n, p) and what the solver of the options leaves of them.

    As in `fairing.kernels.normal_equations`: (I - U U^T) dI (I - V V^T) with the eigenspace eliminated; with the means of cells
    and samples removed if the options do that.

    Args:
        basis: (k, p) float: U^T.
        V: (n, k) float.
    """
    options = session.options
    n, p = of_cells.shape[1:]
    eliminated = options.step.solver == "variable_projection"
    views, samples = (V, basis) if eliminated else (V[:, :0], basis[:0])
    if eliminated and options.eigenspace.centered:
        views = np.column_stack([views, np.full(n, 1 / np.sqrt(n))])
    if options.cells.remove_bias:
        samples = np.vstack([samples, np.full(p, 1 / np.sqrt(p))])
    left = of_cells - views @ (views.T @ of_cells)
    return CellDerivatives(vertex, of_cells, left - left @ samples.T @ samples)


def _reconstruction(
    raw: np.ndarray, fitted: np.ndarray, bias: np.ndarray, residual: np.ndarray, counts: np.ndarray
) -> np.ndarray:
    """U c in grey levels (n, p): I - e where the view shows the sample; elsewhere the prediction of the eigenspace.

    `fitted` differs from `raw` by each cell's `bias` and, with a centred eigenspace, by the mean cell; both are added back.
    """
    mean_cell = np.where(counts, raw - fitted - bias, 0).sum(axis=0) / np.maximum(counts.sum(axis=0), 1)
    return np.where(counts, raw - residual, fitted - residual + bias + mean_cell).astype(np.float32)
