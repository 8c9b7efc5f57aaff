"""Separable tables and spherical wavelets as models: coordinates, interpolation, and tables that do not fit."""

import numpy as np
import pytest

from interchange.brdf.octahedron import corners, faces, middles, split, splits, tree
from interchange.brdf.separable_svd import SeparableSvd, half_difference
from interchange.brdf.wavelets import Wavelets, hats, within
from interchange.parameter import ParameterError
from interchange.table import Table

RNG = np.random.default_rng(8)


def at(theta, phi=0.0):
    return np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


def test_mirror_pair_has_the_normal_for_half_vector():
    theta_h, _, theta_d, _ = half_difference(tuple(at(0.5, 0.3)), tuple(at(0.5, 0.3 + np.pi)))
    assert (theta_h, theta_d) == pytest.approx((0.0, 0.5), abs=1e-12)


def test_half_and_difference_in_the_plane_of_incidence():
    """Light at 50°, camera at 10° on the same side: h at 30°, 20° to either; d lies in the plane of n and h."""
    theta_h, phi_h, theta_d, twice = half_difference(
        tuple(at(np.radians(50), 1.0)), tuple(at(np.radians(10), 1.0))
    )
    assert np.degrees([theta_h, theta_d]) == pytest.approx([30, 20], abs=1e-9)
    assert (phi_h, np.cos(twice)) == pytest.approx((1.0, 1.0), abs=1e-9)


def test_difference_across_the_plane_has_half_a_turn():
    """Light and camera symmetric to the plane of n and h: phi_d = 90°, 2 phi_d = 180°."""
    _, phi_h, _, twice = half_difference(tuple(at(0.6, 0.4)), tuple(at(0.6, -0.4)))
    assert (phi_h, np.cos(twice)) == pytest.approx((0.0, -1.0), abs=1e-9)


def test_separable_model_is_the_product_at_its_nodes_and_straight_between():
    u, v = np.array([4.0, 2.0, 1.0]), np.array([0.1, 0.3])
    model = SeparableSvd(1, 3, 1, 2, 1, Table(u), Table(v))
    normal = at(0.0)
    assert model.evaluate(normal, normal) == pytest.approx(0.4, rel=1e-6)
    theta_d = np.radians(45)
    assert model.evaluate(at(theta_d), at(theta_d, np.pi)) == pytest.approx(4 * 0.2, rel=1e-6)
    retro = at(np.pi / 2 * 0.25)  # sqrt(theta_h / 90°) = 1 / 2: the node in the middle
    assert model.evaluate(retro, retro) == pytest.approx(2 * 0.1, rel=1e-6)


def test_separable_model_of_one_azimuth_is_isotropic():
    model = SeparableSvd(1, 3, 1, 3, 4, Table([4.0, 2.0, 1.0]), Table(RNG.uniform(0.1, 0.2, 12)))
    c, s = np.cos(1.0), np.sin(1.0)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    wi, wo = at(0.6, 0.2), at(0.9, 2.0)
    assert model.evaluate(turn @ wi, turn @ wo) == pytest.approx(model.evaluate(wi, wo), rel=1e-9)


def test_separable_tables_of_the_wrong_size_are_refused():
    with pytest.raises(ParameterError, match=r"SeparableSvd.u must have 8 rows, 4 a product; got 4"):
        SeparableSvd(rank=2)


def test_split_faces_agree_with_where_points_fall():
    """A point's barycentric place in one of the four triangles gives back the point."""
    face = faces(4)[1]
    whole = np.array(face, float)
    parts = np.array(split(face), float)
    bary = RNG.dirichlet([1, 1, 1], 200).T
    which, inner = within(*bary)
    got = np.einsum("kn,nkx->nx", np.array(inner), parts[which.astype(int)])
    assert got == pytest.approx(bary.T @ whole, abs=1e-12)
    assert set(which) == {0, 1, 2, 3}


def test_hats_are_one_in_the_middle_of_their_edge_and_add_up_with_the_corners():
    assert hats(0.0, 0.5, 0.5) == [1.0, 0.0, 0.0]
    bary = RNG.dirichlet([1, 1, 1], 200).T
    small = [np.maximum(2 * b - 1, 0) for b in bary]  # hats of the corners on the finer grid
    assert np.sum(hats(*bary), axis=0) + np.sum(small, axis=0) == pytest.approx(1.0)


def random_details(levels, share):
    return {
        middle: RNG.uniform(-1, 1, 3)
        for level in splits(levels)
        for middle, _, _ in level
        if RNG.uniform() < share
    }


@pytest.mark.parametrize("share", [0.05, 0.5, 1.0])
def test_tree_evaluates_to_the_hats_added_up(share):
    """At every vertex of the finest grid the model is the sum of the details, each prolonged straight along edges."""
    levels = 3
    details = random_details(levels, share)
    value = {p: np.full(3, 10.0) for p in corners(levels)}
    for level in splits(levels):
        for middle, p, q in level:
            value[middle] = (value[p] + value[q]) / 2 + details.get(middle, 0.0)
    gamma, child = tree([details] * 2, levels)
    model = Wavelets(levels, 2, Table(np.full(8, 10.0)), Table(gamma.reshape(-1, 3)), Table(child))
    points = np.array([p for p in value if p[2] > 0], float)
    wo = points / np.linalg.norm(points, axis=1, keepdims=True)
    expected = np.array([v for p, v in value.items() if p[2] > 0])
    assert model.evaluate(at(0.7), wo) == pytest.approx(expected, rel=1e-5)


def test_wavelets_have_no_steps_between_triangles():
    model = Wavelets.drawn(np.random.default_rng(2), 3)
    phi = np.linspace(0, 2 * np.pi, 200_001)
    wo = np.stack([0.8 * np.cos(phi), 0.8 * np.sin(phi), 0.6 + 0 * phi], axis=-1)
    assert np.abs(np.diff(model.evaluate(at(0.5), wo), axis=0)).max() < 1e-4


def test_absent_details_take_no_room():
    gamma, child = tree([{}, {middles(faces(5)[0])[0]: np.ones(3)}], 5)
    assert len(gamma) == 3 * 5
    assert not child.any()


def test_wavelet_tables_that_do_not_fit_together_are_refused():
    with pytest.raises(ParameterError, match="lambda_ has 8 rows instead of 12"):
        Wavelets(incidences=3)
    with pytest.raises(ParameterError, match="child holds what is no triangle's number"):
        Wavelets(child=Table([7.0] + [0.0] * 19))
