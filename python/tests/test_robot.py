"""The example environment keeps Gymnasium's contract, repeats by its seed, and can be solved."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
import pytest
from conftest import ROOT, load_module

gym = pytest.importorskip("gymnasium", reason="the extra 'robot' is not installed")


@pytest.fixture(scope="module")
def example() -> ModuleType:
    return load_module(ROOT / "examples" / "cloth_env.py")


def rollout(env: Any, seed: int, actions: np.ndarray[Any, Any]) -> list[np.ndarray[Any, Any]]:
    seen = [env.reset(seed=seed)[0]]
    for action in actions:
        observation, reward, *_ = env.step(action)
        seen.append(np.append(observation, reward))
    return seen


@pytest.mark.filterwarnings("error")
def test_the_contract(example: ModuleType) -> None:
    """Gymnasium's own checker; its warnings count as failures."""
    pytest.importorskip("pyvista", reason="the checker renders")
    from gymnasium.utils.env_checker import check_env

    check_env(gym.make("clothsim/FoldTowel-v0").unwrapped)


def test_equal_seeds_and_actions_give_equal_bits(example: ModuleType) -> None:
    actions = np.random.default_rng(0).uniform(-1, 1, (6, 6)).astype(np.float32)
    first = rollout(example.FoldTowel(), 5, actions)
    for a, b in zip(first, rollout(example.FoldTowel(), 5, actions), strict=True):
        np.testing.assert_array_equal(a, b)
    other = rollout(example.FoldTowel(), 6, actions)
    assert np.abs(other[-1] - first[-1]).max() > 1e-3, "the seed does nothing"


def test_the_hand_made_policy_folds_and_idling_does_not(example: ModuleType) -> None:
    env = example.FoldTowel()
    total, info, _ = example.play(env, example.arc, seed=3)
    assert info["is_success"]
    assert info["distance"] < example.FOLDED
    assert total > 1.5, "a fold takes off the whole distance, and one more is for success"
    total, info, _ = example.play(env, lambda _: np.zeros(6, np.float32), seed=3)
    assert not info["is_success"]
    assert info["steps"] == example.HORIZON
    assert abs(total) < 0.05


def test_grippers_stay_within_reach(example: ModuleType) -> None:
    now = np.zeros((2, 3))
    apart = np.array([[0.0, 0.0, -0.05], [0.0, 0.0, 0.05]])
    np.testing.assert_array_equal(example.reachable(apart, now), now)
    down = np.array([[0.0, -1.0, 0.0], [0.0, -1.0, 0.0]])
    np.testing.assert_array_equal(example.reachable(down, now), now)
    far = example.reachable(np.full((2, 3), 9.0), now)
    np.testing.assert_array_equal(far, np.full((2, 3), example.REACH))


def test_side_by_side_as_alone(example: ModuleType) -> None:
    actions = np.stack([example.arc(k) for k in range(3)])
    vector = gym.vector.SyncVectorEnv([example.FoldTowel] * 2)
    vector.reset(seed=[1, 2])
    for action in actions:
        seen = vector.step(np.stack([action, action]))[0]
    vector.close()
    for row, seed in zip(seen, (1, 2), strict=True):
        alone = rollout(example.FoldTowel(), seed, actions)[-1][:-1]
        np.testing.assert_array_equal(row, alone.astype(np.float32))
