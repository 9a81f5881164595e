"""The networks of `networks.py` and their training, with torch on one processor core."""

import math
import time
from dataclasses import dataclass

import numpy as np
import torch
from torch import nn

KERNEL = 3
BATCH, MOST_EPOCHS = 128, 120
RATE, SLOWER, PATIENCE = 2e-3, 0.3, 4
"""Learning rate of Adam; its factor when the validation loss has not fallen for so many epochs."""

STOP = 12
"""Epochs without a lower validation loss after which training ends."""


class Perceptron(nn.Module):
    """Two hidden layers over all lags."""

    def __init__(self, channels, past, width, outputs):
        super().__init__()
        hidden = nn.Linear(channels * past, width), nn.ReLU(), nn.Linear(width, width), nn.ReLU()
        self.layers, self.head = nn.Sequential(nn.Flatten(), *hidden), nn.Linear(width, outputs)

    def forward(self, inputs):
        """Outputs (N, outputs) of lags (N, past, channels)."""
        return self.head(self.layers(inputs))


class CausalConvolutions(nn.Module):
    """Residual causal convolutions whose dilation doubles until they reach all of the past (Bai et al. 2018).

    A layer is computed only where the output at the stamp reads it: time runs backwards from the stamp, and each
    stride of two doubles the dilation.
    """

    def __init__(self, channels, past, width, outputs):
        super().__init__()
        self.first, self.head = nn.Conv1d(channels, width, 1), nn.Linear(width, outputs)
        count = math.ceil(math.log2((past - 1) / (KERNEL - 1) + 1))
        self.layers = nn.ModuleList(nn.Conv1d(width, width, KERNEL, stride=2) for _ in range(count))

    def forward(self, inputs):
        """Outputs (N, outputs) of lags (N, past, channels)."""
        values = self.first(inputs.flip(1).transpose(1, 2))
        for layer in self.layers:
            padded = nn.functional.pad(values, (0, KERNEL - 1))
            found = layer(padded).relu()
            values = padded[:, :, : 2 * found.shape[2] : 2] + found
        return self.head(values[:, :, 0])


class Recurrent(nn.Module):
    """One layer of long short-term memory, read at the stamp."""

    def __init__(self, channels, past, width, outputs):
        super().__init__()
        self.memory, self.head = nn.LSTM(channels, width, batch_first=True), nn.Linear(width, outputs)

    def forward(self, inputs):
        """Outputs (N, outputs) of lags (N, past, channels)."""
        return self.head(self.memory(inputs)[0][:, -1])


KINDS = {'MLP': Perceptron, 'TCN': CausalConvolutions, 'LSTM': Recurrent}


@dataclass(frozen=True)
class Trained:
    """A network with the weights of its least validation loss."""

    network: nn.Module
    seconds: float  #: Of processor time.

    @property
    def parameters(self):
        """How many were learnt."""
        return sum(parameter.numel() for parameter in self.network.parameters())

    def outputs(self, inputs):
        """Outputs (N, outputs) of scaled lags (N, past, channels)."""
        return _in_parts(self.network, _tensor(inputs)).double().numpy()


def train(kind, width, seed, training, validation):
    """Train by Adam on the mean square error, and stop early.

    Parameters
    ----------
    kind : str
        Of `KINDS`.
    width : int
        Of the hidden layers.
    seed : int
        Of the weights and the order of the samples.
    training, validation : tuple of ndarray
        Scaled inputs, shape (N, past, channels), and scaled targets, shape (N, outputs).
    """
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    begun = time.process_time()
    (inputs, targets), (unseen, expected) = (tuple(_tensor(part) for part in each) for each in (training, validation))
    network = KINDS[kind](inputs.shape[2], inputs.shape[1], width, targets.shape[1])
    nn.init.zeros_(network.head.weight)
    nn.init.zeros_(network.head.bias)
    optimiser = torch.optim.Adam(network.parameters(), RATE)
    schedule = torch.optim.lr_scheduler.ReduceLROnPlateau(optimiser, factor=SLOWER, patience=PATIENCE)
    least, best, kept = math.inf, 0, network.state_dict()
    for epoch in range(MOST_EPOCHS):
        loss = float(nn.functional.mse_loss(_in_parts(network, unseen), expected))
        schedule.step(loss)
        if loss < least:
            least, best = loss, epoch
            kept = {name: values.clone() for name, values in network.state_dict().items()}
        if epoch - best >= STOP:
            break
        for rows in torch.randperm(inputs.shape[0]).split(BATCH):
            optimiser.zero_grad()
            nn.functional.mse_loss(network(inputs[rows]), targets[rows]).backward()
            optimiser.step()
    network.load_state_dict(kept)
    return Trained(network, time.process_time() - begun)


def _tensor(values):
    return torch.from_numpy(np.ascontiguousarray(values, np.float32))


def _in_parts(network, inputs):
    with torch.no_grad():
        return torch.cat([network(part) for part in inputs.split(8 * BATCH)])
