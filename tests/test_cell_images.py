"""The cells' pictures and the question behind them, without a browser."""

import base64
import re
from dataclasses import replace

import numpy as np
import pytest

from app.debugger.cell_queries import CellQuery, cell_facts
from app.page_state.cells_state import KINDS, CellsView
from app.palette import SELECTED
from app.pictures.cell_images import MASKED, CellPictures, arrow_path
from fairing.run.session import Session
from tests.small_scene import corner_scene, small_options

pytestmark = pytest.mark.slow

QUESTION = CellQuery(run_id=0, moment=2, face=1, vertex=0, dimensions=None, with_flows=True)


@pytest.fixture(scope="module")
def session() -> Session:
    session = Session(corner_scene(), small_options(locked_vertices=[1, 2, 3, 4, 5, 6]))
    for _ in range(3):
        session.step()
    return session


def test_the_flows_belong_to_the_last_step_about_the_vertex(session: Session):
    facts = cell_facts(session, QUESTION)
    assert facts.flows is not None
    assert facts.flows.moment == 2
    assert facts.flows.cells.moment == 1
    assert facts.flows.model is not None
    step = session.trace.steps[1]
    camera = session.scene.views[int(facts.flows.cells.views[0])].camera
    expected = camera.J_image_wrt_point(step.before[0]) @ (step.after[0] - step.before[0])
    assert facts.flows.model.vertex_vectors[0] == pytest.approx(expected)
    start = cell_facts(session, replace(QUESTION, moment=0))
    assert start.flows is not None
    assert (start.flows.moment, start.flows.model) == (None, None)
    assert cell_facts(session, replace(QUESTION, with_flows=False)).flows is None


def test_a_k_beyond_the_views_is_lowered_and_the_run_keeps_its_own(session: Session):
    facts = cell_facts(session, replace(QUESTION, dimensions=99))
    assert len(facts.cells.basis) == len(facts.energies) == len(facts.cells.views) - 2
    assert facts.cells.energy == facts.energies[-1]
    assert facts.own_dimensions < len(facts.cells.basis)


def test_pictures_show_the_samples_in_their_place(session: Session):
    cells = cell_facts(session, QUESTION).cells
    pictures = CellPictures(cells)
    image = pictures.picture(0, "photo")
    assert image.shape == (cells.size, cells.size, 3)
    seen = cells.as_images(cells.observed)[0]
    inside = np.isfinite(seen)
    order = np.argsort(seen[inside])
    assert (np.diff(image[inside][order, 0].astype(int)) >= 0).all()
    hidden = cells.as_images(cells.counts.astype(float))[0] == 0
    assert hidden.any()
    assert (pictures.picture(0, "residual")[hidden] == MASKED).all()


def test_outliers_and_only_they_are_marked(session: Session):
    cells = cell_facts(session, QUESTION).cells
    edge = float(np.quantile(np.abs(cells.residual[cells.counts]), 0.9))
    cells = replace(cells, outlier_threshold=edge)
    for row in range(len(cells.views)):
        marked = (CellPictures(cells).picture(row, "weight") == SELECTED).all(axis=-1)
        expected = (np.abs(cells.residual[row]) > edge) & cells.counts[row]
        rows, columns = cells.rows_and_columns
        assert np.array_equal(marked[rows, columns], expected)


def test_values_for_the_page_are_the_samples(session: Session):
    cells = cell_facts(session, QUESTION).cells
    table = np.frombuffer(base64.b64decode(CellPictures(cells).values(2)), "<i2").reshape(3, -1)
    assert table[0] / 64 == pytest.approx(cells.observed[2], abs=0.01)
    assert table[1] / 64 == pytest.approx(cells.reconstruction[2], abs=0.01)
    assert np.array_equal(table[2] >= 0, cells.counts[2])
    # Where the page's script looks for row l and column c.
    rows, columns = cells.rows_and_columns
    assert np.array_equal(rows * cells.size - rows * (rows - 1) // 2 + columns, np.arange(len(rows)))


def test_every_kind_is_drawn_and_has_a_legend(session: Session):
    facts = cell_facts(session, QUESTION)
    pictures = CellPictures(facts.cells, facts.flows)
    for kind in KINDS:
        assert pictures.strip(0, (kind, "photo"), 40).startswith("data:image/png;base64,")
        assert pictures.legend(kind)


def test_arrows_lead_from_start_to_end_and_short_ones_are_left_out():
    path = arrow_path(np.array([[10.0, 20.0], [5.0, 5.0]]), np.array([[18.0, 14.0], [5.5, 5.0]]))
    assert path.count("M") == 1
    assert path.startswith("M10.0 20.0l8.0 -6.0m")
    numbers = [float(x) for x in re.findall(r"-?\d+\.\d", path)]
    assert numbers[6:8] == [18.0, 14.0]  # both sides of the head meet at the end


def test_columns_keep_their_order_and_the_last_one_stays():
    view = CellsView(columns=("photo", "norm"))
    assert view.toggled("residual").columns == ("photo", "residual", "norm")
    assert view.toggled("norm").toggled("photo").columns == ("photo",)
