"""What can go wrong on the wire of a virtual bus."""

import math
from dataclasses import dataclass, field
from random import Random


@dataclass
class WireFaults:
    """Faults that are in force; at first there are none.

    Attributes:
        bit_noise: Share of the bits that arrive wrong, either way.
        lost_replies: Share of the servos' answers that are never sent.
        silent: IDs of servos that neither hear nor answer.
        random: Decides which bits and which answers.
    """

    bit_noise: float = 0.0
    lost_replies: float = 0.0
    silent: set[int] = field(default_factory=set)
    random: Random = field(default_factory=lambda: Random(1))

    def through(self, data: bytes) -> bytes:
        """What arrives at the other end of the wire."""
        if not self.bit_noise:
            return data
        noisy = bytearray(data)
        at = self._gap()
        while at < 8 * len(noisy):
            noisy[at // 8] ^= 1 << at % 8
            at += 1 + self._gap()
        return bytes(noisy)

    def loses_reply(self) -> bool:
        """Whether the next answer is lost."""
        return self.lost_replies > 0 and self.random.random() < self.lost_replies

    def _gap(self) -> int:
        """How many bits in a row are right: a geometric distribution."""
        return int(math.log1p(-self.random.random()) / math.log1p(-self.bit_noise))
