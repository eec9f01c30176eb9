"""The rival of benches/forecast_train.rs in JAX: one jitted update, buffers donated, `lax.scan` over time.

    python benches/rivals/forecast_train_jax.py [open] [coastal] [--threads N]
"""

import argparse
import json
import os
import time

parser = argparse.ArgumentParser()
parser.add_argument("subjects", nargs="*", default=["open", "coastal"])
parser.add_argument("--threads", type=int, default=1)
arguments = parser.parse_args()

# XLA takes its number of threads from the cores that the process may use.
os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[: arguments.threads])
os.environ["JAX_PLATFORMS"] = "cpu"
if arguments.threads == 1:
    os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false"

import jax  # noqa: E402
import jax.numpy as jnp  # noqa: E402
import optax  # noqa: E402

ROWS = 32
SUBJECTS = {
    "open": dict(steps=9, hidden=64, layers=[64], outputs=2, anchored=False, activation=jax.nn.relu),
    "coastal": dict(steps=74, hidden=256, layers=[256, 256], outputs=20, anchored=True,
                    activation=jax.nn.leaky_relu),
}


def uniform(key, shape, bound):
    return jax.random.uniform(key, shape, minval=-bound, maxval=bound)


def parameters(key, hidden, layers, outputs, anchored, **_):
    keys = iter(jax.random.split(key, 16))
    bound = hidden**-0.5
    lstm = dict(w_x=uniform(next(keys), (2, 4 * hidden), bound), w_h=uniform(next(keys), (hidden, 4 * hidden), bound),
                b_x=uniform(next(keys), (4 * hidden,), bound), b_h=uniform(next(keys), (4 * hidden,), bound))
    sizes = [hidden + 2 * anchored, *layers, outputs]
    linear = [dict(w=uniform(next(keys), (a, b), a**-0.5), b=uniform(next(keys), (b,), a**-0.5))
              for a, b in zip(sizes, sizes[1:])]
    return dict(lstm=lstm, linear=linear)


def predict(p, histories, anchors, hidden, anchored, activation, unroll):
    lstm = p["lstm"]
    projected = histories @ lstm["w_x"] + (lstm["b_x"] + lstm["b_h"])

    def step(carry, gates):
        h, c = carry
        i, f, g, o = jnp.split(gates + h @ lstm["w_h"], 4, axis=1)
        c = jax.nn.sigmoid(f) * c + jax.nn.sigmoid(i) * jnp.tanh(g)
        return (jax.nn.sigmoid(o) * jnp.tanh(c), c), None

    zero = jnp.zeros((histories.shape[1], hidden))
    (h, _), _ = jax.lax.scan(step, (zero, zero), projected, unroll=unroll)
    x = jnp.concatenate([h, anchors], axis=1) if anchored else h
    for layer in p["linear"][:-1]:
        x = activation(x @ layer["w"] + layer["b"])
    return x @ p["linear"][-1]["w"] + p["linear"][-1]["b"]


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


def measure(sizes, unroll):
    keys = jax.random.split(jax.random.key(1), 4)
    p = parameters(keys[0], **sizes)
    data = (uniform(keys[1], (sizes["steps"], ROWS, 2), 1), uniform(keys[2], (ROWS, 2), 1),
            uniform(keys[3], (ROWS, sizes["outputs"]), 1))
    adam = optax.adam(1e-4)
    static = {key: sizes[key] for key in ("hidden", "anchored", "activation")}

    def loss_of(p, histories, anchors, targets):
        return jnp.mean((predict(p, histories, anchors, unroll=unroll, **static) - targets) ** 2)

    def update(p, state, *data):
        loss, gradients = jax.value_and_grad(loss_of)(p, *data)
        changes, state = adam.update(gradients, state, p)
        return optax.apply_updates(p, changes), state, loss

    update = jax.jit(update, donate_argnums=(0, 1))
    held = [p, adam.init(p)]

    def iteration():
        *held[:], loss = update(*held, *data)
        loss.block_until_ready()

    return median_seconds(iteration)


for subject in arguments.subjects:
    sizes = SUBJECTS[subject]
    unrolls = [1, sizes["steps"]] if sizes["steps"] < 20 else [1, 4]
    results = {f"unroll={unroll}": measure(sizes, unroll) for unroll in unrolls}
    best = min((value, name) for name, value in results.items())
    print(json.dumps({"subject": f"forecast-train-{subject}", "who": f"jax-{best[1]}", "threads": arguments.threads,
                      "seconds": best[0], "variants": results}), flush=True)
