import numpy as np
import pytest

from gesture_bot.evaluate.lag import motion_lag

TIMES = 1_700_000_000.0 + np.arange(0, 4, 0.01)


def motion(times):
    return np.column_stack([np.sin(1.7 * times), 0.4 * np.cos(2.9 * times), np.full(len(times), 0.3)])


@pytest.mark.parametrize("lag", [-0.03, 0.0, 0.042, 0.31])
def test_a_shifted_motion_has_its_lag(lag):
    measured = motion(TIMES - lag) + [0.0, 0.05, 0.0]
    measured += 0.002 * np.random.default_rng(0).standard_normal(measured.shape)
    inside = slice(60, -60)
    planned_times = TIMES[::7]
    assert motion_lag(TIMES[inside], measured[inside], planned_times, motion(planned_times)) == pytest.approx(
        lag, abs=0.004
    )


def test_where_nothing_moves_there_is_no_lag():
    still = np.full((len(TIMES), 2), 0.2)
    assert motion_lag(TIMES[60:-60], still[60:-60], TIMES, still) is None
