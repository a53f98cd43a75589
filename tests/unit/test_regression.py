"""Regressors as maths: identities of ridge regression, selection, scikit-learn's contract."""

import numpy as np
import pytest

from tests.unit.regression_data import smooth_data
from vermilion.regression.cross_validation import (
    clips_of_rows,
    held_out_novelty,
)
from vermilion.regression.estimators import (
    AffineRegressor,
    RBFNetwork,
    gaussian_activations,
)
from vermilion.regression.kernel import KernelRegressor
from vermilion.regression.ridge import ridge_weights
from vermilion.regression.scaling import feature_scale


@pytest.fixture(scope="module")
def sklearn():
    """Imported where it is needed: every process of the tests imports this file, one of them runs it."""
    import sklearn.base
    import sklearn.kernel_ridge
    import sklearn.linear_model
    import sklearn.model_selection
    import sklearn.pipeline
    import sklearn.preprocessing

    return sklearn


@pytest.fixture
def data():
    return smooth_data()


def test_primal_equals_dual(data):
    features, targets = data
    for a, b in zip(
        ridge_weights(features, targets, 0.3, "primal"),
        ridge_weights(features, targets, 0.3, "dual"),
        strict=True,
    ):
        np.testing.assert_allclose(a, b, atol=1e-10)


def test_rbf_network_is_ridge_on_its_activations(data, sklearn):
    features, targets = data
    network = RBFNetwork(alpha=0.2, beta=0.5).fit(features, targets)
    activations = network.activations(features)
    peer = sklearn.linear_model.Ridge(alpha=0.2).fit(activations, targets)
    np.testing.assert_allclose(network.coefficients_ @ network.basis_, peer.coef_.T, atol=1e-8)
    np.testing.assert_allclose(network.bias_, peer.intercept_, atol=1e-8)
    np.testing.assert_allclose(network.predict(features), peer.predict(activations), atol=1e-9)


def test_affine_regressor_is_ridge_on_scaled_features(data, sklearn):
    features, targets = data
    regressor = AffineRegressor(alpha=0.7).fit(features, targets)
    peer = sklearn.linear_model.Ridge(alpha=0.7).fit(regressor.scaled(features), targets)
    np.testing.assert_allclose(
        regressor.predict(features), peer.predict(regressor.scaled(features)), atol=1e-9
    )


def test_affine_regressor_without_penalty_recovers_an_affine_map(data):
    features, _ = data
    matrix = np.random.default_rng(2).normal(size=(7, 4))
    targets = features @ matrix + 3.0
    regressor = AffineRegressor(alpha=1e-10).fit(features, targets)
    np.testing.assert_allclose(
        regressor.predict(features[:5] + 100), (features[:5] + 100) @ matrix + 3, atol=1e-5
    )


def test_activation_is_one_at_the_prototype_and_follows_equation_2():
    prototypes = np.array([[0.0, 0.0], [3.0, 4.0]])
    np.testing.assert_allclose(
        gaussian_activations(prototypes[:1], prototypes, 0.1), [[1.0, np.exp(-2.5)]]
    )


def test_order_of_rows_does_not_matter(data):
    features, targets = data
    order = np.random.default_rng(1).permutation(120)
    plain = RBFNetwork(0.1, 0.5, prototype_stride=1).fit(features, targets)
    mixed = RBFNetwork(0.1, 0.5, prototype_stride=1).fit(features[order], targets[order])
    np.testing.assert_allclose(plain.predict(features), mixed.predict(features), atol=1e-8)


def test_large_alpha_leaves_the_mean(data):
    features, targets = data
    for kind in (RBFNetwork, AffineRegressor, KernelRegressor):
        regressor = kind(alpha=1e12)
        predicted = regressor.fit(features, targets).predict(features[:3])
        np.testing.assert_allclose(predicted, np.tile(targets.mean(axis=0), (3, 1)), atol=1e-8)


