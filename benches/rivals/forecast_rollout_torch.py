"""The rival of benches/forecast_rollout.rs in PyTorch, eager, without gradients.

    python benches/rivals/forecast_rollout_torch.py [--threads N]
"""

import argparse
import json
import math
import time

parser = argparse.ArgumentParser()
parser.add_argument("--threads", type=int, default=1)
arguments = parser.parse_args()

import torch  # noqa: E402
from safetensors import safe_open  # noqa: E402
from torch import nn  # noqa: E402

torch.set_num_threads(arguments.threads)

MODEL = "models/open-water-stochastic.safetensors"
OBSTACLES, HISTORY, STEPS = 10, 10, 100


class Forecaster(nn.Module):
    def __init__(self):
        super().__init__()
        self.lstm = nn.LSTM(2, 64)
        self.linear = nn.ModuleList([nn.Linear(64, 64), nn.Linear(64, 2)])

    def forward(self, histories):
        _, (last, _) = self.lstm(histories)
        return self.linear[1](torch.relu(self.linear[0](last[0])))


def history(obstacle):
    speed = 5.0 + 2.0 * obstacle
    angles = [0.05 * k + 0.3 * obstacle for k in range(HISTORY)]
    return [[speed * k * math.cos(a), speed * k * math.sin(a)] for k, a in enumerate(angles)]


with safe_open(MODEL, "pt") as file:
    step_m = json.loads(file.metadata()["config"])["training"]["scaling"]["step_m"]
    model = Forecaster()
    model.load_state_dict({name: file.get_tensor(name) for name in file.keys()})
observed = torch.tensor([history(i) for i in range(OBSTACLES)], dtype=torch.float64)


@torch.inference_mode()
def roll_out():
    both = torch.cat([observed, observed.flip(1)])
    steps = (both.diff(dim=1) / step_m).float().transpose(0, 1)
    window = list(steps)
    for _ in range(STEPS):
        window.append(model(torch.stack(window[-(HISTORY - 1):])))
    way = torch.stack(window[HISTORY - 1:], dim=1).double() * step_m
    return both[:, -1:] + way.cumsum(dim=1)


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


ends = roll_out()[:, -1]
print(json.dumps({"subject": "forecast-rollout", "who": "torch-eager", "threads": arguments.threads,
                  "seconds": median_seconds(roll_out), "ends_m": [*ends[0].tolist(), *ends[OBSTACLES].tolist()]}))
