"""Which speech is announced before it is heard, as a robot's own voice is, and which is heard live."""

from collections import deque


class Liveness:
    """Decides by the first message of an utterance: one that comes after its moment is live."""

    def __init__(self) -> None:
        self._decided: dict[str, deque[tuple[int, bool]]] = {}

    def is_live(self, source: str, utterance: int, moment: float, now: float) -> bool:
        """Whether an utterance of a source is heard live.

        Args:
            source: Its source.
            utterance: Its number.
            moment: When what the message tells of is heard [s since the epoch].
            now: The present [s since the epoch].
        """
        # A word of an utterance may come after the sound of the next one has begun to.
        decided = self._decided.setdefault(source, deque(maxlen=4))
        known = next((live for number, live in decided if number == utterance), None)
        if known is None:
            known = moment < now
            decided.append((utterance, known))
        return known
