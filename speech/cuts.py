"""What was announced and is not heard: messages of it may arrive after the cut that voids them."""

from collections import deque


class Cuts:
    """The last cuts of speech signals."""

    def __init__(self) -> None:
        self._cuts: deque[tuple[str, int, float]] = deque(maxlen=8)

    def add(self, source: str, utterance: int, moment: float) -> None:
        """Utterances of a source, up to one, are not heard from a moment on [s since the epoch]."""
        self._cuts.append((source, utterance, moment))

    def void(self, source: str, utterance: int, moment: float) -> bool:
        """Whether what an utterance has at a moment is not heard."""
        return any(
            source == cut_source and utterance <= last and moment >= cut
            for cut_source, last, cut in self._cuts
        )
