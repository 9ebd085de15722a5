"""A finger learns to tell four textures apart: `pip install 'asperity[gym]'`.

It strokes plates, and logistic regression learns from what it feels.
"""

import argparse

import gymnasium
import numpy as np

from asperity.mujoco.exploration import ID

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--strokes", type=int, default=8, help="of each texture, to learn from")
strokes = parser.parse_args().strokes

env = gymnasium.make(ID)
names = list(env.unwrapped.textures)
rng = np.random.default_rng(0)


def stroke(seed, name=None, guess=None):
    """Stroke a plate once; return what was felt, and the reward of the guess."""
    env.reset(seed=seed, options={"texture": name} if name else None)
    press, felt, ended = rng.uniform(-1.0, 1.0), [], False
    while not ended:
        action = np.zeros(2 + len(names))
        action[:2] = 0.8, press
        if guess is not None and len(felt) == 24:
            action[2:] = guess(np.mean(felt[9:], axis=0))
        observation, reward, ended, _, _ = env.step(action)
        felt.append(observation[-20:])
    return np.mean(felt[9:], axis=0), reward


# Learn: weights of a softmax, by gradient descent.
labels = np.repeat(np.arange(len(names)), strokes)
features = np.array([stroke(i, names[label])[0] for i, label in enumerate(labels)])
middle, spread = features.mean(axis=0), features.std(axis=0) + 1e-9
inputs = np.column_stack([(features - middle) / spread, np.ones(len(features))])
weights = np.zeros((inputs.shape[1], len(names)))
for _ in range(2000):
    scores = np.exp(inputs @ weights - (inputs @ weights).max(axis=1, keepdims=True))
    wrong = scores / scores.sum(axis=1, keepdims=True) - np.eye(len(names))[labels]
    weights -= 0.1 * (inputs.T @ wrong / len(inputs) + 1e-3 * weights)


def guess(felt):
    """Return a number for each texture, from -1 to 1."""
    scores = np.append((felt - middle) / spread, 1.0) @ weights
    return scores / np.abs(scores).max()


# Try it on plates and places that it has not felt.
rewards = [stroke(10_000 + i, guess=guess)[1] for i in range(24)]
print(f"{np.mean(rewards):.0%} of {len(rewards)} strokes named right; chance {1 / len(names):.0%}")
