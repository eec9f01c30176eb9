"""Makes nn_*.safetensors: what PyTorch computes in f64 for small forecaster networks.

Each file holds a network's initial weights (`before.`), a batch, its forward pass, loss and gradients, and the
weights after each of ten Adam steps (`after.1.` to `after.10.`) on that batch.

    pip install torch safetensors numpy
    python tests/golden/make_nn.py
"""

from pathlib import Path

import torch
from safetensors.torch import save_file
from torch import nn

torch.set_default_dtype(torch.float64)
HERE = Path(__file__).parent
LEARNING_RATE = 1e-3


class Forecaster(nn.Module):
    """LSTM over displacements; its last state, joined by the position, through dense layers."""

    def __init__(self, hidden, layers, outputs, activation, anchored):
        super().__init__()
        self.lstm = nn.LSTM(2, hidden)
        sizes = [hidden + 2 * anchored, *layers, outputs]
        self.linear = nn.ModuleList(nn.Linear(a, b) for a, b in zip(sizes, sizes[1:]))
        self.activation = activation
        self.anchored = anchored

    def forward(self, histories, anchors):
        _, (last, _) = self.lstm(histories)
        x = torch.cat([last[0], anchors], dim=1) if self.anchored else last[0]
        for layer in self.linear[:-1]:
            x = self.activation(layer(x))
        return self.linear[-1](x)


def make(name, seed, steps, rows, after, **sizes):
    torch.manual_seed(seed)
    net = Forecaster(**sizes)
    histories, anchors = torch.randn(steps, rows, 2), torch.randn(rows, 2)
    targets = torch.randn(rows, sizes["outputs"])
    tensors = {"histories": histories, "anchors": anchors, "targets": targets}

    def keep(prefix, items):
        tensors.update({prefix + key: value.detach().clone() for key, value in items})

    keep("before.", net.named_parameters())
    adam = torch.optim.Adam(net.parameters(), lr=LEARNING_RATE)
    for step in range(1, 11):
        adam.zero_grad()
        predictions = net(histories, anchors)
        loss = nn.functional.mse_loss(predictions, targets)
        loss.backward()
        keep("", [(f"loss.{step}", loss.reshape(1))])
        if step == 1:
            keep("", [("predictions", predictions)])
            keep("gradient.", ((key, p.grad) for key, p in net.named_parameters()))
        adam.step()
        if step in after:
            keep(f"after.{step}.", net.named_parameters())
    save_file(tensors, HERE / f"nn_{name}.safetensors")


def make_ragged(seed, steps, rows, inputs, hidden):
    """A dense layer, an LSTM over histories of different lengths (none at all for one row), its last valid state."""
    torch.manual_seed(seed)
    dense, lstm = nn.Linear(inputs, hidden), nn.LSTM(hidden, hidden)
    lengths = torch.tensor([0, steps, 1, *torch.randint(1, steps + 1, (rows - 3,)).tolist()])
    x = torch.randn(steps, rows, inputs) * (torch.arange(steps)[:, None] < lengths)[:, :, None]
    x.requires_grad_()
    states, _ = lstm(torch.relu(dense(x)))
    last = torch.stack([states[n - 1, row] if n else torch.zeros(hidden) for row, n in enumerate(lengths)])
    weight = torch.randn(rows, hidden)
    (last * weight).sum().backward()
    named = [("dense." + k, p) for k, p in dense.named_parameters()]
    named += [("lstm." + k, p) for k, p in lstm.named_parameters()]
    tensors = {"x": x, "lengths": lengths.to(torch.float64), "last": last, "d_last": weight, "d_x": x.grad}
    tensors.update({"before." + k: p for k, p in named})
    tensors.update({"gradient." + k: p.grad for k, p in named})
    save_file({k: v.detach().clone() for k, v in tensors.items()}, HERE / "nn_ragged.safetensors")


make("open_water", 1, 9, 8, range(1, 11), hidden=12, layers=[12], outputs=2,
     activation=nn.functional.relu, anchored=False)
make("coastal", 2, 20, 6, range(1, 11), hidden=20, layers=[20, 18], outputs=20,
     activation=nn.functional.leaky_relu, anchored=True)
make("open_water_full", 3, 9, 32, [10], hidden=64, layers=[64], outputs=2,
     activation=nn.functional.relu, anchored=False)
make_ragged(4, 5, 7, 11, 24)
