"""The model and the histories that the rivals of benches/forecast_rollout.rs share with it."""

import json
import math

from safetensors import safe_open

OBSTACLES, HISTORY, STEPS = 10, 10, 100


def load(framework):
    """Metres of one unit of the network, and its weights by their names, as tensors of the framework."""
    with safe_open("models/open-water-stochastic.safetensors", framework) as file:
        step_m = json.loads(file.metadata()["config"])["training"]["scaling"]["step_m"]
        return step_m, {name: file.get_tensor(name) for name in file.keys()}


def history(obstacle):
    """A gentle arc, another one for each obstacle."""
    speed = 5.0 + 2.0 * obstacle
    angles = [0.05 * k + 0.3 * obstacle for k in range(HISTORY)]
    return [[speed * k * math.cos(a), speed * k * math.sin(a)] for k, a in enumerate(angles)]


def histories():
    return [history(i) for i in range(OBSTACLES)]


def ends(positions):
    """Where the first obstacle ends up, forwards and backwards: what ours prints, too."""
    return [*positions[0].tolist(), *positions[OBSTACLES].tolist()]
