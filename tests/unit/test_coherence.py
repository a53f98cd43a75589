"""Coherence over time: no lag, no loss of peaks, less noise."""

import numpy as np
import pytest

from vermilion.config.correction import CorrectionConfig
from vermilion.correction.coherence import smoothed_over_time

FRAMES = np.arange(40)


def jitter(values):
    return np.sqrt((np.diff(values, n=2, axis=0) ** 2).mean())


@pytest.mark.parametrize("reach", [2, 3, 6])
def test_a_parabola_stays_as_it_is_even_at_the_ends_and_over_gaps(reach):
    frames = np.delete(FRAMES, [7, 8, 20, 33])
    values = np.stack([0.01 * (frames - 11.0) ** 2, 3.0 - 0.5 * frames], axis=1)
    np.testing.assert_allclose(smoothed_over_time(values, frames, reach), values, atol=1e-9)


def test_noise_of_single_frames_goes():
    noise = np.random.default_rng(0).normal(size=(2000, 3))
    smooth = smoothed_over_time(noise, np.arange(2000), 3)
    assert jitter(smooth) < 0.25 * jitter(noise)


def test_a_peak_of_a_fifth_of_a_second_comes_neither_late_nor_much_lower():
    """A closing mouth at 30 frames a second."""
    peak = np.exp(-0.5 * ((FRAMES - 20.0) / 3.0) ** 2)[:, None]
    smooth = smoothed_over_time(peak, FRAMES, 3)
    assert np.argmax(smooth) == 20
    assert smooth.max() > 0.93
    np.testing.assert_allclose(smooth[10:31], smooth[10:31][::-1], atol=1e-9)


def test_a_frame_depends_on_its_neighbours_within_reach_alone():
    values = np.random.default_rng(1).normal(size=(40, 2))
    whole = smoothed_over_time(values, FRAMES, 3)
    part = smoothed_over_time(values[7:21], FRAMES[7:21], 3)
    np.testing.assert_allclose(part[3:-3], whole[10:18], atol=1e-12)


@pytest.mark.parametrize("frames", [[3], [3, 4, 5], [0, 10, 20, 30, 40]])
def test_frames_without_enough_neighbours_stay(frames):
    values = np.random.default_rng(2).normal(size=(len(frames), 2))
    np.testing.assert_array_equal(smoothed_over_time(values, np.array(frames), 3), values)


def test_the_window_is_a_time():
    """The same stretch of speech at any frame rate; where frames are that far apart, none."""
    config = CorrectionConfig()
    frames = [config.integration.at(fps)["smooth_frames"] for fps in (10, 30, 60)]
    assert frames == [0, 3, 6]
    assert config.reach_frames(30) == 9 + 18 + 3
