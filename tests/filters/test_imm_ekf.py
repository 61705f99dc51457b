import jax
import numpy as np
import pytest

import locbounds as lb
import textbook_filters as textbook
from filter_scenarios import awkward, with_gaps
from locbounds.filters import ImmEkf, OracleEkf
from locbounds.filters.lowering import lower
from locbounds.precision import double_precision

ROUNDING = 1e-8  # metres; the same algebra in another order


def textbook_tracks(scenario, z):
    model = double_precision(lower)(scenario)
    return [np.array(part) for part in zip(*(textbook.imm_ekf(model, track) for track in z), strict=True)]


@pytest.mark.parametrize(
    "options",
    [
        {"dim": 2},
        {"dim": 2, "discrete": True},  # Q singular
        pytest.param({"dim": 3, "links": 2, "outliers": True}, marks=pytest.mark.slow),
    ],
    ids=str,
)
def test_reproduces_the_textbook(options):
    scenario = awkward(**options)
    z = with_gaps(lb.simulate(scenario, runs=3, seed=1).measurements)
    mean, covariance = textbook_tracks(scenario, z)
    ours = ImmEkf()(scenario, z)
    np.testing.assert_allclose(ours.mean, mean, atol=ROUNDING)
    np.testing.assert_allclose(np.asarray(ours.covariance), covariance, rtol=1e-9, atol=1e-7)
    assert ours.mean.dtype == np.float64


def test_irregular_times_and_dwell_times():
    base = awkward(2)
    links = [lb.Link(a.name, a.measurement, lb.DwellSight(None, [2.0, 0.7]), a.noises) for a in base.links]
    scenario = base.replace(times=lb.Times([0, 0.1, 0.5, 2.5, 2.6, 7.0, 7.1, 7.3, 8, 9, 9.5, 9.6, 12]), links=links)
    z = lb.simulate(scenario, runs=2, seed=1).measurements
    np.testing.assert_allclose(ImmEkf()(scenario, z).mean, textbook_tracks(scenario, z)[0], atol=ROUNDING)


def test_filterpy_imm_of_ekfs(paper):
    """FilterPy's IMMEstimator over eight of its EKFs; rows of its Markov matrix sum to one, whatever its docs say."""
    kalman = pytest.importorskip("filterpy.kalman")
    scenario, draws = paper
    model = double_precision(lower)(scenario.replace(links=awkward_chains(scenario.links)))
    z = draws.measurements[:2]

    class RangeEkf(kalman.ExtendedKalmanFilter):
        bias: np.ndarray = np.zeros(3)

        def update(self, z):
            def H(x):
                return textbook.ranges(x[:2], model.anchors, 4)[1]

            def h(x):
                return textbook.ranges(x[:2], model.anchors, 4)[0] + self.bias

            super().update(z, HJacobian=H, Hx=h)

    expected = []
    for track in z:
        filters = []
        for joint in np.ndindex(2, 2, 2):
            f = RangeEkf(dim_x=4, dim_z=3)
            f.x, f.P, f.F, f.Q = model.m0.copy(), model.P0.copy(), model.F[0], model.Q[0]  # pyright: ignore
            f.bias = np.asarray(model.means[range(3), joint, 0])
            f.R = np.diag(model.variances[range(3), joint, 0])
            filters.append(f)
        T, start = np.ones((1, 1)), np.ones(1)
        for m in range(3):
            T, start = np.kron(T, model.transitions[m, 0]), np.kron(start, model.start[m])
        imm = kalman.IMMEstimator(filters, start, T)
        rows = []
        for ranges in track:
            imm.predict(0)
            imm.update(ranges)
            rows.append(imm.x.copy())
        expected.append(rows)
    ours = ImmEkf()(scenario.replace(links=awkward_chains(scenario.links)), z)
    np.testing.assert_allclose(ours.mean[:, 1:], expected, atol=1e-6)


def awkward_chains(links):
    chains = ([[0.9, 0.1], [0.3, 0.7]], [[0.6, 0.4], [0.05, 0.95]], [[0.8, 0.2], [0.5, 0.5]])
    return [
        lb.Link(a.name, a.measurement, lb.MarkovSight([0.7, 0.3], chain), a.noises)
        for a, chain in zip(links, chains, strict=True)
    ]


def test_a_known_sight_makes_it_the_oracle():
    scenario = awkward(2)
    draws = lb.simulate(scenario, runs=1, seed=2)
    known = scenario.with_known_sight(draws.sight[0])
    ours = ImmEkf()(known, draws.measurements)
    oracle = OracleEkf()(scenario, draws.measurements, 0, draws.sight)
    np.testing.assert_allclose(ours.mean, oracle.mean, atol=ROUNDING)
    np.testing.assert_allclose(np.asarray(ours.covariance), np.asarray(oracle.covariance), rtol=1e-9, atol=1e-7)


def test_the_order_of_the_anchors_does_not_matter(paper):
    scenario, draws = paper
    order = [2, 0, 1]
    shuffled = scenario.replace(links=[scenario.links[m] for m in order])
    z = draws.measurements[:8]
    np.testing.assert_allclose(ImmEkf()(shuffled, z[..., order]).mean, ImmEkf()(scenario, z).mean, atol=ROUNDING)


