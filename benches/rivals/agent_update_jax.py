"""The rival of benches/agent_update.rs in JAX: losses, gradients, Adam and targets in one jitted function, its
state donated. The twin critics are two networks, or one by `vmap` over both sets of weights, whichever is faster; so
for the unrolling of `lax.scan`.

    python benches/rivals/agent_update_jax.py [td3] [sac] [--history L] [--threads N]
"""

from functools import partial

from support import median_seconds, parse, report
import jax_support

arguments = parse(["td3", "sac"], history=4)
jax = jax_support.limited(arguments.threads)

import jax.numpy as jnp  # noqa: E402
import optax  # noqa: E402

from jax_support import apply_linear, apply_lstm, linear, lstm, uniform  # noqa: E402

OBSERVATION, ACTION, HIDDEN, ROWS = 43, 1, 128, 32
DISCOUNT, RATE, TARGET_RATE, POLICY_DELAY = 0.99, 1e-4, 0.001, 2
relu = jax.nn.relu


def network(key, inputs, outputs):
    keys = jax.random.split(key, 6)
    return dict(current_1=linear(keys[0], inputs, HIDDEN), current_2=linear(keys[1], HIDDEN, HIDDEN),
                memory_in=linear(keys[2], OBSERVATION, HIDDEN), memory=lstm(keys[3], HIDDEN, HIDDEN),
                integrate_1=linear(keys[4], 2 * HIDDEN, HIDDEN), integrate_2=linear(keys[5], HIDDEN, outputs))


def apply(unroll, p, current, history, lengths):
    x = relu(apply_linear(p["current_2"], relu(apply_linear(p["current_1"], current))))
    states, _ = apply_lstm(p["memory"], relu(apply_linear(p["memory_in"], history)), unroll)
    memory = jnp.take_along_axis(states, jnp.maximum(lengths - 1, 0)[None, :, None], axis=0)[0]
    memory = jnp.where(lengths[:, None] > 0, memory, 0.0)
    joined = jnp.concatenate([memory, x], axis=1)
    return apply_linear(p["integrate_2"], relu(apply_linear(p["integrate_1"], joined)))


class Twins:
    """Both critics: as a list of two, or stacked and mapped over."""

    def __init__(self, unroll, stacked):
        self.stacked, self.net = stacked, partial(apply, unroll)

    def new(self, key):
        both = [network(k, OBSERVATION + ACTION, 1) for k in jax.random.split(key)]
        return jax.tree.map(lambda a, b: jnp.stack([a, b]), *both) if self.stacked else both

    def values(self, p, observation, action, *history):
        current = jnp.concatenate([observation, action], axis=1)
        if self.stacked:
            both = jax.vmap(lambda q: self.net(q, current, *history))(p)
        else:
            both = [self.net(q, current, *history) for q in p]
        return both[0][:, 0], both[1][:, 0]

    def first(self, p, observation, action, *history):
        q = jax.tree.map(lambda a: a[0], p) if self.stacked else p[0]
        return self.net(q, jnp.concatenate([observation, action], axis=1), *history)[:, 0]


def follow(target, online):
    return jax.tree.map(lambda t, p: t + TARGET_RATE * (p - t), target, online)


def descend(loss, p, adam_state, adam):
    value, gradients = jax.value_and_grad(loss)(p)
    changes, adam_state = adam.update(gradients, adam_state, p)
    return optax.apply_updates(p, changes), adam_state, value


def present(batch):
    return batch["observation"], (batch["history"], batch["lengths"])


def following(batch):
    return batch["next_observation"], (batch["next_history"], batch["next_lengths"])


def critic_loss(twins, batch, target):
    def loss(p):
        observation, history = present(batch)
        q_1, q_2 = twins.values(p, observation, batch["action"], *history)
        return jnp.mean((q_1 - target) ** 2) + jnp.mean((q_2 - target) ** 2)

    return loss


def td3(unroll, stacked, keys, batch):
    twins, adam = Twins(unroll, stacked), optax.adam(RATE)
    net = partial(apply, unroll)

    def act(p, observation, history):
        return jnp.tanh(net(p, observation, *history))

    def update(state, batch, noise, with_actor):
        observation, history = following(batch)
        action = act(state["actor_target"], observation, history)
        action = jnp.clip(action + jnp.clip(0.2 * noise, -0.5, 0.5), -1, 1)
        value = jnp.minimum(*twins.values(state["critics_target"], observation, action, *history))
        target = batch["reward"] + DISCOUNT * batch["continues"] * value
        critics, adam_critics, loss = descend(critic_loss(twins, batch, target), state["critics"],
                                              state["adam_critics"], adam)
        state = {**state, "critics": critics, "adam_critics": adam_critics}
        if with_actor:
            observation, history = present(batch)

            def actor_loss(p):
                return -jnp.mean(twins.first(critics, observation, act(p, observation, history), *history))

            actor, adam_actor, _ = descend(actor_loss, state["actor"], state["adam_actor"], adam)
            state = {**state, "actor": actor, "adam_actor": adam_actor,
                     "actor_target": follow(state["actor_target"], actor),
                     "critics_target": follow(state["critics_target"], critics)}
        return state, loss

    actor, critics = network(keys[0], OBSERVATION, ACTION), twins.new(keys[1])
    copy = partial(jax.tree.map, jnp.copy)
    held = [dict(actor=actor, critics=critics, actor_target=copy(actor), critics_target=copy(critics),
                 adam_actor=adam.init(actor), adam_critics=adam.init(critics))]
    jitted = [jax.jit(partial(update, with_actor=i == 0), donate_argnums=0) for i in range(POLICY_DELAY)]
    noise = jax.random.normal(keys[2], (ROWS, ACTION))

    def updates():
        for function in jitted:
            held[0], loss = function(held[0], batch, noise)
            loss.block_until_ready()
        jax.block_until_ready(held[0])

    return median_seconds(updates) / POLICY_DELAY