def test_predictions_keep_the_precision_of_the_targets(data):
    features, targets = data
    network = RBFNetwork().fit(features, targets.astype(np.float32))
    assert network.predict(features).dtype == np.float32


@pytest.mark.parametrize("allowed", [0.3, 0.1, 0.03])
def test_a_basis_changes_predictions_by_no_more_than_is_allowed(data, allowed):
    features, targets = data
    whole = RBFNetwork(1e-3, 0.3).fit(features, targets)
    small = RBFNetwork(1e-3, 0.3, basis_error=allowed).fit(features, targets)
    assert small.basis_.shape[0] < whole.basis_.shape[0]
    predicted = whole.predict(features)
    spread = predicted - predicted.mean(axis=0)
    change = np.linalg.norm(small.predict(features) - predicted)
    assert change < allowed * np.linalg.norm(spread)
    np.testing.assert_allclose(
        small.predict(features).mean(axis=0), targets.mean(axis=0), atol=1e-9
    )


def test_scikit_learn_contract(sklearn):
    network = sklearn.base.clone(RBFNetwork(alpha=3.0, beta=2.0))
    assert network.get_params()["alpha"] == 3.0
    assert network.set_params(beta=5.0).beta == 5.0
    with pytest.raises(ValueError, match="RBFNetwork has no 'gamma'; it has alpha"):
        network.set_params(gamma=1.0)
    with pytest.raises(AttributeError, match="not fitted"):
        network.predict(np.zeros((2, 6)))
    with pytest.raises(ValueError, match=r"features must be \(F, 7\), got \(2, 6\)"):
        AffineRegressor().fit(np.eye(7), np.eye(7)).predict(np.zeros((2, 6)))


def test_scikit_learn_searches_and_scores_a_regressor_in_a_pipeline(data, sklearn):
    features, _ = data
    steps = sklearn.pipeline.make_pipeline(
        sklearn.preprocessing.StandardScaler(), AffineRegressor()
    )
    search = sklearn.model_selection.GridSearchCV(
        steps, {"affineregressor__alpha": [1e-3, 1e9]}, cv=3
    )
    search.fit(features, features @ np.ones((features.shape[1], 2)))
    assert search.best_params_ == {"affineregressor__alpha": 1e-3}
    assert search.best_score_ > 0.99


def test_scale_gives_unit_total_variance_whatever_the_number_of_features(data):
    features, _ = data
    for groups in (None, ["shape"] * 3 + ["distances"] * 4):
        mean, scale = feature_scale(features, groups)
        assert ((features - mean) / scale).var(axis=0).sum() == pytest.approx(1.0)


def test_a_group_keeps_its_proportions_and_weighs_as_much_as_any_other(data):
    features, _ = data
    features = features * [1, 10, 100, 1, 1, 1, 1]
    mean, scale = feature_scale(features, ["a", "a", "a", "b", "b", "b", "b"])
    assert scale[0] == scale[1] == scale[2] != scale[3]
    variance = ((features - mean) / scale).var(axis=0)
    assert variance[:3].sum() == pytest.approx(variance[3:].sum())


@pytest.mark.parametrize("equalise", [0.0, 0.5, 1.0])
def test_equalise_takes_the_root_of_the_ratio_of_deviations(data, equalise):
    features, _ = data
    features = features / features.std(axis=0) * [1, 10, 100, 1, 1, 1, 1]
    mean, scale = feature_scale(features, ["a", "a", "a", "b", "b", "b", "b"], equalise)
    deviation = ((features - mean) / scale).std(axis=0)
    np.testing.assert_allclose(deviation[1] / deviation[0], 10 ** (1 - equalise))
    np.testing.assert_allclose(deviation[2] / deviation[0], 100 ** (1 - equalise))
    assert (deviation**2).sum() == pytest.approx(1.0)


