"""Fits against NumPy and SciPy, and their uncertainty against simulation."""

import numpy
import probecell
import pytest
from scipy.optimize import least_squares


def ring(count=24, radius=0.015, noise=0.5e-6, seed=1):
    chance = numpy.random.default_rng(seed)
    angle = numpy.linspace(0, 2 * numpy.pi, count, endpoint=False)
    height = numpy.tile([0.0, 0.01, 0.02], count // 3)
    own = radius + chance.normal(0, noise, count)
    return numpy.column_stack([0.05 + own * numpy.cos(angle), 0.02 + own * numpy.sin(angle), height])


NOMINAL = {"origin": (0.05, 0.02, 0.0), "radius": 0.015}


def test_a_bore_is_the_least_squares_cylinder_of_scipy():
    points = ring()

    def residual(p):
        arm = points - [p[0], p[1], 0]
        axis = numpy.array([p[2], p[3], 1.0])
        axis /= numpy.linalg.norm(axis)
        return numpy.linalg.norm(arm - numpy.outer(arm @ axis, axis), axis=1) - p[4]

    found = least_squares(residual, [0.05, 0.02, 0, 0, 0.015], x_scale=[1e-3, 1e-3, 1e-3, 1e-3, 1e-3], xtol=1e-15, ftol=1e-15, gtol=1e-15)
    ours = probecell.fit("bore", points, touch_uncertainty=0.5e-6, **NOMINAL)
    assert abs(ours.size - 2 * found.x[4]) < 1e-11
    assert abs(ours.form - numpy.ptp(residual(found.x))) < 1e-11
    assert ours.nominal_size == 0.03 and ours.left_out == [] and ours.note == ""
    assert probecell.fit("bore", points.tolist(), touch_uncertainty=0.5e-6, **NOMINAL).size == ours.size


def test_a_plane_is_that_of_the_singular_value_decomposition():
    chance = numpy.random.default_rng(2)
    points = numpy.column_stack([chance.uniform(0, 0.1, (40, 2)), 0.03 + chance.normal(0, 1e-6, 40)])
    ours = probecell.fit("plane", points, origin=(0, 0, 0.03), touch_uncertainty=1e-6)
    middle = points.mean(axis=0)
    normal = numpy.linalg.svd(points - middle)[2][2]
    assert abs(abs(normal @ ours.axis) - 1) < 1e-12
    assert abs(ours.form - numpy.ptp((points - middle) @ normal)) < 1e-11


def test_the_uncertainty_of_a_diameter_is_that_of_simulated_touches():
    fits = [probecell.fit("bore", ring(seed=seed), touch_uncertainty=0.5e-6, **NOMINAL) for seed in range(400)]
    spread = numpy.std([one.size for one in fits], ddof=1)
    # The relative standard error of a standard deviation of 400 is 3.5 %.
    assert abs(spread / fits[0].size_uncertainty - 1) < 0.12


def test_the_radius_of_the_ball_and_the_criterion_count():
    points, ball = ring(noise=0.0), 0.002
    inner = (points - [0.05, 0.02, 0]) * [(0.015 - ball) / 0.015] * 1 + [0.05, 0.02, 0]
    inner[:, 2] = points[:, 2]
    ours = probecell.fit("bore", inner, ball_radius=ball, touch_uncertainty=0.5e-6, **NOMINAL)
    assert abs(ours.size - 0.03) < 1e-12
    noisy = ring(noise=2e-6)
    inscribed = probecell.fit("bore", noisy, criterion="maximum_inscribed", touch_uncertainty=0.5e-6, **NOMINAL)
    assert inscribed.size < probecell.fit("bore", noisy, touch_uncertainty=0.5e-6, **NOMINAL).size
    chip = ring()
    chip[5, :2] += (chip[5, :2] - [0.05, 0.02]) * 0.01
    assert probecell.fit("bore", chip, outlier_limit=4.0, touch_uncertainty=0.5e-6, **NOMINAL).left_out == [5]


@pytest.mark.parametrize(
    "says, change",
    [
        ("is not one of plane", {"kind": "torus"}),
        ("is not one of least_squares", {"criterion": "best"}),
        ("point 3 is no x, y, z", {"points": [[0, 0, 0]] * 3 + [[1, 2]]}),
        ("point 0 has a coordinate that is not finite", {"points": [[float("nan"), 0, 0]]}),
        ("point 0 stands in the middle", {"points": [[0.05, 0.02, 0.3]]}),
        ("touch_uncertainty must be a length", {"touch_uncertainty": -1.0}),
        ("axis must be a direction", {"axis": (0.0, 0.0, 0.0)}),
    ],
)
def test_what_cannot_be_fitted_is_said(says, change):
    arguments = {"kind": "bore", "points": ring(), "touch_uncertainty": 1e-6} | NOMINAL | change
    with pytest.raises(probecell.InputError, match=says):
        probecell.fit(arguments.pop("kind"), arguments.pop("points"), **arguments)


def test_points_that_determine_nothing_are_refused():
    with pytest.raises(probecell.InputError):
        probecell.fit("sphere", [], radius=0.01, touch_uncertainty=1e-6)
