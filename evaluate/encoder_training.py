"""Training of the auto-encoder whose encoder FGD uses (Yoon et al. 2020, section 5.1). It needs torch.

`python -m gesture_bot.evaluate.encoder_training OUT.safetensors` makes the file of the package: on the demo
corpus, and seen in the mirror, too. One thread and a fixed seed make it the same each time on one machine.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from safetensors.numpy import save_file
from tqdm import trange

from gesture_bot.base.errors import GestureBotError
from gesture_bot.base.files import write_whole
from gesture_bot.base.keypoints import mirror
from gesture_bot.corpus.database import SEQUENCE, Database
from gesture_bot.corpus.demo import load_database
from gesture_bot.evaluate.encoder import LATENTS, SLOPE, STRIDE
from gesture_bot.evaluate.windows import CHANNELS, WINDOW_FRAMES, parent_relative

SEED, STEPS, BATCH, RATE = 0, 6000, 128, 1e-3

WIDTH, KERNEL, LAYERS = 64, 4, 3
"""Channels, taps and number of the convolutions."""

LEFT_OUT = 10
"""Every so many-th sequence is not trained on: it tells how well unseen motion is rebuilt."""


def train_encoder(database: Database, path: Path, steps: int = STEPS) -> dict[str, Any]:
    """Train an auto-encoder on windows of a database's sequences, and write its encoder.

    Args:
        database: The motion.
        path: File to write.
        steps: Of Adam, at a rate that falls to zero along a half cosine.

    Returns:
        What the file says about itself: seed, steps, and the RMS errors of rebuilt coordinates [mm].

    Raises:
        GestureBotError: torch is not installed, or the file cannot be written.
    """
    try:
        import torch
        from torch import nn
    except ImportError as error:
        raise GestureBotError("training needs torch: pip install '.[train]'") from error
    torch.manual_seed(SEED)
    torch.set_num_threads(1)

    motion = database.keypoints[database.starts[:, None] + np.arange(SEQUENCE)].astype(np.float64)
    sequences = parent_relative(np.concatenate([motion, mirror(motion)]))
    mean = sequences.mean(axis=(0, 1))
    # One deviation for all: a millimetre counts the same wherever it is.
    deviation = np.sqrt(sequences.var(axis=(0, 1)).mean())
    data = torch.tensor((sequences - mean) / deviation, dtype=torch.float32).transpose(1, 2)
    unseen = np.arange(len(data)) % len(motion) % LEFT_OUT == 0
    seen, unseen = data[~unseen], data[unseen][:, :, :WINDOW_FRAMES]

    class AutoEncoder(nn.Module):
        def __init__(self) -> None:
            super().__init__()
            widths = [CHANNELS, *[WIDTH] * LAYERS]
            self.convolutions = nn.ModuleList(
                nn.Conv1d(before, after, KERNEL, STRIDE)
                for before, after in zip(widths[:-1], widths[1:], strict=True)
            )
            length = WINDOW_FRAMES
            for _ in range(LAYERS):
                length = (length - KERNEL) // STRIDE + 1
            # The linear layer reads frame by frame, as the encoder in NumPy lays them out.
            self.linear = nn.Linear(length * WIDTH, LATENTS)
            self.decoder = nn.Sequential(
                nn.Linear(LATENTS, WIDTH * WINDOW_FRAMES // 4),
                nn.LeakyReLU(SLOPE),
                nn.Unflatten(1, (WIDTH, WINDOW_FRAMES // 4)),
                nn.ConvTranspose1d(WIDTH, WIDTH, 4, 2, 1),
                nn.LeakyReLU(SLOPE),
                nn.ConvTranspose1d(WIDTH, WIDTH, 4, 2, 1),
                nn.LeakyReLU(SLOPE),
                nn.Conv1d(WIDTH, CHANNELS, 3, padding=1),
            )

        def forward(self, windows: "torch.Tensor") -> "torch.Tensor":
            hidden = windows
            for convolution in self.convolutions:
                hidden = nn.functional.leaky_relu(convolution(hidden), SLOPE)
            return self.decoder(self.linear(hidden.transpose(1, 2).flatten(1)))

    network = AutoEncoder()
    optimiser = torch.optim.Adam(network.parameters(), RATE)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    taps = torch.arange(WINDOW_FRAMES)
    progress = trange(steps, desc="training", unit="step", disable=None)
    for _ in progress:
        picked = seen[torch.randint(len(seen), (BATCH,))]
        begins = torch.randint(SEQUENCE - WINDOW_FRAMES + 1, (BATCH, 1, 1))
        windows = picked.gather(2, (begins + taps).expand(-1, CHANNELS, -1))
        loss = nn.functional.mse_loss(network(windows), windows)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
    with torch.no_grad():
        missed = nn.functional.mse_loss(network(unseen), unseen)
    about = {
        "database": database.metadata.get("provenance", "not stated"),
        "sequences": len(motion),
        "seed": SEED,
        "steps": steps,
        "layers": LAYERS,
        "torch": torch.__version__,
        "error_mm": round(1000 * float(deviation) * loss.item() ** 0.5, 2),
        "unseen_error_mm": round(1000 * float(deviation) * missed.item() ** 0.5, 2),
    }
    arrays = {
        name: values.numpy()
        for name, values in network.state_dict().items()
        if not name.startswith("decoder")
    }
    arrays |= {"mean": mean.astype(np.float32), "deviation": np.array([deviation], np.float32)}
    with write_whole(path) as temporary:
        save_file(arrays, temporary, {"about": json.dumps(about)})
    return about


if __name__ == "__main__":
    print(train_encoder(load_database("demo"), Path(sys.argv[1])))
