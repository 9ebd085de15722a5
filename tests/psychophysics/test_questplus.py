"""QUEST+: against the paper's equations written out one by one, and what has to hold of it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asperity.errors import AsperityError
from asperity.psychophysics.analysis.psychometric import Psychometric
from asperity.psychophysics.procedures.questplus import QuestPlus


def made(**changes):
    options = {
        "intensities": np.linspace(-2, 0, 9), "thresholds": np.linspace(-2, 0, 7),
        "widths": np.array([0.4, 1.0]), "lapses": np.array([0.0, 0.05]),
    }  # fmt: skip
    return QuestPlus(**{**options, **changes})


def naive(quest, answers):
    """Return posterior and expected entropies with plain loops: Watson (2017), Eqs. 1 to 9."""
    shape = quest.posterior.shape
    posterior = np.ones(shape)

    def likelihood(cell, x, right):
        i, j, k = cell
        psi = float(
            Psychometric(quest.thresholds[i], quest.widths[j], quest.lapses[k], 0.5, "weibull")(x)
        )
        psi = min(max(psi, 1e-12), 1 - 1e-12)
        return psi if right else 1.0 - psi

    for x, right in answers:
        for cell in np.ndindex(shape):
            posterior[cell] *= likelihood(cell, x, right)
    posterior /= posterior.sum()
    expected = []
    for x in quest.intensities:
        total = 0.0
        for right in (False, True):
            joint = np.array(
                [posterior[cell] * likelihood(cell, x, right) for cell in np.ndindex(shape)]
            )
            after = joint / joint.sum()
            entropy = -np.sum(after[after > 0] * np.log(after[after > 0]))
            total += joint.sum() * entropy
        expected.append(total)
    return posterior, np.array(expected)


@given(st.lists(st.tuples(st.integers(0, 8), st.booleans()), max_size=6))
@settings(max_examples=10, deadline=None)
def test_it_is_the_papers_equations(told):
    quest = made()
    answers = [(float(quest.intensities[i]), right) for i, right in told]
    for x, right in answers:
        quest.answer(x, right)
    posterior, expected = naive(quest, answers)
    np.testing.assert_allclose(quest.posterior, posterior, atol=1e-12)
    np.testing.assert_allclose(quest.expected_entropy(), expected, atol=1e-9)
    assert quest.next() == quest.intensities[np.argmin(expected)]


def test_asking_never_raises_the_entropy_that_is_expected_and_order_does_not_matter():
    answers = [(-0.5, True), (-1.0, False), (-0.75, True), (0.0, True)]
    one, other = made(), made()
    for x, right in answers:
        p = one.posterior[one.posterior > 0]
        assert one.expected_entropy().max() <= -np.sum(p * np.log(p)) + 1e-12
        one.answer(x, right)
    for x, right in reversed(answers):
        other.answer(x, right)
    np.testing.assert_allclose(one.posterior, other.posterior, atol=1e-15)


def test_closed_cases():
    # One value of everything but two thresholds far apart: between them an answer tells all.
    quest = made(
        intensities=np.array([-3.0, -1.0, 1.0]), thresholds=np.array([-2.0, 0.0]),
        widths=np.array([0.1]), lapses=np.array([0.0]),
    )  # fmt: skip
    assert quest.next() == -1.0
    # Guessing hides half of it: right with 1 or a half. H(theta|x) = 3/4 H(1/3).
    third = -(np.log(1 / 3) / 3 + 2 * np.log(2 / 3) / 3)
    assert quest.expected_entropy()[1] == pytest.approx(0.75 * third)
    assert quest.expected_entropy()[0] == pytest.approx(np.log(2.0))
    quest.answer(-1.0, True)
    np.testing.assert_allclose(quest.posterior.ravel(), [2 / 3, 1 / 3])
    quest.answer(-1.0, False)
    np.testing.assert_allclose(quest.posterior.ravel(), [0.0, 1.0], atol=1e-9)


def test_it_finds_a_threshold():
    truth = Psychometric(-0.8, 0.6, 0.02, 0.5, "weibull")
    errors = []
    for seed in range(10):
        quest = made(
            intensities=np.linspace(-2, 0, 41), thresholds=np.linspace(-2, 0, 61),
            widths=np.array([0.25, 0.4, 0.63, 1.0, 1.6]), lapses=np.array([0.0, 0.02, 0.04]),
        )  # fmt: skip
        rng = np.random.default_rng(seed)
        for _ in range(60):
            x = quest.next()
            quest.answer(x, bool(rng.random() < truth(x)))
        mean, spread = quest.estimate()["threshold"]
        errors.append((mean - truth.threshold) / spread)
    assert abs(np.mean(errors)) < 1.0
    assert np.std(errors) < 2.0


def test_refuses_a_prior_of_another_shape():
    with pytest.raises(AsperityError, match=r"shape \(7, 2, 2\)"):
        made(prior=np.ones((3, 2)))
