"""The rival of benches/forecast_rollout.rs in PyTorch, without gradients: eager, or compiled over cells that the
compiler sees through.

    python benches/rivals/forecast_rollout_torch.py [eager] [compiled] [--threads N]
"""

from functools import partial

from support import median_seconds, parse, report

arguments = parse(["eager", "compiled"])

import torch  # noqa: E402

from rollout_data import HISTORY, STEPS, ends, histories, load  # noqa: E402
from torch_nets import Forecaster  # noqa: E402

torch.set_num_threads(arguments.threads)

step_m, weights = load("pt")
observed = torch.tensor(histories(), dtype=torch.float64)


def roller(wrap, cells):
    model = Forecaster(64, [64], 2, cells=cells)
    model.load_state_dict(weights)
    model = wrap(model)

    @torch.no_grad()
    def roll_out():
        both = torch.cat([observed, observed.flip(1)])
        steps = (both.diff(dim=1) / step_m).float().transpose(0, 1)
        window = list(steps)
        for _ in range(STEPS):
            window.append(model(torch.stack(window[-(HISTORY - 1):]), None))
        way = torch.stack(window[HISTORY - 1:], dim=1).double() * step_m
        return both[:, -1:] + way.cumsum(dim=1)

    return roll_out


rollers = {"eager": roller(lambda model: model, False), "compiled": roller(torch.compile, True)}
report("forecast-rollout", "torch", arguments.threads,
       {name: partial(median_seconds, rollers[name]) for name in arguments.subjects},
       ends_m=ends(rollers["eager"]()[:, -1]))
