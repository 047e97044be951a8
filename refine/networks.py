"""The generator and the critic (discriminator) of MM22's cGAN, in PyTorch (the extra `train`)."""

from itertools import pairwise

import torch
from torch import nn
from torch.nn import functional

from gesture_bot.base.keypoints import BONES, IN_ARM
from gesture_bot.corpus.database import SEQUENCE
from gesture_bot.refine.bounds import BOUNDS
from gesture_bot.speech.features import FEATURES

GESTURE = 3 * len(BONES)
"""Numbers of a frame of gesture: the vector of every bone."""

CONTROLS = 2 * BOUNDS
"""Numbers of a frame of control: the target of every bound, and whether there is one."""

CHANNELS = (128, 256, 256, 512)
"""Of the generator's blocks, in pairs (the authors' code)."""

CRITIC_CHANNELS = (512, 256, 128)
"""Of the critic's blocks, in pairs (the authors' code)."""

_ARMS = torch.tensor([float(IN_ARM[child]) for _, child in BONES]).repeat_interleave(3)[:, None]
"""(48, 1) 1 for the numbers of arm bones, 0 for those of others."""

SLOPE = 0.2
"""Of the leaky ReLU."""


def _scaled(channels: tuple[int, ...], width: float) -> list[int]:
    return [max(4, round(width * number)) for number in channels]


class _Convolution(nn.Conv1d):
    """Over three frames: those around each or, where it is not to see what comes, up to each."""

    def __init__(self, inputs: int, outputs: int, ahead: bool) -> None:
        super().__init__(inputs, outputs, 3)
        self._padding = (1, 1) if ahead else (2, 0)

    def forward(self, frames: torch.Tensor) -> torch.Tensor:
        return super().forward(functional.pad(frames, self._padding))


def _block(inputs: int, outputs: int, norm: type[nn.Module], ahead: bool) -> nn.Sequential:
    return nn.Sequential(_Convolution(inputs, outputs, ahead), norm(outputs), nn.LeakyReLU(SLOPE))


def _pair(inputs: int, outputs: int, norm: type[nn.Module], ahead: bool = False) -> nn.Sequential:
    return nn.Sequential(_block(inputs, outputs, norm, ahead), _block(outputs, outputs, norm, ahead))


class Generator(nn.Module):
    """From sound, and a gesture that the search found for it, to a gesture that goes with the sound.

    MM22's text: an encoder of 8 [convolution, batch norm, ReLU] blocks, pooled after every second one but the
    last, and a decoder of 8 that mirrors it, the last a bare convolution. As in the authors' code, not in
    the text: skip connections, leaky ReLU, average pooling. Our own: the gesture comes joined (smoothing.py),
    the last convolution starts at zero, and what it says is added to the gesture. So training starts from
    motion without jumps; the paper's generator first has to learn to repeat what was found. Convolutions look
    back: a frame sees no more of what comes than the rest of its window of 8, so that the last 8 frames of a
    sequence, which are shown, are those that the critic saw. It changes the arms alone: trunk and head move
    so little that all it adds there is noise. MM22 names it a limit that the network does not see the
    controls: here it can.

    Args:
        width: Share of the authors' channels.
        controls: Whether it sees them.
    """

    def __init__(self, width: float = 1.0, controls: bool = False) -> None:
        super().__init__()
        channels = _scaled(CHANNELS, width)
        sizes = pairwise([FEATURES + GESTURE + controls * CONTROLS, *channels])
        self.encoder = nn.ModuleList(_pair(*size, nn.BatchNorm1d) for size in sizes)
        self.bottom = _pair(channels[-1], channels[-1], nn.BatchNorm1d)
        sizes = pairwise(channels[::-1])
        self.decoder = nn.ModuleList(_pair(below + here, here, nn.BatchNorm1d) for below, here in sizes)
        self.decoder[-1][1] = last = _Convolution(channels[0], GESTURE, ahead=False)
        self.pool, self.upsample = nn.AvgPool1d(2), nn.Upsample(scale_factor=2)
        nn.init.zeros_(last.weight)
        nn.init.zeros_(last.bias)
        self.register_buffer("arms", _ARMS, persistent=False)

    def forward(self, heard: torch.Tensor, gesture: torch.Tensor) -> torch.Tensor:
        """(b, 28, t), or (b, 60, t) with controls, and (b, 48, t), z-scored -> (b, 48, t); t is 8 n."""
        hidden = torch.cat([heard, gesture], dim=1)
        skipped = []
        for pair in self.encoder[:-1]:
            hidden = pair(hidden)
            skipped.append(hidden)
            hidden = self.pool(hidden)
        hidden = self.bottom(self.encoder[-1](hidden))
        for pair in self.decoder:
            hidden = pair(torch.cat([self.upsample(hidden), skipped.pop()], dim=1))
        return gesture + self.arms * hidden


class Critic(nn.Module):
    """How real a gesture looks with its sound: MM22's discriminator.

    6 [convolution, instance norm, leaky ReLU] blocks, average pooling after every second, a linear layer.

    Our own, with `motion`: there is no norm, which hides from the critic where the hands are and how far they
    go, and beside the gesture it sees velocity and acceleration, each in deviations of real motion. Of the
    gesture, it sees the arms alone.

    Args:
        width: Share of the authors' channels.
        controls: Whether it sees them, as the generator does.
        motion: (2, 48) deviations of velocity and acceleration, a frame; None: as in the paper.
    """

    def __init__(
        self, width: float = 1.0, controls: bool = False, motion: torch.Tensor | None = None
    ) -> None:
        super().__init__()
        self.register_buffer("arms", _ARMS, persistent=False)
        self._motion = motion
        seen, norm = (GESTURE, nn.InstanceNorm1d) if motion is None else (3 * GESTURE, nn.Identity)
        channels = _scaled(CRITIC_CHANNELS, width)
        layers: list[nn.Module] = []
        for size in pairwise([FEATURES + controls * CONTROLS + seen, *channels]):
            layers += [_pair(*size, norm, ahead=True), nn.AvgPool1d(2)]
        frames = SEQUENCE // 2 ** len(channels)
        self.layers = nn.Sequential(*layers, nn.Flatten(), nn.Linear(frames * channels[-1], 1))

    def seen(self, gesture: torch.Tensor) -> torch.Tensor:
        """What it looks at: (b, 48, 64), z-scored -> (b, c, 64), linear."""
        gesture = self.arms * gesture
        if self._motion is None:
            return gesture
        changes = [
            functional.pad(gesture.diff(n=order), (order, 0)) / deviation[:, None]
            for order, deviation in enumerate(self._motion, 1)
        ]
        return torch.cat([gesture, *changes], dim=1)

    def forward(self, heard: torch.Tensor, seen: torch.Tensor) -> torch.Tensor:
        """(b, 28, 64), or (b, 60, 64) with controls, z-scored, and (b, c, 64), see `seen` -> (b,)."""
        return self.layers(torch.cat([heard, seen], dim=1))[:, 0]
