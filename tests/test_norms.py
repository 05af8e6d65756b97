"""Norms of one's own: against their formulas, a slow energy and gradient in NumPy, and the built-in norm that one equals."""

import json
from dataclasses import replace
from typing import get_args, get_type_hints

import numpy as np
import pytest
from numba import njit

import fairing
from fairing.errors import InputError
from fairing.judge.inspect import cells_in_context
from fairing.judge.report import run_report
from fairing.kernels.robust import weigh
from fairing.norms.built_in import BUILT_IN, OWN, norm_of
from fairing.norms.norm import INTERVALS, Norm, Tabulated, tabulated
from fairing.options import RobustOptions
from fairing.run.session import Session
from fairing.solve.energy import Evaluator
from fairing.trace import Trace
from tests.cell_cases import ALL_CORNERS, FACE_IDS, sharp_options
from tests.rounding import few
from tests.small_scene import FACES, corner_scene, small_options


class Cauchy(Norm):
    """log(1 + x^2): grows slowly."""

    name = "cauchy"

    def rho(self, x: np.ndarray) -> np.ndarray:
        return np.log1p(x**2)


class Tukey(Norm):
    """Tukey's biweight: residuals beyond 3 sigma have no influence."""

    name = "tukey"

    def rho(self, x: np.ndarray) -> np.ndarray:
        return 3 * (1 - (1 - np.minimum(x / 3, 1) ** 2) ** 3)

    def weight(self, x: np.ndarray) -> np.ndarray:
        return 2 * (1 - np.minimum(x / 3, 1) ** 2) ** 2


class Same(Norm):
    """The built-in norm of Geman and McClure once more."""

    name = "same"

    def rho(self, x: np.ndarray) -> np.ndarray:
        return x**2 / (1 + x**2)


SLOPES = {  # rho'(x), written out
    "cauchy": lambda x: 2 * x / (1 + x**2),
    "tukey": lambda x: np.where(x < 3, 2 * x * (1 - x**2 / 9) ** 2, 0.0),
    "same": lambda x: 2 * x / (1 + x**2) ** 2,
}


# Kernels cannot be called from Python, see `fairing.util.compiled_only`.
@njit
def weighed(residual, norm, table, squared_scale, weights):
    return weigh(residual, norm, table, squared_scale, weights)


def bound(x: np.ndarray) -> np.ndarray:
    """Of the relative interpolation error: h^2 / 8 times the second derivative by 1 / (1 + x), which of these norms is at most
    20 (1 + x)^2 times the value or 1."""
    return 20 * (1 + x) ** 2 / (8 * INTERVALS**2)


@pytest.mark.compiled
@pytest.mark.parametrize("norm", [Cauchy(), Tukey(), Same()], ids=lambda norm: norm.name)
def test_the_compiled_loop_meets_the_functions_within_the_interpolation_error(norm: Norm):
    found, sigma = tabulated(norm), 7.0
    for e in np.concatenate([[0.0, 1e-3], np.geomspace(0.01, 255, 400)]):
        weight, x = np.zeros(1, np.float32), np.array([e / sigma])
        rho = weighed(np.array([-e], np.float32), found.kernel, found.table, sigma**2, weight)
        assert rho == pytest.approx(norm.rho(x)[0], rel=bound(x)[0] + few(12), abs=bound(x)[0] * x[0] ** 2)
        assert rho == pytest.approx(found.rho(x)[0], rel=few(12) * (1 + x[0]), abs=0)
        slope = SLOPES[norm.name](x)[0] / sigma
        # Differences of rho err by STEP^2 = 1e-8 of a third derivative of at most 12, beside the table.
        assert weight[0] * e == pytest.approx(slope, rel=bound(x)[0] + few(12), abs=(bound(x)[0] + 2e-8) * e / sigma**2)


@pytest.mark.compiled
@pytest.mark.parametrize("name", BUILT_IN)
def test_the_compiled_loops_of_the_built_in_norms_compute_their_classes_functions(name: str):
    norm, found, sigma = BUILT_IN[name], norm_of(name), 7.0
    scale = float(norm.squared_scale(np.array([sigma]))[0])
    for e in (0.0, 0.3, 6.5, 7.5, 90.0):
        weight, x = np.zeros(1, np.float32), np.array([e / np.sqrt(scale)])
        rho = weighed(np.array([e], np.float32), found.kernel, found.table, scale, weight)
        assert rho == pytest.approx(norm.rho(x)[0], rel=few(10), abs=0)
        assert weight[0] == pytest.approx(norm.weight(x)[0] / scale, rel=few(10), abs=0)
        assert found.rho(x)[0] == pytest.approx(norm.rho(x)[0], rel=bound(x)[0] + few(4))


def test_every_built_in_norm_can_be_chosen():
    assert get_args(get_type_hints(RobustOptions)["norm"]) == (*BUILT_IN, OWN)


