"""Makes rl_td3.safetensors and rl_sac.safetensors: what PyTorch computes in f64 for a few updates of LSTM-TD3 and
LSTM-SAC on small networks.

Each file holds the initial weights (`before.`), one batch with ragged histories, and per update the noise, the losses,
every gradient, and the weights and targets after it (`1.` and so on).

    pip install torch safetensors numpy
    python tests/golden/make_rl.py
"""

import copy
import math
from pathlib import Path

import torch
from safetensors.torch import save_file
from torch import nn
from torch.nn.functional import mse_loss, softplus

torch.set_default_dtype(torch.float64)
HERE = Path(__file__).parent
OBSERVATION, ACTION, HIDDEN, STEPS, ROWS, UPDATES = 5, 2, 8, 3, 6, 3
# Rates at which a step changes f32 weights by far more than their rounding.
DISCOUNT, RATE, TARGET_RATE = 0.99, 1e-3, 0.5


class Recurrent(nn.Module):
    def __init__(self, inputs, outputs):
        super().__init__()
        self.current_1 = nn.Linear(inputs, HIDDEN)
        self.current_2 = nn.Linear(HIDDEN, HIDDEN)
        self.memory_in = nn.Linear(OBSERVATION, HIDDEN)
        self.memory = nn.LSTM(HIDDEN, HIDDEN)
        self.integrate_1 = nn.Linear(2 * HIDDEN, HIDDEN)
        self.integrate_2 = nn.Linear(HIDDEN, outputs)

    def forward(self, current, history, lengths):
        x = torch.relu(self.current_2(torch.relu(self.current_1(current))))
        states, _ = self.memory(torch.relu(self.memory_in(history)))
        last = states[(lengths - 1).clamp(min=0), torch.arange(ROWS)]
        last = last * (lengths > 0).unsqueeze(1)
        joined = torch.cat([last, x], dim=1)
        return self.integrate_2(torch.relu(self.integrate_1(joined)))


def critic_value(critic, observation, action, history, lengths):
    return critic(torch.cat([observation, action], dim=1), history, lengths).squeeze(1)


def draw_batch():
    def history():
        lengths = torch.randint(0, STEPS + 1, (ROWS,))
        steps = torch.randn(STEPS, ROWS, OBSERVATION)
        valid = torch.arange(STEPS).unsqueeze(1) < lengths
        return steps * valid.unsqueeze(2), lengths

    past, past_lengths = history()
    past_lengths[0] = 0
    past[:, 0] = 0
    next_past, next_lengths = history()
    return {
        "observation": torch.randn(ROWS, OBSERVATION),
        "action": torch.rand(ROWS, ACTION) * 2 - 1,
        "reward": torch.randn(ROWS),
        "continues": torch.tensor([1.0, 1.0, 0.0, 1.0, 1.0, 1.0]),
        "next_observation": torch.randn(ROWS, OBSERVATION),
        "history": past,
        "history_lengths": past_lengths,
        "next_history": next_past,
        "next_history_lengths": next_lengths,
    }


class Golden:
    def __init__(self, batch):
        self.tensors = {"batch." + key: value.clone() for key, value in batch.items()}

    def keep(self, prefix, items):
        self.tensors.update({prefix + key: value.detach().clone().contiguous() for key, value in items})

    def weights(self, prefix, networks):
        for name, network in networks.items():
            self.keep(f"{prefix}{name}.", network.named_parameters())

    def gradients(self, prefix, network):
        self.keep(f"{prefix}", ((key, p.grad) for key, p in network.named_parameters()))

    def numbers(self, prefix, **numbers):
        self.keep(prefix, ((key, torch.as_tensor(value).reshape(1)) for key, value in numbers.items()))

    def save(self, name):
        save_file(self.tensors, HERE / f"{name}.safetensors")


def follow(target, online):
    with torch.no_grad():
        for p, q in zip(target.parameters(), online.parameters()):
            p.mul_(1 - TARGET_RATE).add_(TARGET_RATE * q)


def learn_critics(golden, prefix, critics, adams, batch, target):
    for index, (critic, adam) in enumerate(zip(critics, adams), 1):
        loss = mse_loss(critic_value(critic, *present(batch)), target)
        adam.zero_grad()
        loss.backward()
        golden.gradients(f"{prefix}gradient.critic_{index}.", critic)
        golden.numbers(prefix, **{f"loss.critic_{index}": loss})
        adam.step()


def present(batch):
    return batch["observation"], batch["action"], batch["history"], batch["history_lengths"]


def build(outputs):
    actor = Recurrent(OBSERVATION, outputs)
    critics = [Recurrent(OBSERVATION + ACTION, 1) for _ in range(2)]
    adams = [torch.optim.Adam(network.parameters(), lr=RATE) for network in [actor, *critics]]
    return actor, critics, copy.deepcopy(actor), copy.deepcopy(critics), adams


