"""Which speech is announced before it is heard, as a robot's own voice is, and which is heard live."""


class Liveness:
    """Decides by the first message of an utterance: one that comes after its moment is live."""

    def __init__(self) -> None:
        self._decided: dict[str, tuple[int, bool]] = {}

    def is_live(self, source: str, utterance: int, moment: float, now: float) -> bool:
        """Whether an utterance of a source is heard live.

        Args:
            source: Its source.
            utterance: Its number.
            moment: When what the message tells of is heard [s since the epoch].
            now: The present [s since the epoch].
        """
        decided = self._decided.get(source)
        if decided is None or decided[0] != utterance:
            decided = self._decided[source] = utterance, moment < now
        return decided[1]
