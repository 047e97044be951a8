"""One iteration of MM22's training: a Wasserstein GAN with gradient penalty, in PyTorch."""

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import distributed, nn
from torch.optim import swa_utils

from gesture_bot.base.errors import TrainingError
from gesture_bot.corpus.database import SEQUENCE
from gesture_bot.refine.missed import Missed
from gesture_bot.refine.networks import Critic, Generator

W_FOUND, W_ADVERSARIAL = 0.1, 1.0
"""Weights of the losses (MM22)."""

W_MISSED = 10.0
"""Weight of what a gesture misses a bound by; as strong then as the critic."""

BETAS = (0.0, 0.9)
"""Of Adam (MM22's code)."""

AVERAGED = 0.999
"""The generator that is kept is a moving average of those trained; at each step, so much of it stays at most.

Not in the paper; see Yazici et al. 2019, The Unusual Effectiveness of Averaging in GAN Training.
"""

STEERED = 2
"""Which of the gestures that were found is found under controls; see pairs.Walk."""

SLOWEST = 1e-3
"""Velocities and accelerations that hardly differ count as differing so much [deviations a frame]."""

LARGEST_GRADIENT = 1e6
"""A gradient with a larger norm is divergence."""


@dataclass(frozen=True)
class Recipe:
    """How the networks are trained.

    Attributes:
        rate: Of Adam.
        penalty: Weight of the gradient penalty.
        critic_steps: Iterations from one step of the generator to the next.
        critic_share: Share of the critic's channels, beside the width.
        motion: Whether the critic sees velocity and acceleration, and no norm; see networks.Critic.
        controls: Whether the networks see the controls, and learn to keep to them.
    """

    rate: float
    penalty: float
    critic_steps: int
    critic_share: float
    motion: bool
    controls: bool


RECIPES = {
    "paper": Recipe(1e-4, penalty=100, critic_steps=5, critic_share=1, motion=False, controls=False),
    "light": Recipe(1e-4, penalty=100, critic_steps=3, critic_share=0.5, motion=True, controls=False),
    "steered": Recipe(1e-4, penalty=100, critic_steps=3, critic_share=0.5, motion=True, controls=True),
}
"""MM22 (critic steps: the authors' code); one for a processor; and that with controls."""


