"""A record of flips, moment by moment, and the playing of it."""

import threading

import numpy as np
import pytest

from app.flips.film import KEYFRAMES, FlipFilm
from app.flips.player import Player
from fairing.triangulation import FlipTrace
from tests.flip_records import flipped_at_random, grid_mesh
from tests.waiting import wait_for


@pytest.fixture(scope="module")
def trace():
    return flipped_at_random(*grid_mesh(9), 4, 50)


def pairs(edges: np.ndarray) -> set[tuple[int, ...]]:
    return {tuple(sorted(edge)) for edge in edges.tolist()}


def test_every_moment_is_the_records_in_whatever_order_they_are_asked_for(trace):
    film = FlipFilm(trace)
    assert len(trace) > KEYFRAMES
    for moment in [0, 200, 3, KEYFRAMES, KEYFRAMES - 1, 150, 1, 199]:
        assert np.array_equal(film.faces_at(moment), trace.faces_at(moment))
    with pytest.raises(IndexError):
        film.faces_at(201)


@pytest.mark.parametrize("moment", [0, 1, 77, 200])
def test_the_edges_of_a_moment_are_told_apart_by_what_becomes_of_them(trace, moment):
    film = FlipFilm(trace)
    edges = film.edges_at(moment)
    faces = trace.faces_at(moment)
    there = pairs(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]))
    groups = [pairs(group) for group in (edges.kept, edges.came, edges.to_go, edges.new)]
    assert set().union(*groups) == there
    assert sum(map(len, groups)) == len(there), "no edge is in two groups"
    taken_later = {tuple(sorted(flip.edge.tolist())) for flip in trace.flips[moment:]}
    assert groups[2] | (groups[3] & taken_later) == there & taken_later
    if moment > 0:
        flip = trace.flips[moment - 1]
        assert groups[3] == {tuple(sorted(flip.opposite.tolist()))}
        assert pairs(edges.gone) == {tuple(sorted(flip.edge.tolist()))}
        assert not pairs(edges.gone) & there


def test_the_energy_begins_and_ends_rounds_as_recorded(trace):
    film = FlipFilm(trace)
    assert film.energies.shape == (201,)
    assert film.energies[0] == trace.flips[0].round_energy[0]
    assert film.energies[50] == trace.flips[50].round_energy[0]
    assert film.energies[-1] == trace.flips[-1].round_energy[1]
    assert film.energies[1] - film.energies[0] == pytest.approx(trace.flips[0].energy[1] - trace.flips[0].energy[0])


def test_rounds_are_gone_to_in_both_directions(trace):
    film = FlipFilm(trace)
    assert [film.round_after(m) for m in (0, 49, 50, 199, 200)] == [50, 50, 100, 200, 200]
    assert [film.round_before(m) for m in (0, 1, 50, 51, 200)] == [0, 0, 0, 50, 150]


def test_a_record_without_flips_has_one_moment():
    film = FlipFilm(FlipTrace({}, *grid_mesh(3)))
    assert len(film.energies) == 1
    assert film.round_after(0) == film.round_before(0) == 0
    assert len(film.edges_at(0).kept) == 16


def test_playing_shows_every_flip_up_to_the_end_and_stops_there():
    seen: list[int] = []
    ended = threading.Event()

    def note() -> None:
        seen.append(player.moment)
        if not player.is_playing:
            ended.set()

    player = Player(5, 1000, note)
    player.play_or_stop()
    wait_for(ended.is_set)
    assert seen == [1, 2, 3, 4, 5, 5]


def test_going_somewhere_ends_playing_and_stays_within_the_record():
    player = Player(10**6, 1000, lambda: None)
    player.play_or_stop()
    wait_for(lambda: player.moment > 2)
    player.go_to(-4)
    assert not player.is_playing
    wait_for(lambda: player.moment == 0)
    player.go_to(2 * 10**6)
    assert player.moment == 10**6
