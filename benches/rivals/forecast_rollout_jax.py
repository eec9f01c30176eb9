"""The rival of benches/forecast_rollout.rs in JAX: the whole rollout in one jitted function, `lax.scan` over its
steps, the LSTM unrolled or scanned, whichever is faster.

    python benches/rivals/forecast_rollout_jax.py [--threads N]
"""

import argparse
import json
import math
import os
import time

parser = argparse.ArgumentParser()
parser.add_argument("--threads", type=int, default=1)
arguments = parser.parse_args()

# XLA takes its number of threads from the cores that the process may use.
os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[: arguments.threads])
os.environ["JAX_PLATFORMS"] = "cpu"
if arguments.threads == 1:
    os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false"

import jax  # noqa: E402
import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402
from safetensors import safe_open  # noqa: E402

MODEL = "models/open-water-stochastic.safetensors"
OBSTACLES, HISTORY, STEPS = 10, 10, 100


def history(obstacle):
    speed = 5.0 + 2.0 * obstacle
    angles = [0.05 * k + 0.3 * obstacle for k in range(HISTORY)]
    return [[speed * k * math.cos(a), speed * k * math.sin(a)] for k, a in enumerate(angles)]


with safe_open(MODEL, "np") as file:
    step_m = json.loads(file.metadata()["config"])["training"]["scaling"]["step_m"]
    p = {name: file.get_tensor(name) for name in file.keys()}
    p = {name: jnp.asarray(value.T if value.ndim == 2 else value) for name, value in p.items()}
observed = np.array([history(i) for i in range(OBSTACLES)])


def predict(p, steps, unroll):
    projected = steps @ p["lstm.weight_ih_l0"] + (p["lstm.bias_ih_l0"] + p["lstm.bias_hh_l0"])

    def step(carry, gates):
        h, c = carry
        i, f, g, o = jnp.split(gates + h @ p["lstm.weight_hh_l0"], 4, axis=1)
        c = jax.nn.sigmoid(f) * c + jax.nn.sigmoid(i) * jnp.tanh(g)
        return (jax.nn.sigmoid(o) * jnp.tanh(c), c), None

    zero = jnp.zeros((steps.shape[1], p["lstm.weight_hh_l0"].shape[0]))
    (h, _), _ = jax.lax.scan(step, (zero, zero), projected, unroll=unroll)
    h = jax.nn.relu(h @ p["linear.0.weight"] + p["linear.0.bias"])
    return h @ p["linear.1.weight"] + p["linear.1.bias"]


def jitted(unroll):
    def call(window, p):
        given = predict(p, window, unroll)
        return jnp.concatenate([window[1:], given[None]]), given

    return jax.jit(lambda p, window: jax.lax.scan(lambda w, _: call(w, p), window, None, length=STEPS)[1])


def median_seconds(work, seconds=4.0):
    start = time.perf_counter()
    while time.perf_counter() - start < seconds / 4:
        work()
    times, start = [], time.perf_counter()
    while len(times) < 5 or time.perf_counter() - start < seconds:
        call = time.perf_counter()
        work()
        times.append(time.perf_counter() - call)
    return sorted(times)[len(times) // 2]


def measure(unroll):
    extend = jitted(unroll)

    def roll_out():
        both = np.concatenate([observed, observed[:, ::-1]])
        steps = (np.diff(both, axis=1) / step_m).astype(np.float32).transpose(1, 0, 2)
        way = np.asarray(extend(p, steps)).transpose(1, 0, 2).astype(np.float64) * step_m
        return both[:, -1:] + way.cumsum(axis=1)

    ends = roll_out()[:, -1]
    return median_seconds(roll_out), [*ends[0].tolist(), *ends[OBSTACLES].tolist()]


results = {f"unroll={unroll}": measure(unroll) for unroll in (1, HISTORY - 1)}
(seconds, ends), name = min((value, name) for name, value in results.items())
print(json.dumps({"subject": "forecast-rollout", "who": f"jax-{name}", "threads": arguments.threads,
                  "seconds": seconds, "ends_m": ends}))