class Gan:
    """Generator, critic, and their optimisers.

    An iteration's batch depends on seed and number of the iteration alone, so that training that goes on from
    a checkpoint draws what it would have drawn.

    Args:
        sound: (n, 28) z-scored features.
        gesture: (n, 48) z-scored bone vectors of the same frames.
        found: (3, n, 48) what the search found for them; see pairs.Walk.
        controls: (n, 32) under which it found the third of these, which the gesture keeps.
        missed: Tells by how much gestures miss them; see missed.Missed.
        starts: (w,) first frames of windows of what was found.
        later: (w,) how many frames later at most a window of real motion, with its sound, may start: there
            are so many more of them.
        recipe: Name in RECIPES.
        width: Share of the authors' channels.
        batch: Windows in a batch, of each process.
        seed: Of weights and batches.
    """

    def __init__(
        self, sound: np.ndarray, gesture: np.ndarray, found: np.ndarray, controls: np.ndarray,
        missed: Missed, starts: np.ndarray, later: np.ndarray, recipe: str, width: float, batch: int,
        seed: int,
    ) -> None:  # fmt: skip
        torch.manual_seed(seed)
        self._rank = distributed.get_rank() if distributed.is_initialized() else 0
        self._device = torch.device("cpu")
        if torch.cuda.is_available():
            self._device = torch.device("cuda", int(os.environ.get("LOCAL_RANK", 0)))  # of torchrun
            torch.cuda.set_device(self._device)
            torch.backends.cudnn.deterministic = True
        self._sound, self._gesture, self._found, self._controls = (
            self._tensor(rows) for rows in (sound, gesture, found, controls)
        )
        self._missed = missed.to(self._device)
        self._windows, self._later = starts[:, None] + np.arange(SEQUENCE), later
        self._recipe, self._batch, self._seed = RECIPES[recipe], batch, seed
        real = self._gesture[self._tensor(self._windows)]
        motion = torch.stack([real.diff(n=order, dim=1).std(dim=(0, 1)) for order in (1, 2)])
        motion = motion.clamp_min(SLOWEST) if self._recipe.motion else None
        steered = self._recipe.controls
        self.generator = Generator(width, steered).to(self._device)
        self.critic = Critic(width * self._recipe.critic_share, steered, motion).to(self._device)
        self.averaged = swa_utils.AveragedModel(self.generator, avg_fn=_average, use_buffers=True).eval()
        self._adams = [
            torch.optim.Adam(network.parameters(), self._recipe.rate, BETAS)
            for network in (self.generator, self.critic)
        ]

    def step(self, iteration: int) -> dict[str, float]:
        """Train the critic once and, in every CRITIC_STEPS-th iteration, the generator.

        Args:
            iteration: Its number, from 1.

        Returns:
            Losses by name; those of the generator only where it was trained.

        Raises:
            TrainingError: The training has diverged; the networks are no good any more.
        """
        random = np.random.default_rng([self._seed, self._rank, iteration])
        drawn = random.integers(len(self._windows), size=self._batch)
        later = random.integers(self._later[drawn] + 1)[:, None]
        # As many gestures are the best match as are others of the first 15 (MM22) and, last, under controls.
        kinds = self._tensor(random.integers(2 + self._recipe.controls, size=self._batch))[:, None]
        windows, shifted = (self._tensor(self._windows[drawn] + frames) for frames in (0, later))
        controls, spoken_controls = (
            self._controls[rows] * (kinds == STEERED)[..., None] for rows in (windows, shifted)
        )
        found, gesture = self._found[kinds, windows].mT, self._gesture[shifted].mT
        heard, spoken = self._heard(windows, controls), self._heard(shifted, spoken_controls)
        mix = self._tensor(random.random((self._batch, 1, 1), np.float32))
        with torch.no_grad():
            real, made = self.critic.seen(gesture), self.critic.seen(self.generator(heard, found))
        distance = self.critic(spoken, real).mean() - self.critic(heard, made).mean()
        penalty = self._penalty(torch.lerp(spoken, heard, mix), torch.lerp(real, made, mix))
        loss = self._recipe.penalty * penalty - W_ADVERSARIAL * distance
        norm = self._descend(self.critic, self._adams[1], loss)
        losses = {"distance": distance.item(), "penalty": penalty.item(), "critic_gradient": norm}
        if iteration % self._recipe.critic_steps == 0:
            refined = self.generator(heard, found)
            change = (refined - found).abs().mean()
            missed = self._missed(refined, controls.mT) if self._recipe.controls else torch.zeros(())
            adversarial = -self.critic(heard, self.critic.seen(refined)).mean()
            loss = W_FOUND * change + W_ADVERSARIAL * adversarial + W_MISSED * missed
            norm = self._descend(self.generator, self._adams[0], loss)
            self.averaged.update_parameters(self.generator)
            losses |= {"change": change.item(), "missed": missed.item()}
            losses |= {"generator_loss": loss.item(), "generator_gradient": norm}
        for name, value in losses.items():
            if not abs(value) <= LARGEST_GRADIENT:
                raise TrainingError(
                    f"the training has diverged in iteration {iteration}: {name} is {value:.3g}"
                )
        return losses

    def run(self, heard: np.ndarray, found: np.ndarray) -> np.ndarray:
        """The averaged generator; see model.Network."""
        with torch.no_grad():
            return self.averaged(self._tensor(heard), self._tensor(found)).cpu().numpy()

    def state(self) -> dict[str, Any]:
        """All that changes in training."""
        return {
            "generator": self.generator.state_dict(),
            "critic": self.critic.state_dict(),
            "averaged": self.averaged.state_dict(),
            "optimisers": [adam.state_dict() for adam in self._adams],
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to a state."""
        self.generator.load_state_dict(state["generator"])
        self.critic.load_state_dict(state["critic"])
        self.averaged.load_state_dict(state["averaged"])
        for adam, saved in zip(self._adams, state["optimisers"], strict=True):
            adam.load_state_dict(saved)

    def _heard(self, rows: torch.Tensor, controls: torch.Tensor) -> torch.Tensor:
        """Sound of rows (b, 64) and, where the networks see them, controls (b, 64, 32): channels first."""
        sound = self._sound[rows]
        return (torch.cat([sound, controls], dim=-1) if self._recipe.controls else sound).mT

    def _penalty(self, heard: torch.Tensor, between: torch.Tensor) -> torch.Tensor:
        """How far the critic's slope is from 1, between real and made gestures (Gulrajani et al. 2017)."""
        between.requires_grad_()
        (slope,) = torch.autograd.grad(self.critic(heard, between).sum(), between, create_graph=True)
        return ((slope.flatten(1).norm(dim=1) - 1) ** 2).mean()

    def _descend(self, network: nn.Module, adam: torch.optim.Adam, loss: torch.Tensor) -> float:
        """One step of an optimiser, on the mean of all processes; the norm of the gradient."""
        adam.zero_grad()
        # The generator's loss runs through the critic, which is not to learn from it.
        parameters = list(network.parameters())
        for parameter, gradient in zip(parameters, torch.autograd.grad(loss, parameters), strict=True):
            if distributed.is_initialized():
                distributed.all_reduce(gradient, distributed.ReduceOp.SUM)
                gradient /= distributed.get_world_size()
            parameter.grad = gradient
        adam.step()
        return float(nn.utils.get_total_norm([parameter.grad for parameter in parameters]))

    def _tensor(self, array: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(array).to(self._device)


def _average(average: torch.Tensor, new: torch.Tensor, steps: torch.Tensor) -> torch.Tensor:
    """The moving average goes on; of the first steps, it is hardly more than the last one."""
    kept = min(AVERAGED, (1 + int(steps)) / (10 + int(steps)))
    return kept * average + (1 - kept) * new