def test_rotation_turns_the_estimates():
    scenario = awkward(2)
    z = lb.simulate(scenario, runs=4, seed=1).measurements
    angle = 1.1
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    both = np.kron(np.eye(2), turn)
    turned = scenario.replace(
        prior=lb.GaussianPrior(both @ scenario.prior.mean, both @ scenario.prior.covariance @ both.T),
        links=[lb.Link(a.name, lb.Range(turn @ a.measurement.anchor), a.sight, a.noises) for a in scenario.links],
    )
    np.testing.assert_allclose(ImmEkf()(turned, z).mean, ImmEkf()(scenario, z).mean @ both.T, atol=ROUNDING)


def test_without_any_range_it_predicts():
    scenario = awkward(2)
    estimates = ImmEkf()(scenario, np.full((2, scenario.steps, 3), np.nan))
    with jax.enable_x64(True):
        F, Q = np.asarray(scenario.transition[0]), np.asarray(scenario.process_noise[0])
    x, P = scenario.prior.mean, scenario.prior.covariance
    for _ in range(scenario.steps):
        x, P = F @ x, F @ P @ F.T + Q
    np.testing.assert_allclose(estimates.mean[:, -1], [x, x], rtol=1e-12)
    np.testing.assert_allclose(np.asarray(estimates.covariance)[:, -1], [P, P], rtol=1e-12)


def test_a_track_does_not_depend_on_its_company(paper):
    scenario, draws = paper
    alone = ImmEkf()(scenario, draws.measurements[700:701])
    together = ImmEkf()(scenario, draws.measurements)
    np.testing.assert_allclose(alone.mean[0], together.mean[700], atol=1e-9)
    assert ImmEkf(covariance=False)(scenario, draws.measurements[:3]).covariance is None


def test_a_mobile_at_an_anchor_is_no_surprise():
    scenario = awkward(2)
    links = [*scenario.links[1:], lb.Link("here", lb.Range(scenario.prior.mean[:2]), *unpack(scenario.links[0]))]
    here = scenario.replace(links=links, prior=lb.GaussianPrior(np.r_[10.0, 10.0, 0, 0], scenario.prior.covariance))
    estimates = ImmEkf()(here, lb.simulate(here, runs=4, seed=1).measurements)
    assert not estimates.diverged.any()


def unpack(link):
    return link.sight, link.noises


def test_what_diverges_is_flagged(paper):
    scenario, draws = paper
    z = draws.measurements[:3].copy()
    z[1, 5] = 1e300
    estimates = ImmEkf()(scenario, z)
    np.testing.assert_array_equal(estimates.diverged, [False, True, False])
    np.testing.assert_allclose(estimates.mean[0], ImmEkf()(scenario, draws.measurements[:1]).mean[0], atol=1e-9)


def test_far_outliers_do_not_break_it(paper):
    """Both modes are practically impossible then: weights must not all underflow."""
    scenario, draws = paper
    z = draws.measurements[:2].copy()
    z[1, 5] += 1e6
    assert not ImmEkf()(scenario, z).diverged.any()


def test_errors_name_cause_and_remedy(paper):
    scenario, draws = paper
    with pytest.raises(lb.InputError, match="shape"):
        ImmEkf()(scenario, draws.measurements[:2, :, :2])
    with pytest.raises(lb.InputError, match="NaN where"):
        ImmEkf()(scenario, np.full((1, 100, 3), np.inf))
    many = [lb.Link(f"a{m}", scenario.links[0].measurement, *unpack(scenario.links[0])) for m in range(9)]
    with pytest.raises(lb.InputError, match="imm-ekf-factorised"):
        ImmEkf()(scenario.replace(links=many), np.zeros((1, 100, 9)))


def test_under_jit_and_outside_it_is_the_same():
    scenario = awkward(2)
    z = lb.simulate(scenario, runs=3, seed=1).measurements
    with jax.enable_x64(True):
        inside = jax.jit(lambda z: ImmEkf()(scenario, z).mean)(z)
    np.testing.assert_allclose(inside, ImmEkf()(scenario, z).mean, atol=1e-9)
    with pytest.raises(lb.PrecisionError):
        jax.jit(lambda z: ImmEkf()(scenario, z).mean)(z)


@pytest.mark.slow
@pytest.mark.parametrize("stay", lb.papers.fritsche2013.STAY)
def test_table_1(stay):
    """Published with 20,000 runs; ours with 8,192. Within 1 m, the accuracy to which the paper specifies the filter."""
    published = dict(zip(lb.papers.fritsche2013.STAY, lb.papers.fritsche2013.TABLE1_M["IMM-EKF"], strict=True))[stay]
    scenario = lb.papers.fritsche2013.scenario(stay)
    draws = lb.simulate(scenario, runs=8192, seed=11)
    error = ImmEkf(covariance=False)(scenario, draws.measurements).mean - draws.states
    rmse = np.sqrt((error[..., :2] ** 2).sum(-1).mean(0)).mean()
    assert abs(rmse - published) < 1.0
