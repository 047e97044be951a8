"""Landmarks that MediaPipe saw on video, with speech features, as arrays in an .npz file.

`names` (j,) are MediaPipe's names of the landmarks, `audio_names` (a,) those of the features, and `fps` is
the rate of both. Each trial has two arrays, TRIAL/landmarks (n, j, 4), x, y, z and visibility, and
TRIAL/audio (n, a), with mfcc1 to mfcc12 and rms, the root mean square, among its columns. Trials whose names
agree up to the first `_` are taken to be one session, before one camera and one microphone.

x and y are shares of the picture's width and height, which is taken to be 16:9. z is a guess from a single
picture, smaller the nearer to the camera: it has the right shape and the wrong scale.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d

from gesture_bot.base.errors import FileFormatError
from gesture_bot.corpus.npz import array_names, load_array
from gesture_bot.corpus.precomputed import Sound, features_like_ours
from gesture_bot.corpus.sources import Take
from gesture_bot.speech.features import COEFFICIENTS

KIND = "MediaPipe landmarks with speech features (.npz with TRIAL/landmarks and TRIAL/audio)"

ASPECT = 16 / 9

VISIBLE = 0.5
"""A landmark that is less visible than this is guessed, and taken as lost [share]."""

DEPTH_NOISE = 0.1
"""Standard deviation of the Gaussian that takes the noise out of the depth [s]."""

_FOREARMS = (("LEFT_ELBOW", "LEFT_WRIST"), ("RIGHT_ELBOW", "RIGHT_WRIST"))


def fits(path: Path) -> bool:
    """Whether it is an .npz file with landmarks and their names."""
    arrays = array_names(path)
    return "names" in arrays and bool(_trials(arrays))


def read(path: Path) -> Iterator[Take]:
    """The trials of a file, by name. Their features are put on our scale; see precomputed.py.

    Raises:
        FileFormatError: An array is missing or damaged, or does not have the shape of the others.
    """
    joints = tuple(map(str, load_array(path, "names")))
    columns = {str(name).lower(): place for place, name in enumerate(load_array(path, "audio_names"))}
    for landmark in (landmark for forearm in _FOREARMS for landmark in forearm):
        if landmark not in joints:
            raise FileFormatError(f"{path}: names lacks", landmark, joints)
    rate = _rate(path)
    sessions: dict[str, list[str]] = {}
    for trial in _trials(array_names(path)):
        sessions.setdefault(trial.partition("_")[0], []).append(trial)
    for trials in sessions.values():
        seen = [load_array(path, f"{trial}/landmarks") for trial in trials]
        heard = [load_array(path, f"{trial}/audio") for trial in trials]
        for trial, landmarks, sound in zip(trials, seen, heard, strict=True):
            shapes = (len(landmarks), len(joints), 4), (len(landmarks), len(columns))
            if (landmarks.shape, sound.shape) != shapes:
                raise FileFormatError(f"{path}: shapes of {trial}", (landmarks.shape, sound.shape), [shapes])
        features = features_like_ours([_sound(path, sound, columns, rate) for sound in heard])
        for trial, positions, vectors in zip(trials, _positions(seen, joints, rate), features, strict=True):
            yield Take(trial, joints, positions, rate, vectors)


def _rate(path: Path) -> float:
    fps = load_array(path, "fps")
    if fps.size != 1 or fps.dtype.kind not in "iuf" or not 0 < fps.item() < np.inf:
        raise FileFormatError(f"{path}: fps is no rate", fps.tolist())
    return float(fps.item())


def _trials(arrays: set[str]) -> list[str]:
    """The trials whose landmarks and sound are there, in the order of their names."""
    return sorted(
        trial for trial, _, kind in (name.rpartition("/") for name in arrays)
        if kind == "landmarks" and f"{trial}/audio" in arrays
    )  # fmt: skip


def _sound(path: Path, audio: np.ndarray, columns: Mapping[str, int], rate: float) -> Sound:
    """The columns of a trial (n, a) that we use."""
    try:
        power = audio[:, columns["rms"]].astype(np.float64) ** 2
        level = 10 * np.log10(np.maximum(power, 1e-12))
        first = audio[:, columns["mfcc0"]] if "mfcc0" in columns else level
        rest = [audio[:, columns[f"mfcc{number}"]] for number in range(1, COEFFICIENTS)]
    except KeyError as error:
        raise FileFormatError(f"{path}: audio_names lacks", error.args[0], columns) from error
    return Sound(np.column_stack([first, *rest]), power, rate)


def _positions(seen: list[np.ndarray], joints: tuple[str, ...], rate: float) -> list[np.ndarray]:
    """(n, j, 3) positions of each trial in picture heights, NaN where lost.

    The depth is smoothed, and given the scale at which forearms keep their length whatever way they point:
    at that, the squares of their length in the picture and of their depth add up to a constant. Placing
    elbows and wrists at the depth that the lengths of the bones leave was tried, and is worse: where a bone
    lies in the plane of the picture, a small error of its length is a large one of its depth, and the hands
    shake.
    """
    placed = []
    for landmarks in seen:
        positions = landmarks[..., :3].astype(np.float64) * (ASPECT, 1, ASPECT)
        positions[..., 2] = _smoothed(positions[..., 2], DEPTH_NOISE * rate)
        positions[~(landmarks[..., 3] >= VISIBLE)] = np.nan
        placed.append(positions)
    everything = np.concatenate(placed)
    across, deep = np.empty(0), np.empty(0)
    for elbow, wrist in _FOREARMS:
        x, y, z = (everything[:, joints.index(wrist)] - everything[:, joints.index(elbow)]).T
        across, deep = np.append(across, x**2 + y**2), np.append(deep, z**2)
    found = np.isfinite(across + deep)
    slope = np.polyfit(deep[found], across[found], 1)[0] if found.any() else 0.0
    return [positions * (1, 1, np.sqrt(max(0.0, -slope))) for positions in placed]


def _smoothed(values: np.ndarray, sigma: float) -> np.ndarray:
    """(n, j) values under a Gaussian over time; lost ones are bridged by lines."""
    frames = np.arange(len(values))
    for column in values.T:
        lost = np.isnan(column)
        if not lost.all():
            column[lost] = np.interp(frames[lost], frames[~lost], column[~lost])
    return gaussian_filter1d(values, sigma, axis=0)
