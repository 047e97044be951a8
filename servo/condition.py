"""Whether a joint's servo is in service, and the way back if it is not."""

NO_ANSWER = "does not answer"
HOT = "is hot"
RELAXED = "is relaxed"
"""Reasons to be out of service; what a servo says of itself may be others."""


class Condition:
    """In service, or out of it for a reason. A servo that is set up again is back when it is heard next.

        in service -- put_out --> out -- set_up --> ready -- heard --> in service
                                   ^----- put_out ----|

    Attributes:
        reason: Why it is out of service; empty while it is in service.
        ready: Whether it is set up again, and waits to be heard.
    """

    def __init__(self) -> None:
        self.reason = ""
        self.ready = False

    @property
    def out(self) -> bool:
        """Whether it is out of service."""
        return bool(self.reason)

    def put_out(self, reason: str) -> None:
        """Take it out of service, or say why it stays out."""
        self.reason, self.ready = reason, False

    def set_up(self) -> None:
        """It is set up again."""
        self.ready = True

    def heard(self) -> bool:
        """It has told where it is; returns whether it is in service from now on, and was not before."""
        back = self.ready
        if back:
            self.reason, self.ready = "", False
        return back