def sac(unroll, stacked, keys, batch):
    twins, adam = Twins(unroll, stacked), optax.adam(RATE)
    net = partial(apply, unroll)

    def sample(p, noise, observation, history):
        mean, log_sd = jnp.split(net(p, observation, *history), 2, axis=1)
        log_sd = jnp.clip(log_sd, -20, 2)
        u = mean + jnp.exp(log_sd) * noise
        log_probability = -0.5 * noise**2 - log_sd - 0.5 * jnp.log(2 * jnp.pi)
        log_probability -= 2 * (jnp.log(2.0) - u - jax.nn.softplus(-2 * u))
        return jnp.tanh(u), log_probability.sum(axis=1)

    def update(state, batch, next_noise, noise):
        alpha = jnp.exp(state["log_alpha"])
        observation, history = following(batch)
        action, log_probability = sample(state["actor"], next_noise, observation, history)
        value = jnp.minimum(*twins.values(state["critics_target"], observation, action, *history))
        target = batch["reward"] + DISCOUNT * batch["continues"] * (value - alpha * log_probability)
        critics, adam_critics, loss = descend(critic_loss(twins, batch, target), state["critics"],
                                              state["adam_critics"], adam)
        observation, history = present(batch)

        def actor_loss(p):
            action, log_probability = sample(p, noise, observation, history)
            value = jnp.minimum(*twins.values(critics, observation, action, *history))
            return jnp.mean(alpha * log_probability - value), log_probability

        (_, log_probability), gradients = jax.value_and_grad(actor_loss, has_aux=True)(state["actor"])
        changes, adam_actor = adam.update(gradients, state["adam_actor"])
        surplus = jnp.mean(log_probability) - 1.0
        log_alpha, adam_alpha, _ = descend(lambda log_alpha: -log_alpha * surplus, state["log_alpha"],
                                           state["adam_alpha"], adam)
        return dict(actor=optax.apply_updates(state["actor"], changes), adam_actor=adam_actor, critics=critics,
                    adam_critics=adam_critics, critics_target=follow(state["critics_target"], critics),
                    log_alpha=log_alpha, adam_alpha=adam_alpha), loss

    actor, critics, log_alpha = network(keys[0], OBSERVATION, 2 * ACTION), twins.new(keys[1]), jnp.log(0.2)
    held = [dict(actor=actor, critics=critics, critics_target=jax.tree.map(jnp.copy, critics), log_alpha=log_alpha,
                 adam_actor=adam.init(actor), adam_critics=adam.init(critics), adam_alpha=adam.init(log_alpha))]
    jitted = jax.jit(update, donate_argnums=0)
    noise = jax.random.normal(keys[2], (2, ROWS, ACTION))

    def one():
        held[0], _ = jitted(held[0], batch, noise[0], noise[1])
        jax.block_until_ready(held[0])

    return median_seconds(one)


def draw(keys):
    """A batch with full histories."""
    steps = arguments.history
    shapes = dict(observation=(ROWS, OBSERVATION), next_observation=(ROWS, OBSERVATION), action=(ROWS, ACTION),
                  reward=(ROWS,), history=(steps, ROWS, OBSERVATION), next_history=(steps, ROWS, OBSERVATION))
    batch = {name: uniform(key, shape, 1) for key, (name, shape) in zip(keys, shapes.items())}
    lengths = jnp.full((ROWS,), steps)
    return {**batch, "continues": jnp.ones((ROWS,)), "lengths": lengths, "next_lengths": lengths}


for subject in arguments.subjects:
    keys = jax.random.split(jax.random.key(1), 9)
    batch = draw(keys[3:])
    measure = {"td3": td3, "sac": sac}[subject]
    variants = {f"{name}-unroll={unroll}": partial(measure, unroll, stacked, keys, batch)
                for name, stacked in [("twins", False), ("vmap", True)] for unroll in (1, arguments.history)}
    report(f"{subject}-update", "jax", arguments.threads, variants, history=arguments.history)
