"""What other packages' speech recognisers write, word by word."""


class Transcript:
    """Finds the new words in a text that grows while somebody speaks.

    A recogniser may change its mind about what it wrote before; words already told are not taken back.
    """

    def __init__(self) -> None:
        self._told = 0

    def incremental(self, text: str) -> list[str]:
        """The words beyond those already told; the last one may still be changing, and waits."""
        if not text.strip():
            self._told = 0  # the text before has ended without its final form
        return self._new(text.split()[:-1])

    def final(self, text: str) -> list[str]:
        """The rest of the words; the next text is a new one."""
        new = self._new(text.split())
        self._told = 0
        return new

    def _new(self, words: list[str]) -> list[str]:
        new = words[self._told :]
        self._told = max(self._told, len(words))
        return new
