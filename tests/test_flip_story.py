"""The chapters of a record, and what is drawn at their moments."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from app.flips.body import SHRUNK, cross_sections
from app.flips.carving_panels import carving_facts, tetrahedron_terms
from app.flips.drawing import Draughtsman
from app.flips.section import Section
from app.flips.split_film import Group, SplitFilm
from app.flips.split_panels import split_facts, split_legend
from app.flips.story import Chapter, Story
from app.flips.votes import Vote, VoteCounter, votes_of
from app.picking import first_hit
from app.stage import Stage
from app.viser_bridge.html_events import Events
from fairing.scene import Scene
from fairing.triangulation import FlipTrace, SightCosts
from tests.bodies import AROUND, carved
from tests.flip_records import flipped_at_random, grid_mesh, split_by_hand

N = len(AROUND)


@pytest.fixture(scope="module")
def story():
    return Story(carved())


@pytest.fixture(scope="module")
def stage(story):
    trace = story.film.trace
    return Stage.of(Scene.build("torus", trace.vertices, trace.faces_at(0), AROUND))


@pytest.fixture(scope="module")
def draughtsman(story, stage):
    return Draughtsman(story, story.carving, stage, VoteCounter(story.carving))


def begin_of(story: Story, chapter: Chapter) -> int:
    return next(extent.begin for extent in story.extents if extent.chapter is chapter)


def test_chapters_follow_each_other_without_gaps(story):
    chapters = [story.at(moment) for moment in range(len(story) + 1)]
    assert [extent.chapter for extent in story.extents] == [
        chapter for chapter in Chapter if chapter in {e.chapter for e, _ in chapters}
    ]
    assert [k for extent in story.extents for k in range(extent.count)] == [k for _, k in chapters]
    assert begin_of(story, Chapter.TETRAHEDRA) == N + 1  # nothing, then a photo a step
    assert story.flip(len(story)) == 0
    assert story.flip(len(story) - 1) is None


def test_parts_are_chapters_and_then_rounds():
    torus, flipped = carved(), flipped_at_random(*grid_mesh(5), 2, 4)
    trace = FlipTrace({}, flipped.vertices, flipped.faces_at(0), torus.carving)
    for flip in flipped.flips:
        trace.append(flip)
    story = Story(trace)
    first = begin_of(story, Chapter.FLIPS)
    assert [story.part_after(m) for m in (0, N + 1, first - 1, first, first + 4)] == [
        N + 1,
        N + 2,
        first,
        first + 4,
        first + 8,
    ]
    assert story.part_after(len(story)) == len(story) == first + 8
    assert story.part_before(first + 5) == first + 4
    assert story.part_before(first) == begin_of(story, Chapter.DECIMATION)
    assert story.part_before(3) == story.part_before(0) == 0
    plain = Story(flipped)
    assert [plain.part_before(m) for m in (0, 1, 8)] == [0, 0, 4]
    assert [plain.flip(m) for m in range(9)] == list(range(9))


def test_splits_are_a_chapter_with_rounds_before_the_flips():
    trace = split_by_hand(*grid_mesh(5))
    story = Story(trace)
    assert [(extent.chapter, extent.count) for extent in story.extents] == [(Chapter.SPLITS, 6), (Chapter.FLIPS, 1)]
    assert story.has_chapters
    assert not Story(flipped_at_random(*grid_mesh(5), 1, 1)).has_chapters
    assert [story.split(m) for m in range(7)] == [0, 1, 2, 3, 4, 5, None]
    assert [story.part_after(m) for m in range(7)] == [4, 4, 4, 4, 6, 6, 6]
    assert [story.part_before(m) for m in range(7)] == [0, 0, 0, 0, 0, 4, 0]
    assert [story.is_carving(m) for m in (0, 6)] == [False, False]
    both = FlipTrace({}, trace.vertices, trace.faces_at(0), carved().carving)
    both.splits = trace.splits
    assert [extent.chapter for extent in Story(both).extents][-3:] == [
        Chapter.DECIMATION,
        Chapter.SPLITS,
        Chapter.FLIPS,
    ]


def test_parts_are_split_one_after_another_and_what_stays_comes_last():
    vertices, faces = grid_mesh(5)
    trace = split_by_hand(vertices, faces)
    film, first = SplitFilm(trace.splits), trace.splits[0]
    assert [film.at(k).part for k in range(len(film))] == [None, 1, 0, 2, None, 0]  # most held-out points first
    before = film.mesh(0)
    np.testing.assert_array_equal(before.vertices, vertices)
    np.testing.assert_array_equal(before.faces, faces)
    assert np.flatnonzero(before.groups == Group.CANDIDATE).tolist() == [0, 5, 16, 26]
    assert not before.is_of_part.any()
    counts = [np.bincount(film.mesh(k).groups, minlength=4).tolist()[1:] for k in range(4)]
    assert counts == [[4, 0, 0], [2, 8, 0], [1, 12, 0], [0, 12, 1]]
    assert [int(film.mesh(k).is_of_part.sum()) for k in range(4)] == [0, 8, 4, 1]
    np.testing.assert_array_equal(film.mesh(3).vertices, first.after)
    np.testing.assert_array_equal(film.mesh(3).vertices, film.mesh(4).vertices)
    np.testing.assert_array_equal(film.mesh(5).faces, trace.faces_at(0))


def test_the_panel_of_splits_names_the_reason():
    film = SplitFilm(split_by_hand(*grid_mesh(5)).splits)
    assert "Part 1 of 3: split" in split_facts(film, 1)
    assert "1.20 σ" in split_facts(film, 1)
    assert "fall of its square (over 10 %)</th><td class='n'>64 %" in split_facts(film, 1)  # 1 - (1.2 / 2)^2
    assert "in standard errors (over 3)</th><td class='n'>2.50" in split_facts(film, 1)
    assert "Fewer than 5 held-out points" in split_facts(film, 3)
    assert "round 2 of 2" in split_facts(film, 5)
    assert "do not lie clearly nearer" in split_facts(film, 5)
    assert "split and fitted</span><span class='dim'>8<" in split_legend(film.mesh(1))


def test_points_appear_photo_by_photo(story, draughtsman):
    seen = [draughtsman.draw(moment, Section()) for moment in range(N + 1)]
    assert len(seen[0].points) == len(seen[0].new_points) == 0
    for before, after in pairwise(seen):
        assert set(after.points) == set(before.points) | set(before.new_points)
    assert len(seen[-1].points) + len(seen[-1].new_points) == story.carving.mesh.n_points
    of_third = set(story.carving.lines[story.carving.lines[:, 1] == 2, 0])
    assert set(seen[3].new_points) <= of_third


def test_rays_carve_what_they_cross(story, draughtsman):
    begin = begin_of(story, Chapter.RAYS)
    last, n = -1, int((~story.carving.at_box).sum())
    for k in (0, 3, N - 1, 1):
        drawing = draughtsman.draw(begin + k, Section("off"))
        assert sum(drawing.counts.values()) == n
        n_carved = drawing.counts["clearly outside"] + drawing.counts["outside"]
        assert n_carved > last or k == 1
        last = n_carved
        # Without a section what is carved away is not drawn.
        assert len(drawing.meshes["clearly outside"]) == len(drawing.meshes["outside"]) == 0
        assert 0 < len(drawing.rays) <= (story.carving.lines[:, 1] == k).sum()
    cut = draughtsman.draw(begin + N - 1, Section("front"))
    assert len(cut.meshes["clearly outside"]) > 0


@pytest.mark.parametrize("direction", ["front", "side", "top"])
def test_a_section_cuts_the_near_side_away(story, stage, draughtsman, direction):
    section = Section(direction, 5)
    drawing = draughtsman.draw(begin_of(story, Chapter.CUT), section)
    heights = section.heights(drawing.tetrahedra.corners.reshape(-1, 3), stage).reshape(-1, 3)
    assert (heights < 1e-5).all()
    in_plane = (np.abs(heights) < 1e-5).all(axis=1)
    assert 0 < in_plane.sum() < len(heights)
    corners = draughtsman.places[story.carving.mesh.corners[drawing.tetrahedra.tetrahedra]]
    middles = section.heights(corners.reshape(-1, 3), stage).reshape(-1, 4)
    crosses = (middles.min(axis=1) < 0) & (middles.max(axis=1) > 0)
    np.testing.assert_array_equal(crosses, in_plane)
    assert np.linalg.norm(section.normal(stage)) == pytest.approx(1)
    whole = draughtsman.draw(begin_of(story, Chapter.CUT), Section("off"))
    assert len(drawing.meshes["cut outside"]) > len(whole.meshes["cut outside"]) == 0


def test_cross_sections_have_the_area_of_the_body_in_the_plane():
    """The cross sections of five tetrahedra that are a cube together fill the plane within it."""
    five = np.array([[0, 1, 2, 4], [3, 1, 2, 7], [5, 1, 4, 7], [6, 2, 4, 7], [1, 2, 4, 7]])
    cube = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    tilted = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0][0]
    for normal in (np.array([0, 0, 1.0]), tilted):
        heights = (cube - 0.45) @ normal
        found = cross_sections(cube[five], heights[five], np.arange(5), normal)
        doubled = np.cross(found.corners[:, 1] - found.corners[:, 0], found.corners[:, 2] - found.corners[:, 0])
        assert (doubled @ normal > 0).all()
        # The hull of where the plane meets lines between corners of the cube.
        a, b = np.triu_indices(8, 1)
        crossed = heights[a] * heights[b] < 0
        a, b = a[crossed], b[crossed]
        along = (heights[a] / (heights[a] - heights[b]))[:, None]
        flat = (cube[a] + along * (cube[b] - cube[a])) @ np.linalg.svd(normal[None])[2][1:].T
        expected = ConvexHull(flat).volume
        assert (doubled @ normal).sum() / 2 == pytest.approx(expected * SHRUNK**2, rel=1e-5)


def test_the_body_is_closed_and_has_the_volume_of_its_tetrahedra(story, draughtsman):
    drawing = draughtsman.draw(begin_of(story, Chapter.CUT), Section("off"))
    a, b, c = drawing.meshes["cut inside"].astype(float).transpose(1, 0, 2)
    inside = ~story.carving.is_outside & ~story.carving.at_box
    corners = draughtsman.places[story.carving.mesh.corners[inside]].astype(float)
    expected = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])).sum() / 6
    assert (a * np.cross(b, c)).sum() / 6 == pytest.approx(expected, rel=1e-4)


def test_votes_are_told_apart_by_their_balance():
    passing, inside = np.array([9.0, 1, 0.3, 0, 0]), np.array([0.0, 0, 0, 1, 9])
    assert votes_of(SightCosts(np.zeros((5, 4)), inside, passing)).tolist() == list(Vote)


def test_the_first_triangle_that_a_ray_meets_is_picked():
    near = np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1.0]])
    moves = np.array([[0, 0, -3], [0, 0, 0], [5, 0, 0], [0, 0, -1]])
    triangles = near + moves[:, None]
    down = np.array([0, 0, -1.0])
    assert first_hit(triangles, np.array([0.2, 0.2, 9]), down) == 1
    assert first_hit(triangles, np.array([0.2, 0.2, 0.5]), down) == 3
    assert first_hit(triangles, np.array([0.8, 0.8, 9]), down) is None
    assert first_hit(triangles[:0], np.zeros(3), down) is None


def test_every_moment_has_a_sentence_and_its_numbers(story, draughtsman):
    headings = set()
    for moment in range(len(story)):
        markup = carving_facts(story, moment, draughtsman.draw(moment, Section()))
        assert "<table>" in markup
        headings.add(markup.split("grow'>")[1].split("<")[0])
    assert len(headings) >= 2 * N + 5


def test_the_terms_of_a_tetrahedron_are_its_costs(story):
    carving = story.carving
    events = Events({"tetrahedron": 0, "deselect": 1})
    t, k = (int(ids[0]) for ids in carving.facets)
    markup = tetrahedron_terms(carving, t, carving.all_votes, 3, is_cut=True, events=events)
    assert markup.count("· cut") == sum(
        carving.is_outside[carving.mesh.neighbours[t]] & (carving.mesh.neighbours[t] >= 0)
    )
    assert "the cut says" in markup
    assert f"{carving.facet_costs[t, k]:.3g}"[:4] in markup
    assert "the cut says" not in tetrahedron_terms(carving, t, carving.all_votes, 3, is_cut=False, events=events)
    assert "Click one" in tetrahedron_terms(carving, None, carving.all_votes, 0, is_cut=True, events=events)
