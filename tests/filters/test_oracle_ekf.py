import datetime

import numpy as np
import pytest

import locbounds as lb
import textbook_filters as textbook
import textbook_trackers
from filter_scenarios import awkward, with_gaps
from locbounds.filters import ImmEkf, OracleEkf
from locbounds.filters.lowering import lower
from locbounds.precision import double_precision

ROUNDING = 1e-8  # metres; the same algebra in another order


@pytest.mark.parametrize(
    "options",
    [{"dim": 2, "discrete": True}, pytest.param({"dim": 3, "outliers": True}, marks=pytest.mark.slow)],
    ids=str,
)
def test_reproduces_the_textbook(options):
    scenario = awkward(**options)
    model = double_precision(lower)(scenario)
    draws = lb.simulate(scenario, runs=2, seed=1)
    z = with_gaps(draws.measurements)
    estimates = OracleEkf()(scenario, z, 0, draws.sight)
    for track, sight, mean, covariance in zip(
        z, draws.sight, estimates.mean, np.asarray(estimates.covariance), strict=True
    ):
        x, P = model.m0, model.P0
        for k in range(scenario.steps):
            F, Q = model.F[k], model.Q[k]
            noises = [(model.weights[m, r], model.means[m, r], model.variances[m, r]) for m, r in enumerate(sight[k])]
            x, P, _ = textbook.ekf_update(F @ x, F @ P @ F.T + Q, track[k], model.anchors, noises)
            np.testing.assert_allclose(mean[k + 1], x, atol=ROUNDING)
            np.testing.assert_allclose(covariance[k + 1], P, rtol=1e-9, atol=1e-7)


def test_stone_soup(paper):
    """Stone Soup's EKF. It has no range-only model, so the test gives it one."""
    pytest.importorskip("stonesoup")
    from stonesoup.models.measurement.nonlinear import NonLinearGaussianMeasurement
    from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
    from stonesoup.predictor.kalman import ExtendedKalmanPredictor
    from stonesoup.types.array import StateVector
    from stonesoup.types.detection import Detection
    from stonesoup.types.hypothesis import SingleHypothesis
    from stonesoup.types.state import GaussianState
    from stonesoup.updater.kalman import ExtendedKalmanUpdater

    scenario, draws = paper
    order = [0, 2, 1, 3]  # Stone Soup's [x, vx, y, vy]
    anchors = scenario.anchors

    class Ranges(NonLinearGaussianMeasurement):
        @property
        def ndim_meas(self):
            return 3

        def function(self, state, noise=False, **kwargs):
            position = np.asarray(state.state_vector, dtype=float)[[0, 2], 0]
            return StateVector(np.linalg.norm(position - anchors, axis=1))

        def jacobian(self, state, **kwargs):
            position = np.asarray(state.state_vector, dtype=float)[[0, 2], 0]
            return textbook.ranges(position, anchors, 4)[1][:, order]

    predictor = ExtendedKalmanPredictor(
        CombinedLinearGaussianTransitionModel([ConstantVelocity(0.5), ConstantVelocity(0.5)])
    )
    now = datetime.datetime(2000, 1, 1)
    state = GaussianState(scenario.prior.mean[order], scenario.prior.covariance[np.ix_(order, order)], timestamp=now)
    bias, std = np.array([0.0, 513.0]), np.array([150.0, np.hypot(150.0, 409.0)])
    expected = []
    for ranges, sight in zip(draws.measurements[0], draws.sight[0], strict=True):
        now += datetime.timedelta(seconds=0.2)
        model = Ranges(ndim_state=4, mapping=(0, 2), noise_covar=np.diag(std[sight] ** 2))
        detection = Detection(StateVector(ranges - bias[sight]), measurement_model=model, timestamp=now)
        prediction = predictor.predict(state, timestamp=now)
        state = ExtendedKalmanUpdater(model).update(SingleHypothesis(prediction, detection))
        x, P = (np.asarray(part, dtype=float) for part in (state.state_vector, state.covar))  # pyright: ignore
        expected.append((x[order, 0], P[np.ix_(order, order)]))
    ours = OracleEkf()(scenario, draws.measurements[:1], 0, draws.sight[:1])
    np.testing.assert_allclose(ours.mean[0, 1:], [x for x, _ in expected], atol=1e-6)
    np.testing.assert_allclose(np.asarray(ours.covariance)[0, 1:], [P for _, P in expected], rtol=1e-6, atol=1e-6)


def test_one_mode_along_a_line_is_the_kalman_filter():
    """Anchor and mobile on the x axis: the range is x itself. Both EKF and IMM-EKF with equal modes are then exact."""
    q, std = 0.3, 2.0
    noise = lb.Gaussian(1.0, std)
    scenario = lb.Scenario(
        title="line",
        times=lb.Times.uniform(step_s=0.5, steps=20),
        motion=lb.ConstantVelocity([q, 0.0]),
        prior=lb.GaussianPrior([100.0, 0, 1, 0], np.diag([9.0, 0, 1, 0])),
        links=[lb.Link("a", lb.Range([0.0, 0.0]), lb.MarkovSight.stay(0.7), (noise, noise))],
    )
    draws = lb.simulate(scenario, runs=2, seed=1)
    dt, H = 0.5, np.array([[1.0, 0.0]])
    F, Q = np.array([[1, dt], [0, 1]]), q * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    for estimates in (
        OracleEkf()(scenario, draws.measurements, 0, draws.sight),
        ImmEkf()(scenario, draws.measurements),
    ):
        for track, mean, covariance in zip(
            draws.measurements, estimates.mean, np.asarray(estimates.covariance), strict=True
        ):
            x, P = np.array([100.0, 1.0]), np.diag([9.0, 1.0])
            for k, z in enumerate(track[:, 0]):
                x, P = F @ x, F @ P @ F.T + Q
                K = P @ H.T / (P[0, 0] + std**2)
                x, P = x + K[:, 0] * (z - 1.0 - x[0]), P - K @ H @ P
                np.testing.assert_allclose(mean[k + 1, [0, 2]], x, rtol=1e-12)
                np.testing.assert_allclose(covariance[k + 1][np.ix_([0, 2], [0, 2])], P, rtol=1e-11)


def test_wrong_sight_is_an_error(paper):
    scenario, draws = paper
    with pytest.raises(lb.InputError, match="sight"):
        OracleEkf()(scenario, draws.measurements[:1], 0, draws.sight[:1] + 1)


@pytest.mark.parametrize("printed", [False, True])
def test_decentralised_form_with_the_corrected_gain_and_as_printed(printed):
    """Chen 2010, eqs. (22)-(26), by inverses of covariances; with the corrected gain it is this filter."""
    scenario = awkward(2)
    model = double_precision(lower)(scenario)
    draws = lb.simulate(scenario, runs=2, seed=4)
    z = with_gaps(draws.measurements)
    ours = OracleEkf(printed_gain=printed)(scenario, z, sight=draws.sight)
    for i in range(2):
        mean, covariance = textbook_trackers.decentralised_ekf(model, z[i], draws.sight[i], printed=printed)
        np.testing.assert_allclose(ours.mean[i], mean, rtol=1e-8, atol=1e-8)
        np.testing.assert_allclose(ours.covariance[i], covariance, rtol=1e-8, atol=1e-8)


def test_refuses_to_run_without_the_sight():
    scenario = awkward(2)
    z = lb.simulate(scenario, runs=2).measurements
    with pytest.raises(lb.InputError, match="not told the sight"):
        OracleEkf()(scenario, z)
