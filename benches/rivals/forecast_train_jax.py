"""The rival of benches/forecast_train.rs in JAX: one jitted update, buffers donated, `lax.scan` over time, unrolled
or not, whichever is faster.

    python benches/rivals/forecast_train_jax.py [open] [coastal] [--threads N]
"""

from functools import partial

from support import median_seconds, parse, report
import jax_support

arguments = parse(["open", "coastal"])
jax = jax_support.limited(arguments.threads)

import jax.numpy as jnp  # noqa: E402
import optax  # noqa: E402

from jax_support import apply_linear, apply_lstm, linear, lstm, uniform  # noqa: E402

ROWS = 32
SUBJECTS = {
    "open": dict(steps=9, hidden=64, layers=[64], outputs=2, anchored=False, activation=jax.nn.relu),
    "coastal": dict(steps=74, hidden=256, layers=[256, 256], outputs=20, anchored=True,
                    activation=jax.nn.leaky_relu),
}


def parameters(key, hidden, layers, outputs, anchored, **_):
    keys = jax.random.split(key, 2 + len(layers))
    sizes = [hidden + 2 * anchored, *layers, outputs]
    dense = [linear(key, a, b) for key, a, b in zip(keys[1:], sizes, sizes[1:])]
    return dict(lstm=lstm(keys[0], 2, hidden), linear=dense)


def predict(p, histories, anchors, anchored, activation, unroll):
    _, h = apply_lstm(p["lstm"], histories, unroll)
    x = jnp.concatenate([h, anchors], axis=1) if anchored else h
    for layer in p["linear"][:-1]:
        x = activation(apply_linear(layer, x))
    return apply_linear(p["linear"][-1], x)


def measure(sizes, unroll):
    keys = jax.random.split(jax.random.key(1), 4)
    p = parameters(keys[0], **sizes)
    data = (uniform(keys[1], (sizes["steps"], ROWS, 2), 1), uniform(keys[2], (ROWS, 2), 1),
            uniform(keys[3], (ROWS, sizes["outputs"]), 1))
    adam = optax.adam(1e-4)
    static = {key: sizes[key] for key in ("anchored", "activation")}

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
        jax.block_until_ready((held, loss))

    return median_seconds(iteration)


for subject in arguments.subjects:
    sizes = SUBJECTS[subject]
    unrolls = [1, sizes["steps"]] if sizes["steps"] < 20 else [1, 4]
    report(f"forecast-train-{subject}", "jax", arguments.threads,
           {f"unroll={unroll}": partial(measure, sizes, unroll) for unroll in unrolls})
