"""Motion capture in BVH files, read and put through forward kinematics by pybvh."""

from collections.abc import Iterator
from pathlib import Path

import pybvh

from gesture_bot.base.errors import FileFormatError
from gesture_bot.corpus.sources import Take

KIND = "BVH (.bvh)"


def fits(path: Path) -> bool:
    """Whether the name ends in .bvh."""
    return path.suffix.lower() == ".bvh"


def read(path: Path) -> Iterator[Take]:
    """The one take of a BVH file. The end of a chain is the joint EndSiteNAME after the last one, NAME.

    Raises:
        FileFormatError: The file is missing, or is no BVH file.
    """
    try:
        motion = pybvh.read_bvh_file(path)
        positions = motion.node_positions()
    except OSError as error:
        raise FileFormatError(f"cannot read {path} ({error.strerror or 'no such file'})") from error
    except (ValueError, LookupError, AttributeError, TypeError) as error:
        raise FileFormatError(f"{path} is no whole BVH file ({' '.join(str(error).split())})") from error
    if motion.fps <= 0:
        raise FileFormatError(f"{path} is no whole BVH file (its frame time is not a time)")
    yield Take(path.stem, tuple(node.name for node in motion.nodes), positions, _rate(motion.fps))


def _rate(fps: float) -> float:
    """Frames a second, whole where they differ from that only as a rounded frame time does.

    BEAT's 0.008333 s stand for 120 frames a second, and are 24 ms short in ten minutes. 29.97 is a rate of
    its own.
    """
    whole = round(fps)
    return float(whole) if abs(fps - whole) < 5e-4 * whole else fps
