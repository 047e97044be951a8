"""One family of errors, whose messages name the bad value and list the valid ones."""

from collections.abc import Iterable


class GestureBotError(Exception):
    """Something that a user can put right.

    Args:
        message: One line that names what is wrong.
        value: The bad value, appended to the message when given.
        valid: The values that would have been accepted, listed in the message when given.
    """

    def __init__(self, message: str, value: object = None, valid: Iterable[object] = ()):
        self.value = value
        self.valid = tuple(valid)
        if value is not None:
            message = f"{message}: {value!r}"
        if self.valid:
            message = f"{message}; valid: {', '.join(map(str, self.valid))}"
        super().__init__(message)


class InvalidValueError(GestureBotError, ValueError):
    """A name or number that is not one of the accepted ones; raised in a validator, pydantic says where."""


class FileFormatError(GestureBotError):
    """A file that cannot be read as what it should be."""


class RobotError(GestureBotError):
    """A robot description that does not fit together: URDF, mapping and servo table."""


class BusError(GestureBotError):
    """A servo bus or a servo on it that does not answer as it should."""


class PortError(BusError):
    """A serial port that was open and has vanished."""


class DeviceError(GestureBotError):
    """A microphone or loudspeaker that is not there, or does not work."""


class TrainingError(GestureBotError):
    """Training that cannot go on."""