@pytest.mark.parametrize(
    ("norm", "expected"),
    [(Same(), 1 / np.sqrt(3)), (Cauchy(), 1.0), (Tukey(), 3 / np.sqrt(5)), (BUILT_IN["huber"], np.inf)],
    ids=lambda value: getattr(value, "name", ""),
)
def test_influence_falls_beyond_the_threshold(norm: Norm, expected: float):
    free = type("Free", (type(norm),), {"outlier_threshold": None})()
    assert tabulated(free).outlier_threshold == pytest.approx(expected, rel=1e-4)


def test_a_missing_weight_is_the_slope_of_rho():
    x = np.geomspace(1e-4, 300, 200)
    assert Cauchy().weight(x) * x == pytest.approx(SLOPES["cauchy"](x), rel=1e-6)


@pytest.mark.compiled
@pytest.mark.parametrize("order", ["joint", "independent"])
def test_a_norm_equal_to_the_built_in_one_gives_the_same_run(order: str):
    options = small_options(schedule={"order": order})
    own, built_in = Session(corner_scene(), options, norm=Same()), Session(corner_scene(), options)
    first, expected = own.step(), built_in.step()
    assert first is not None
    assert expected is not None
    # Weights differ by 1e-6, and a step with them by as much of its length.
    length = np.abs(expected.after - expected.before).max()
    assert np.abs(first.after - expected.after).max() < 1e-5 * length
    assert first.objective_after == pytest.approx(expected.objective_after, rel=1e-5)
    face = np.flatnonzero(own.sweep_state().context.takes_part)[0]
    cells, known = (fairing.face_cells(run, int(face)) for run in (own, built_in))
    assert cells.outlier_threshold == pytest.approx(known.outlier_threshold, rel=1e-5)
    assert cells.weights == pytest.approx(known.weights, rel=1e-4)
    for run in (own, built_in):
        run.run()
    assert len(own.trace) == len(built_in.trace)
    # Vertices stop where a step is below the tolerance, and stop in either run within it.
    apart = own.pixels_moved(own.vertices - built_in.vertices)
    assert apart.max() < 3 * options.step.tolerance


@pytest.mark.compiled
@pytest.mark.parametrize("norm", [Cauchy(), Tukey()], ids=lambda norm: norm.name)
def test_energy_and_gradient_are_those_of_a_slow_sum(norm: Norm):
    """Cells minus U c, both held fixed, as the alternating solver has them; the slope by central differences."""
    options = sharp_options(cells={"interpolation": ["cubic"]}, robust={"norm": "geman_mcclure"})
    session = Session(corner_scene(), options, norm=norm)
    sweep, vertices = session.sweep_state(), session.vertices
    sweep.context.kernel.pair_mask[:] = -1  # every sample counts
    system = Evaluator(1).linearise(sweep.context, vertices, FACE_IDS, ALL_CORNERS, sweep.scale, "alternating")

    def cells(face: int, places: np.ndarray) -> fairing.FaceCells:
        sigma, scale = float(sweep.sigma[face]), float(sweep.scale[face])
        return cells_in_context(session, sweep.context, places, face, 0, sigma, scale)

    for face in (0, 3):
        begun, sigma = cells(face, vertices), float(sweep.sigma[face])
        assert (np.abs(begun.residual) > sigma).any(), "some residuals are large"

        def slow(places: np.ndarray, face: int = face, begun=begun, sigma: float = sigma) -> float:
            e = cells(face, places).observed.astype(float) - begun.reconstruction
            return sum(
                weight * float(norm.rho(np.abs(row) / sigma).sum())
                for weight, row in zip(begun.pair_weight, e, strict=True)
            )

        assert system.energy[face] == pytest.approx(slow(vertices), rel=1e-5)
        assert begun.energy == system.energy[face]
        assert (begun.pair_weight * begun.rho.sum(axis=1)).sum() == pytest.approx(begun.energy, rel=1e-5)
        step, size = 6e-4, np.abs(system.g[face]).max()
        for corner, axis in [(0, 0), (1, 2), (2, 1)]:
            slopes = []
            for h in (step, 2 * step):
                ahead, behind = vertices.copy(), vertices.copy()
                ahead[FACES[face][corner], axis] += h
                behind[FACES[face][corner], axis] -= h
                slopes.append((slow(ahead) - slow(behind)) / (2 * h))
            # A central difference over twice the step errs four times as much.
            allowed = abs(slopes[1] - slopes[0]) + 1e-3 * size
            assert system.g[face][3 * corner + axis] == pytest.approx(slopes[0], abs=allowed)


@pytest.mark.compiled
def test_a_run_does_not_depend_on_the_number_of_threads():
    runs = [fairing.fair(corner_scene(), small_options(threads=threads), norm=Tukey()) for threads in (1, 3)]
    assert runs[0].vertices.tobytes() == runs[1].vertices.tobytes()
    other = fairing.fair(corner_scene(), small_options(threads=1))
    assert (other.vertices != runs[0].vertices).any()


