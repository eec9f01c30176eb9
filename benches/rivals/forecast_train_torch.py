"""The rival of benches/forecast_train.rs in PyTorch: eager and compiled, whichever is faster is reported.

    python benches/rivals/forecast_train_torch.py [open] [coastal] [--threads N]
"""

from functools import partial

from support import median_seconds, parse, report

arguments = parse(["open", "coastal"])

import torch  # noqa: E402
from torch import nn  # noqa: E402

from torch_nets import Forecaster  # noqa: E402

torch.set_num_threads(arguments.threads)
torch.manual_seed(1)

ROWS = 32
SUBJECTS = {
    "open": (9, dict(hidden=64, layers=[64], outputs=2)),
    "coastal": (74, dict(hidden=256, layers=[256, 256], outputs=20, activation=nn.functional.leaky_relu,
                         anchored=True)),
}


def measure(steps, sizes, wrap):
    net = Forecaster(**sizes)
    histories, anchors = torch.rand(steps, ROWS, 2) * 2 - 1, torch.rand(ROWS, 2) * 2 - 1
    targets = torch.rand(ROWS, sizes["outputs"]) * 2 - 1
    adam = torch.optim.Adam(net.parameters(), lr=1e-4, fused=True)

    @wrap
    def loss_of(histories, anchors, targets):
        return nn.functional.mse_loss(net(histories, anchors), targets)

    def iteration():
        adam.zero_grad(set_to_none=True)
        loss_of(histories, anchors, targets).backward()
        adam.step()

    return median_seconds(iteration)


for subject in arguments.subjects:
    steps, sizes = SUBJECTS[subject]
    report(f"forecast-train-{subject}", "torch", arguments.threads,
           {"eager": partial(measure, steps, sizes, lambda f: f),
            "compiled": partial(measure, steps, sizes, torch.compile)})