@pytest.mark.parametrize("kind", [RBFNetwork, AffineRegressor, KernelRegressor])
def test_beyond_the_reach_the_prediction_is_drawn_to_the_mean(data, kind):
    features, targets = data
    low, high = features.min(axis=0), features.max(axis=0)
    regressor = kind(reach=0.5).fit(features, targets)
    free = kind().fit(features, targets)
    np.testing.assert_allclose(free.predict(features), regressor.predict(features))
    edge = (high + 0.5 * (high - low))[None]
    np.testing.assert_allclose(regressor.predict(edge), free.predict(edge))
    mean = targets.mean(axis=0)
    away = [np.linalg.norm(regressor.predict(edge + step) - mean) for step in (0, 2, 10, 1e6)]
    assert np.all(np.diff(away) < 0)
    assert away[-1] < 1e-6


@pytest.mark.parametrize("linear", [0.0, 0.5])
def test_the_kernel_regressor_is_kernel_ridge_on_all_frames(data, linear, sklearn):
    """Its low-rank factor against the dual with the whole kernel matrix, the mean taken out."""
    features, targets = data
    regressor = KernelRegressor(0.05, 2.0, linear, tolerance=1e-12).fit(features, targets)
    scaled = regressor.scaled(features)
    kernel = regressor.kernel(scaled, scaled)
    centre = np.eye(120) - 1 / 120
    dual = centre @ np.linalg.solve(centre @ kernel @ centre + 0.05 * np.eye(120), centre @ targets)
    bias = targets.mean(axis=0) - kernel.mean(axis=0) @ dual
    new = features[:9] + 0.3
    expected = regressor.kernel(regressor.scaled(new), scaled) @ dual + bias
    np.testing.assert_allclose(regressor.predict(new), expected, atol=1e-6)
    peer = sklearn.kernel_ridge.KernelRidge(alpha=0.05, kernel="precomputed").fit(
        centre @ kernel @ centre, targets
    )
    np.testing.assert_allclose(centre @ peer.dual_coef_, dual, atol=1e-8)


def test_variance_of_a_prediction_is_that_of_a_gaussian_process(data):
    features, _ = data
    regressor = KernelRegressor(0.05, 2.0, 0.5, tolerance=1e-12)
    regressor.fit_inputs(features)
    scaled, new = regressor.scaled(features), regressor.scaled(features[:9] + 0.3)
    # A flat prior of the mean: a constant of large variance beside the kernel.
    constant = 1e5
    kernel = regressor.kernel(scaled, scaled) + constant
    cross = regressor.kernel(new, scaled) + constant
    prior = regressor.kernel(new, new).diagonal() + constant
    noisy = np.linalg.solve(kernel + 0.05 * np.eye(120), cross.T)
    variance = prior - (cross * noisy.T).sum(axis=1)
    mean_alone = 0.05 / 120
    np.testing.assert_allclose(
        regressor.novelty(features[:9] + 0.3) ** 2, variance - mean_alone, atol=1e-5
    )


@pytest.mark.parametrize("kind", [RBFNetwork, AffineRegressor, KernelRegressor])
def test_held_out_clips_are_more_novel_than_frames_trained_on(data, kind):
    features, targets = data
    sequences = np.zeros(120)
    held = held_out_novelty(kind(), features, sequences, clips_of_rows(sequences, 20, 4), 4)
    known = kind().fit(features, targets).novelty(features)
    assert np.median(held) > np.median(known)
    assert kind().fit(features, targets).novelty(features[:1] + 1e3)[0] > held.max()


def test_a_constant_feature_says_nothing(data):
    features, targets = data
    features = np.column_stack([features, np.full(120, 5.0)])
    changed = features.copy()
    changed[:, -1] = 1e6
    for groups in (None, ["a"] * 8):
        for kind in (RBFNetwork, KernelRegressor):
            fitted = kind(feature_groups=groups).fit(features, targets)
            np.testing.assert_array_equal(fitted.predict(changed), fitted.predict(features))


def test_ridge_needs_a_positive_parameter(data):
    with pytest.raises(ValueError, match="alpha must be positive"):
        ridge_weights(*data, 0.0)