def named(actor, critics, actor_target, critic_targets):
    networks = {"actor": actor, "critic_1": critics[0], "critic_2": critics[1]}
    networks |= {"critic_1_target": critic_targets[0], "critic_2_target": critic_targets[1]}
    return networks | ({"actor_target": actor_target} if actor_target else {})


def td3():
    torch.manual_seed(1)
    batch = draw_batch()
    golden = Golden(batch)
    actor, critics, actor_target, critic_targets, adams = build(ACTION)
    networks = named(actor, critics, actor_target, critic_targets)
    golden.weights("before.", networks)
    past, lengths = batch["history"], batch["history_lengths"]
    following = batch["next_observation"], batch["next_history"], batch["next_history_lengths"]
    for update in range(UPDATES):
        prefix = f"{update + 1}."
        noise = torch.randn(ROWS, ACTION)
        golden.keep(prefix, [("noise", noise)])
        with torch.no_grad():
            proposed = torch.tanh(actor_target(*following))
            next_action = (proposed + (0.2 * noise).clamp(-0.5, 0.5)).clamp(-1, 1)
            values = [critic_value(c, following[0], next_action, *following[1:]) for c in critic_targets]
            target = batch["reward"] + DISCOUNT * batch["continues"] * torch.min(*values)
        learn_critics(golden, prefix, critics, adams[1:], batch, target)
        if update % 2 == 0:
            action = torch.tanh(actor(batch["observation"], past, lengths))
            loss = -critic_value(critics[0], batch["observation"], action, past, lengths).mean()
            adams[0].zero_grad()
            loss.backward()
            golden.gradients(f"{prefix}gradient.actor.", actor)
            golden.numbers(prefix, **{"loss.actor": loss})
            adams[0].step()
            follow(actor_target, actor)
            for pair in zip(critic_targets, critics):
                follow(*pair)
        golden.weights(f"{prefix}after.", networks)
    golden.save("rl_td3")


def sample(actor, noise, observation, history, lengths):
    mean, log_sd = actor(observation, history, lengths).chunk(2, dim=1)
    log_sd = log_sd.clamp(-20, 2)
    unsquashed = mean + log_sd.exp() * noise
    log_probability = -0.5 * noise**2 - log_sd - 0.5 * math.log(2 * math.pi)
    log_probability = log_probability - 2 * (math.log(2) - unsquashed - softplus(-2 * unsquashed))
    return torch.tanh(unsquashed), log_probability.sum(dim=1)


def sac():
    torch.manual_seed(2)
    batch = draw_batch()
    golden = Golden(batch)
    actor, critics, _, critic_targets, adams = build(2 * ACTION)
    networks = named(actor, critics, None, critic_targets)
    with torch.no_grad():
        # One row's standard deviation lies beyond the clamp, where no gradient may pass.
        actor.integrate_2.bias[ACTION] = 2.02
    golden.weights("before.", networks)
    log_alpha = torch.tensor(math.log(0.2), requires_grad=True)
    temperature_adam = torch.optim.Adam([log_alpha], lr=RATE)
    past, lengths = batch["history"], batch["history_lengths"]
    following = batch["next_observation"], batch["next_history"], batch["next_history_lengths"]
    for update in range(UPDATES):
        prefix = f"{update + 1}."
        next_noise, noise = torch.randn(ROWS, ACTION), torch.randn(ROWS, ACTION)
        golden.keep(prefix, [("next_noise", next_noise), ("noise", noise)])
        alpha = log_alpha.exp().detach()
        with torch.no_grad():
            next_action, log_probability = sample(actor, next_noise, *following)
            values = [critic_value(c, following[0], next_action, *following[1:]) for c in critic_targets]
            value = torch.min(*values) - alpha * log_probability
            target = batch["reward"] + DISCOUNT * batch["continues"] * value
        learn_critics(golden, prefix, critics, adams[1:], batch, target)

        action, log_probability = sample(actor, noise, batch["observation"], past, lengths)
        values = [critic_value(c, batch["observation"], action, past, lengths) for c in critics]
        loss = (alpha * log_probability - torch.min(*values)).mean()
        adams[0].zero_grad()
        loss.backward()
        golden.gradients(f"{prefix}gradient.actor.", actor)
        adams[0].step()

        temperature_loss = -log_alpha * (log_probability.detach() - 1.0).mean()
        temperature_adam.zero_grad()
        temperature_loss.backward()
        temperature_adam.step()
        for pair in zip(critic_targets, critics):
            follow(*pair)
        golden.numbers(
            prefix,
            **{"loss.actor": loss, "loss.temperature": temperature_loss, "temperature": log_alpha.detach().exp()},
        )
        golden.weights(f"{prefix}after.", networks)
    golden.save("rl_sac")


if __name__ == "__main__":
    td3()
    sac()
