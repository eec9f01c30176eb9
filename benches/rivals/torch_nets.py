"""The networks of the agents and of the forecasters in PyTorch."""

import torch
from torch import nn


class Cells(nn.LSTM):
    """`nn.LSTM` of one layer as a loop that `torch.compile` sees through."""

    def forward(self, sequence):
        gates = sequence @ self.weight_ih_l0.T + (self.bias_ih_l0 + self.bias_hh_l0)
        h = c = torch.zeros(sequence.shape[1], self.hidden_size)
        states = []
        for step in range(sequence.shape[0]):
            sums = gates[step] if step == 0 else gates[step] + h @ self.weight_hh_l0.T
            i, f, g, o = sums.chunk(4, dim=1)
            c = torch.sigmoid(f) * c + torch.sigmoid(i) * torch.tanh(g)
            h = torch.sigmoid(o) * torch.tanh(c)
            states.append(h)
        return torch.stack(states), (h, c)


class Recurrent(nn.Module):
    """An actor or a critic: the current branch, the memory branch and their integration."""

    def __init__(self, inputs, observation, outputs, hidden, cells=False):
        super().__init__()
        self.current_1 = nn.Linear(inputs, hidden)
        self.current_2 = nn.Linear(hidden, hidden)
        self.memory_in = nn.Linear(observation, hidden)
        self.memory = (Cells if cells else nn.LSTM)(hidden, hidden)
        self.integrate_1 = nn.Linear(2 * hidden, hidden)
        self.integrate_2 = nn.Linear(hidden, outputs)

    def forward(self, current, history, lengths):
        x = torch.relu(self.current_2(torch.relu(self.current_1(current))))
        states, _ = self.memory(torch.relu(self.memory_in(history)))
        last = states[(lengths - 1).clamp(min=0), torch.arange(lengths.shape[0])]
        last = last * (lengths > 0).unsqueeze(1)
        return self.integrate_2(torch.relu(self.integrate_1(torch.cat([last, x], dim=1))))


class Forecaster(nn.Module):
    """An LSTM over past steps, then dense layers; the position is joined to its last state where anchored."""

    def __init__(self, hidden, layers, outputs, activation=torch.relu, anchored=False, cells=False):
        super().__init__()
        self.lstm = (Cells if cells else nn.LSTM)(2, hidden)
        sizes = [hidden + 2 * anchored, *layers, outputs]
        self.linear = nn.ModuleList(nn.Linear(a, b) for a, b in zip(sizes, sizes[1:]))
        self.activation = activation
        self.anchored = anchored

    def forward(self, histories, anchors):
        states, _ = self.lstm(histories)
        x = torch.cat([states[-1], anchors], dim=1) if self.anchored else states[-1]
        for layer in self.linear[:-1]:
            x = self.activation(layer(x))
        return self.linear[-1](x)
