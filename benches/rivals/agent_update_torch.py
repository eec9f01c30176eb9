"""The rival of benches/agent_update.rs in PyTorch: eager, and with its losses compiled, over `nn.LSTM` or over cells
that the compiler sees through; the fastest is reported.

    python benches/rivals/agent_update_torch.py [td3] [sac] [--history L] [--threads N]
"""

import copy
import math
from functools import partial

from support import median_seconds, parse, report

arguments = parse(["td3", "sac"], history=4)

import torch  # noqa: E402
from torch.nn.functional import mse_loss, softplus  # noqa: E402

from torch_nets import Recurrent  # noqa: E402

torch.set_num_threads(arguments.threads)
torch.manual_seed(1)

OBSERVATION, ACTION, HIDDEN, ROWS = 43, 1, 128, 32
DISCOUNT, RATE, TARGET_RATE, POLICY_DELAY = 0.99, 1e-4, 0.001, 2


def value_of(critic, observation, action, history, lengths):
    return critic(torch.cat([observation, action], dim=1), history, lengths).squeeze(1)


def present(batch):
    return batch["observation"], batch["history"], batch["lengths"]


def following(batch):
    return batch["next_observation"], batch["next_history"], batch["next_lengths"]


def follow(target, online):
    torch._foreach_lerp_(list(target.parameters()), list(online.parameters()), TARGET_RATE)


def least(critics, observation, action, history, lengths):
    return torch.min(*(value_of(critic, observation, action, history, lengths) for critic in critics))


def critic_loss(critics, batch, target):
    observation, history, lengths = present(batch)
    return sum(mse_loss(value_of(critic, observation, batch["action"], history, lengths), target)
               for critic in critics)


def descend(adam, loss):
    adam.zero_grad(set_to_none=True)
    loss.backward()
    adam.step()


def build(outputs, cells):
    actor = Recurrent(OBSERVATION, OBSERVATION, outputs, HIDDEN, cells)
    critics = torch.nn.ModuleList(
        Recurrent(OBSERVATION + ACTION, OBSERVATION, 1, HIDDEN, cells) for _ in range(2))
    adams = [torch.optim.Adam(net.parameters(), lr=RATE, fused=True) for net in (actor, critics)]
    return actor, critics, copy.deepcopy(actor), copy.deepcopy(critics), adams


def td3(wrap, cells, batch):
    actor, critics, actor_target, critics_target, (adam_actor, adam_critics) = build(ACTION, cells)
    noise = torch.randn(ROWS, ACTION)

    @wrap
    def target_value(batch, noise):
        action = torch.tanh(actor_target(*following(batch)))
        action = (action + (0.2 * noise).clamp(-0.5, 0.5)).clamp(-1, 1)
        observation, history, lengths = following(batch)
        value = least(critics_target, observation, action, history, lengths)
        return batch["reward"] + DISCOUNT * batch["continues"] * value

    @wrap
    def actor_loss(batch):
        observation, history, lengths = present(batch)
        action = torch.tanh(actor(observation, history, lengths))
        return -value_of(critics[0], observation, action, history, lengths).mean()

    loss_of_critics = wrap(partial(critic_loss, critics))

    def updates():
        for update in range(POLICY_DELAY):
            with torch.no_grad():
                target = target_value(batch, noise)
            descend(adam_critics, loss_of_critics(batch, target))
            if update == 0:
                critics.requires_grad_(False)
                descend(adam_actor, actor_loss(batch))
                critics.requires_grad_(True)
                with torch.no_grad():
                    follow(actor_target, actor)
                    follow(critics_target, critics)

    return median_seconds(updates) / POLICY_DELAY


def sample(actor, noise, observation, history, lengths):
    mean, log_sd = actor(observation, history, lengths).chunk(2, dim=1)
    log_sd = log_sd.clamp(-20, 2)
    unsquashed = mean + log_sd.exp() * noise
    log_probability = -0.5 * noise**2 - log_sd - 0.5 * math.log(2 * math.pi)
    log_probability = log_probability - 2 * (math.log(2) - unsquashed - softplus(-2 * unsquashed))
    return torch.tanh(unsquashed), log_probability.sum(dim=1)


def sac(wrap, cells, batch):
    actor, critics, _, critics_target, (adam_actor, adam_critics) = build(2 * ACTION, cells)
    log_alpha = torch.tensor(math.log(0.2), requires_grad=True)
    adam_alpha = torch.optim.Adam([log_alpha], lr=RATE)
    next_noise, noise = torch.randn(ROWS, ACTION), torch.randn(ROWS, ACTION)

    @wrap
    def target_value(batch, noise, alpha):
        observation, history, lengths = following(batch)
        action, log_probability = sample(actor, noise, observation, history, lengths)
        value = least(critics_target, observation, action, history, lengths) - alpha * log_probability
        return batch["reward"] + DISCOUNT * batch["continues"] * value

    @wrap
    def actor_loss(batch, noise, alpha):
        observation, history, lengths = present(batch)
        action, log_probability = sample(actor, noise, observation, history, lengths)
        value = least(critics, observation, action, history, lengths)
        return (alpha * log_probability - value).mean(), log_probability.mean()

    loss_of_critics = wrap(partial(critic_loss, critics))

    def one():
        alpha = log_alpha.detach().exp()
        with torch.no_grad():
            target = target_value(batch, next_noise, alpha)
        descend(adam_critics, loss_of_critics(batch, target))
        critics.requires_grad_(False)
        loss, log_probability = actor_loss(batch, noise, alpha)
        descend(adam_actor, loss)
        critics.requires_grad_(True)
        descend(adam_alpha, -log_alpha * (log_probability.detach() - 1.0))
        with torch.no_grad():
            follow(critics_target, critics)

    return median_seconds(one)


def draw():
    """A batch with full histories."""
    steps = arguments.history
    shapes = dict(observation=(ROWS, OBSERVATION), next_observation=(ROWS, OBSERVATION), action=(ROWS, ACTION),
                  reward=(ROWS,), history=(steps, ROWS, OBSERVATION), next_history=(steps, ROWS, OBSERVATION))
    batch = {name: torch.rand(shape) * 2 - 1 for name, shape in shapes.items()}
    lengths = torch.full((ROWS,), steps)
    return {**batch, "continues": torch.ones(ROWS), "lengths": lengths, "next_lengths": lengths}


for subject in arguments.subjects:
    measure, batch = {"td3": td3, "sac": sac}[subject], draw()
    variants = {"eager": partial(measure, lambda f: f, False, batch),
                "compiled": partial(measure, torch.compile, False, batch),
                "compiled-cells": partial(measure, torch.compile, True, batch)}
    report(f"{subject}-update", "torch", arguments.threads, variants, history=arguments.history)
