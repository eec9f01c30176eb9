"""JAX on the number of cores it is given, and the layers that its rivals share."""

import os
import sys


def limited(threads):
    """Lets XLA have `threads` cores: it takes its number of threads from those that the process may use. Call
    this before anything imports JAX."""
    assert "jax" not in sys.modules
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:threads])
    os.environ["JAX_PLATFORMS"] = "cpu"
    if threads == 1:
        os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false"
    import jax

    return jax


def uniform(key, shape, bound):
    import jax

    return jax.random.uniform(key, shape, minval=-bound, maxval=bound)


def linear(key, inputs, outputs):
    """Weights of a dense layer with PyTorch's default initialisation."""
    import jax

    keys = jax.random.split(key)
    return dict(w=uniform(keys[0], (inputs, outputs), inputs**-0.5), b=uniform(keys[1], (outputs,), inputs**-0.5))


def lstm(key, inputs, hidden):
    """Weights of an LSTM, its two biases included."""
    import jax

    keys = jax.random.split(key, 4)
    bound = hidden**-0.5
    return dict(w_x=uniform(keys[0], (inputs, 4 * hidden), bound), w_h=uniform(keys[1], (hidden, 4 * hidden), bound),
                b_x=uniform(keys[2], (4 * hidden,), bound), b_h=uniform(keys[3], (4 * hidden,), bound))


def apply_linear(p, x):
    return x @ p["w"] + p["b"]


def apply_lstm(p, sequence, unroll):
    """The hidden state after every step of `sequence[steps][rows][inputs]`, and the last: one product projects the
    inputs of all steps, `lax.scan` walks over time."""
    import jax
    import jax.numpy as jnp

    projected = sequence @ p["w_x"] + (p["b_x"] + p["b_h"])

    def step(carry, gates):
        h, c = carry
        i, f, g, o = jnp.split(gates + h @ p["w_h"], 4, axis=1)
        c = jax.nn.sigmoid(f) * c + jax.nn.sigmoid(i) * jnp.tanh(g)
        h = jax.nn.sigmoid(o) * jnp.tanh(c)
        return (h, c), h

    zero = jnp.zeros((sequence.shape[1], p["w_h"].shape[0]))
    (last, _), states = jax.lax.scan(step, (zero, zero), projected, unroll=unroll)
    return states, last
