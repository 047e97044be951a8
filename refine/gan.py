"""One iteration of MM22's training: a Wasserstein GAN with gradient penalty, in PyTorch."""

import os
from typing import Any

import numpy as np
import torch
from torch import distributed, nn

from gesture_bot.base.errors import TrainingError
from gesture_bot.refine.networks import Critic, Generator

W_FOUND, W_ADVERSARIAL, W_PENALTY = 0.1, 1.0, 100.0
"""Weights of the losses (MM22)."""

LEARNING_RATE, BETAS = 1e-4, (0.0, 0.9)
"""Of Adam (MM22, and its code)."""

CRITIC_STEPS = 5
"""Iterations from one step of the generator to the next (the authors' code)."""

LARGEST_GRADIENT = 1e6
"""A gradient with a larger norm is divergence."""


class Gan:
    """Generator, critic, and their optimisers.

    An iteration's batch depends on seed and number of the iteration alone, so that training that goes on from
    a checkpoint draws what it would have drawn.

    Args:
        sound: (N, 28) z-scored features of the database's rows.
        gesture: (N, 48) z-scored bone vectors.
        real, found: (w, 64) and (2, w, 64) rows of the windows; see pairs.Pairs.
        width: Share of the authors' channels.
        batch: Windows in a batch, of each process.
        seed: Of weights and batches.
    """

    def __init__(
        self, sound: np.ndarray, gesture: np.ndarray, real: np.ndarray, found: np.ndarray,
        width: float, batch: int, seed: int,
    ) -> None:  # fmt: skip
        torch.manual_seed(seed)
        self._rank = distributed.get_rank() if distributed.is_initialized() else 0
        self._device = torch.device("cpu")
        if torch.cuda.is_available():
            self._device = torch.device("cuda", int(os.environ.get("LOCAL_RANK", 0)))  # of torchrun
            torch.cuda.set_device(self._device)
            torch.backends.cudnn.deterministic = True
        self._sound, self._gesture = (self._tensor(rows) for rows in (sound, gesture))
        self._real, self._found = (self._tensor(rows) for rows in (real, found))
        self._batch, self._seed = batch, seed
        self.generator, self.critic = Generator(width).to(self._device), Critic(width).to(self._device)
        self._adams = [
            torch.optim.Adam(network.parameters(), LEARNING_RATE, BETAS)
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
        windows = random.integers(self._real.shape[0], size=self._batch)
        # Half of the gestures are the best match, half another of the first 15.
        kinds = random.integers(2, size=self._batch)
        real, found = self._real[windows], self._found[kinds, windows]
        sound, gesture, base = (
            source[rows].transpose(1, 2)
            for source, rows in ((self._sound, real), (self._gesture, real), (self._gesture, found))
        )
        mix = self._tensor(random.random((self._batch, 1, 1), np.float32))
        with torch.no_grad():
            made = self.generator(sound, base)
        distance = self.critic(sound, gesture).mean() - self.critic(sound, made).mean()
        penalty = self._penalty(sound, torch.lerp(gesture, made, mix))
        loss = W_PENALTY * penalty - W_ADVERSARIAL * distance
        norm = self._descend(self.critic, self._adams[1], loss)
        losses = {"distance": distance.item(), "penalty": penalty.item(), "critic_gradient": norm}
        if iteration % CRITIC_STEPS == 0:
            made = self.generator(sound, base)
            change = (made - base).abs().mean()
            loss = W_FOUND * change - W_ADVERSARIAL * self.critic(sound, made).mean()
            norm = self._descend(self.generator, self._adams[0], loss)
            losses |= {"change": change.item(), "generator_loss": loss.item(), "generator_gradient": norm}
        for name, value in losses.items():
            if not abs(value) <= LARGEST_GRADIENT:
                raise TrainingError(
                    f"the training has diverged in iteration {iteration}: {name} is {value:.3g}"
                )
        return losses

    def made(self, found: np.ndarray, real: np.ndarray) -> np.ndarray:
        """(w, 48, 64) what the generator makes of gestures, for the sound of other rows, both (w, 64)."""
        self.generator.eval()
        with torch.no_grad():
            made = [
                self.generator(self._sound[sound].transpose(1, 2), self._gesture[base].transpose(1, 2))
                for sound, base in zip(
                    self._tensor(real).split(256), self._tensor(found).split(256), strict=True
                )
            ]
        self.generator.train()
        return torch.cat(made).cpu().numpy()

    def state(self) -> dict[str, Any]:
        """All that changes in training."""
        return {
            "generator": self.generator.state_dict(),
            "critic": self.critic.state_dict(),
            "optimisers": [adam.state_dict() for adam in self._adams],
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to a state."""
        self.generator.load_state_dict(state["generator"])
        self.critic.load_state_dict(state["critic"])
        for adam, saved in zip(self._adams, state["optimisers"], strict=True):
            adam.load_state_dict(saved)

    def _penalty(self, sound: torch.Tensor, between: torch.Tensor) -> torch.Tensor:
        """How far the critic's slope is from 1, between real and made gestures (Gulrajani et al. 2017)."""
        between.requires_grad_()
        (slope,) = torch.autograd.grad(self.critic(sound, between).sum(), between, create_graph=True)
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
