"""The rival of benches/forecast_train.rs in PyTorch: eager and compiled, whichever is faster is reported.

    python benches/rivals/forecast_train_torch.py [open] [coastal] [--threads N]
"""

import argparse
import json
import time

parser = argparse.ArgumentParser()
parser.add_argument("subjects", nargs="*", default=["open", "coastal"])
parser.add_argument("--threads", type=int, default=1)
arguments = parser.parse_args()

import torch  # noqa: E402
from torch import nn  # noqa: E402

torch.set_num_threads(arguments.threads)
torch.manual_seed(1)

ROWS = 32


class Forecaster(nn.Module):
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


SUBJECTS = {
    "open": (9, dict(hidden=64, layers=[64], outputs=2, activation=nn.functional.relu, anchored=False)),
    "coastal": (74, dict(hidden=256, layers=[256, 256], outputs=20, activation=nn.functional.leaky_relu,
                         anchored=True)),
}


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


for subject in arguments.subjects:
    steps, sizes = SUBJECTS[subject]
    net = Forecaster(**sizes)
    histories, anchors = torch.rand(steps, ROWS, 2) * 2 - 1, torch.rand(ROWS, 2) * 2 - 1
    targets = torch.rand(ROWS, sizes["outputs"]) * 2 - 1
    adam = torch.optim.Adam(net.parameters(), lr=1e-4, fused=True)

    def loss_of(histories, anchors, targets):
        return nn.functional.mse_loss(net(histories, anchors), targets)

    def iteration(function):
        adam.zero_grad(set_to_none=True)
        function(histories, anchors, targets).backward()
        adam.step()

    variants = {"eager": loss_of, "compiled": torch.compile(loss_of)}
    results = {}
    for name, function in variants.items():
        try:
            results[name] = median_seconds(lambda: iteration(function))
        except Exception as error:  # a compiler that is not installed must not hide the eager result
            results[name] = None
            print(f"# {name}: {type(error).__name__}: {str(error)[:200]}", flush=True)
    best = min((value, name) for name, value in results.items() if value)
    print(json.dumps({"subject": f"forecast-train-{subject}", "who": f"torch-{best[1]}", "threads": arguments.threads,
                      "seconds": best[0], "variants": results}), flush=True)
