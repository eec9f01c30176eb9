"""The rival of benches/act.rs: one decision of the actor in eager PyTorch, from a NumPy observation to a NumPy action.

    python benches/rivals/act_torch.py [--history L] [--threads N]
"""

from support import median_seconds, parse, report

arguments = parse(["act"], history=4)

import numpy as np  # noqa: E402
import torch  # noqa: E402

from torch_nets import Recurrent  # noqa: E402

torch.set_num_threads(arguments.threads)
torch.manual_seed(1)

OBSERVATION, ACTION, HIDDEN = 43, 1, 128
actor = Recurrent(OBSERVATION, OBSERVATION, ACTION, HIDDEN)
observation = np.random.default_rng(1).uniform(-1, 1, (1, OBSERVATION)).astype(np.float32)
history = np.random.default_rng(2).uniform(-1, 1, (arguments.history, 1, OBSERVATION)).astype(np.float32)
lengths = np.array([arguments.history])


@torch.inference_mode()
def act():
    return torch.tanh(actor(*(torch.from_numpy(x) for x in (observation, history, lengths)))).numpy()


report("act", "torch", arguments.threads, {"eager": lambda: median_seconds(act)}, history=arguments.history)
