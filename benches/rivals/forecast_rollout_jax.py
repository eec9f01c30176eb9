"""The rival of benches/forecast_rollout.rs in JAX: the whole rollout in one jitted function, `lax.scan` over its
steps, the LSTM unrolled or scanned, whichever is faster.

    python benches/rivals/forecast_rollout_jax.py [--threads N]
"""

from functools import partial

from support import median_seconds, parse, report
import jax_support

arguments = parse(["forecast-rollout"])
jax = jax_support.limited(arguments.threads)

import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402

from jax_support import apply_linear, apply_lstm  # noqa: E402
from rollout_data import HISTORY, STEPS, ends, histories, load  # noqa: E402

step_m, weights = load("np")
lstm = {ours: jnp.asarray(weights[f"lstm.{name}_l0"].T)
        for ours, name in dict(w_x="weight_ih", w_h="weight_hh", b_x="bias_ih", b_h="bias_hh").items()}
linear = [dict(w=jnp.asarray(weights[f"linear.{i}.weight"].T), b=jnp.asarray(weights[f"linear.{i}.bias"]))
          for i in range(2)]
observed = np.array(histories())


def predict(p, steps, unroll):
    lstm, linear = p
    _, h = apply_lstm(lstm, steps, unroll)
    return apply_linear(linear[1], jax.nn.relu(apply_linear(linear[0], h)))


def roller(unroll):
    def extend(p, window):
        def call(window, _):
            given = predict(p, window, unroll)
            return jnp.concatenate([window[1:], given[None]]), given

        return jax.lax.scan(call, window, None, length=STEPS)[1]

    extend = jax.jit(extend)

    def roll_out():
        both = np.concatenate([observed, observed[:, ::-1]])
        steps = (np.diff(both, axis=1) / step_m).astype(np.float32).transpose(1, 0, 2)
        way = np.asarray(extend((lstm, linear), steps)).transpose(1, 0, 2).astype(np.float64) * step_m
        return both[:, -1:] + way.cumsum(axis=1)

    return roll_out


rollers = {f"unroll={unroll}": roller(unroll) for unroll in (1, HISTORY - 1)}
report("forecast-rollout", "jax", arguments.threads,
       {name: partial(median_seconds, roll_out) for name, roll_out in rollers.items()},
       ends_m=ends(rollers["unroll=1"]()[:, -1]))