@pytest.mark.compiled
def test_a_run_is_resumed_and_shown_without_the_code_of_its_norm(tmp_path):
    whole = fairing.fair(corner_scene(), small_options(), norm=Tukey())
    begun = Session(corner_scene(), small_options(), norm=Tukey())
    begun.step()
    begun.trace.attach(tmp_path / "run.trace")
    begun.trace.detach()
    again = Session(corner_scene(), trace=Trace.load(tmp_path / "run.trace"))
    assert again.norm.name == "tukey"
    assert again.norm.file.endswith("test_norms.py")
    again.run()
    assert again.vertices.tobytes() == whole.vertices.tobytes()
    given = Session(corner_scene(), trace=again.trace, norm=Tukey())
    assert given.norm.digest == again.norm.digest
    with pytest.raises(InputError, match=r"recorded with the own norm tukey \(.*test_norms.py\), found cauchy"):
        Session(corner_scene(), trace=again.trace, norm=Cauchy())
    plain = fairing.fair(corner_scene(), small_options())
    with pytest.raises(InputError, match="recorded with a norm of the options, found tukey"):
        Session(corner_scene(), trace=plain.trace, norm=Tukey())


def test_a_report_names_what_is_one_s_own():
    plan = [fairing.PlanStage("photos", blur=2.0, max_sweeps=1)]
    own = run_report(Session(corner_scene(), small_options(), norm=Tukey(), plan=plan), "accurate", {}, {})["own"]
    assert own["norm"]["name"] == "tukey"
    assert own["norm"]["file"].endswith("test_norms.py")
    assert own["plan"] == [{"kind": "photos", "settings": {"blur": 2.0, "max_sweeps": 1}}]
    none = run_report(Session(corner_scene(), small_options()), "accurate", {}, {})["own"]
    assert none == {"terms": [], "norm": None, "plan": []}


@pytest.mark.compiled
def test_a_branch_has_another_norm_or_none_of_its_own():
    session = Session(corner_scene(), small_options(), norm=Tukey())
    session.step()
    same = session.branch()
    assert same.plan == session.plan
    assert same.sweep_state() is session.sweep_state()
    other = session.branch(norm=Cauchy())
    assert (other.norm.name, other.plan, other.moment) == ("cauchy", None, 1)
    assert session.norm.name == "tukey"
    options = replace(session.options, robust=replace(session.options.robust, norm="huber"))
    built_in = session.branch(options)
    assert built_in.norm.name == "huber"
    assert built_in.branch(session.options).norm.name == "tukey"
    expected = fairing.fair(corner_scene(), small_options(), norm=Cauchy())
    session.go_to(0)
    from_start = session.branch(norm=Cauchy())
    from_start.run()
    assert from_start.vertices.tobytes() == expected.vertices.tobytes()


class Growing(Cauchy):
    def rho(self, x: np.ndarray) -> np.ndarray:
        return np.log(np.cosh(x))


class Negative(Cauchy):
    def weight(self, x: np.ndarray) -> np.ndarray:
        return 1 - x


class Constant(Cauchy):
    def rho(self, x: np.ndarray) -> np.ndarray:
        return np.ones_like(x)


class Scalar(Cauchy):
    def rho(self, x: np.ndarray) -> np.ndarray:
        return np.array(0.0)


class Failing(Cauchy):
    def rho(self, x: np.ndarray) -> np.ndarray:
        return x / (1 // 0)


class Nameless(Cauchy):
    name = "two words"


class NoRho(Norm):
    name = "norho"


@pytest.mark.parametrize(
    ("norm", "message"),
    [
        (Growing(), r"norm cauchy: expected rho\(x\) finite and at least 0 .* found inf at x = "),
        (Negative(), r"expected weight\(x\) finite and at least 0 .* found -"),
        (Constant(), r"expected rho\(0\) = 0, found 1"),
        (Scalar(), r"expected rho to return an array of the shape of x, \(1,\), found \(\)"),
        (Failing(), r"rho raised ZeroDivisionError: .* \(test_norms.py, line \d+\)"),
        (Nameless(), "expected a name such as 'tukey', found 'two words'"),
        (NoRho(), r"expected a method rho\(self, x\), found none"),
        (Cauchy, r"found the class Cauchy; write norm=Cauchy\(\)"),
        ("cauchy", "expected an instance of fairing.Norm, found str"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_norm_that_makes_no_sense_is_refused_in_one_line(norm: Norm, message: str):
    with pytest.raises(InputError, match=message) as caught:
        Session(corner_scene(), small_options(), norm=norm)
    assert "\n" not in str(caught.value)


def test_options_without_the_norm_that_they_name_are_refused():
    with pytest.raises(
        InputError, match=r"robust.norm: own: expected a norm of your own; give it with norm= or --with"
    ):
        Session(corner_scene(), small_options(robust={"norm": "own"}))


@pytest.mark.parametrize("change", [{"table": "x"}, {"table": ""}, {"outlier_threshold": -1}, {"name": 3}])
def test_recorded_norms_that_make_no_sense_are_refused(change: dict):
    facts = json.loads(json.dumps(tabulated(Tukey()).facts))
    assert Tabulated.of_facts(facts).digest == tabulated(Tukey()).digest
    session = Session(corner_scene(), small_options(), norm=Tukey())
    session.trace.header["own_norm"] = facts | change
    with pytest.raises(InputError, match="own_norm"):
        Session(corner_scene(), trace=session.trace)
