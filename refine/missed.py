"""By how much gestures miss the bounds that the controls set, in PyTorch, so that a network can learn it."""

import torch
from torch import nn
from torch.nn import functional

from gesture_bot.base.frames import FRAME_RATE, WINDOW
from gesture_bot.base.keypoints import BONES, INDEX, WRISTS
from gesture_bot.refine.bounds import BOUNDS
from gesture_bot.refine.model import Card


class Missed(nn.Module):
    """The mean of what is missing to the bounds, in deviations of each number.

    Args:
        card: Of the network; its scales.
    """

    def __init__(self, card: Card) -> None:
        super().__init__()
        chains = torch.zeros(len(WRISTS), len(BONES))
        for wrist, chain in zip(WRISTS, chains, strict=True):
            child = wrist
            while child != INDEX["pelvis"]:
                (bone,) = (number for number, (_, end) in enumerate(BONES) if end == child)
                chain[bone], child = 1, BONES[bone][0]
        self.register_buffer("chains", chains)
        for name in ("bone_mean", "bone_deviation", "quantity_mean", "quantity_deviation"):
            self.register_buffer(name, torch.tensor(getattr(card, name)))

    def forward(self, gesture: torch.Tensor, controls: torch.Tensor) -> torch.Tensor:
        """Of z-scored gestures (b, 48, t) and controls (b, 32, t); 0 where there are none."""
        targets, mask = controls.split(BOUNDS, dim=1)
        measured = (self.measured(gesture) - self.quantity_mean[:, None]) / self.quantity_deviation[:, None]
        least, most = targets.chunk(2, dim=1)
        missed = functional.relu(torch.cat([least - measured, measured - most], dim=1))
        return (missed * mask).sum() / mask.sum().clamp_min(1)

    def measured(self, gesture: torch.Tensor) -> torch.Tensor:
        """The numbers of bounds.MEASURED of z-scored gestures: (b, 48, t) -> (b, 8, t) [m, m/s].

        As in matching/quantities.py, but that bones may still have other lengths.
        """
        vectors = gesture.unflatten(1, (len(BONES), 3)) * self.bone_deviation[..., None]
        wrists = torch.einsum("wb,nbct->nwct", self.chains, vectors + self.bone_mean[..., None])
        height, across = wrists[:, :, 2], wrists[:, :, :2].norm(dim=2)
        steps = wrists.diff(dim=-1).norm(dim=2) * FRAME_RATE
        # A frame at an end has fewer steps around it.
        speed, counted = (
            functional.avg_pool1d(functional.pad(one, (WINDOW // 2, WINDOW // 2)), WINDOW, stride=1)
            for one in (steps, torch.ones_like(steps))
        )
        apart = wrists[:, 0] - wrists[:, 1]
        return torch.cat(
            [height, speed / counted, apart[:, 2:].abs(), across, apart.norm(dim=1, keepdim=True)], dim=1
        )
