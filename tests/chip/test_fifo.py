"""FIFO decoder against frames packed one by one."""

import itertools
import struct

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mpucal.chip.config import Settings
from mpucal.chip.families import part_of
from mpucal.chip.fifo import DROPPED_FRAMES, FifoDecoder
from mpucal.chip.losses import Loss

SETTINGS = Settings(part_of(0x68), smplrt_div=4, dlpf_cfg=3, fs_sel=1, afs_sel=1)
PERIOD_NS = 5_000_000
QUIET = (100, -200, 8192, -2000, 5, -6, 7)
FLICKER = itertools.count()

int16 = st.integers(-32768, 32767)


def packed(*frames):
    return b"".join(struct.pack(">7h", *frame) for frame in frames)


def calm(n):
    """Make `n` frames of a board at rest, each a little different from the one before."""
    return [(*QUIET[:6], 7 + next(FLICKER) % 3) for _ in range(n)]


def fresh(frames_before=DROPPED_FRAMES):
    """Make a decoder whose FIFO was reset at time 0, and that has read as many frames as it drops."""
    decoder = FifoDecoder(SETTINGS)
    decoder.set_temperature(QUIET[3])
    decoder.reset()
    if frames_before:
        poll(decoder, packed(*calm(frames_before)), 0)
    return decoder


def poll(decoder, data, n, overflow=False):
    decoder.set_count(n * 4 * PERIOD_NS, len(data))
    decoder.add_bytes(data)
    return decoder.finish_poll(overflow)


@settings(max_examples=40)
@given(st.lists(st.tuples(int16, int16, int16, st.integers(-2100, -1900), int16, int16, int16), min_size=1))
def test_values_are_counts_times_nominal_scale(frames):
    decoder = fresh()
    frames = [frame for frame, _ in itertools.groupby(frames)]
    assert poll(decoder, packed(*frames), 1) is None
    # the last frame may be flipped, and waits
    assert poll(decoder, packed(*calm(2)), 2) is None
    assume(not decoder.repaired)
    samples = decoder.take()
    for i, (ax, ay, az, temperature, gx, gy, gz) in enumerate(frames):
        assert samples.acc[i] == pytest.approx(np.array([ax, ay, az]) / 8192 * 9.80665)
        assert samples.gyr[i] == pytest.approx(np.radians(np.array([gx, gy, gz]) / 65.5))
        assert samples.temperature_c[i] == pytest.approx(temperature / 340 + 36.53)
        assert samples.acc_clipped[i] == any(abs(count) >= 32767 for count in (ax, ay, az))
        assert samples.gyr_clipped[i] == any(abs(count) >= 32767 for count in (gx, gy, gz))


def test_a_frame_that_may_be_flipped_waits_for_the_next():
    """Repair a flipped word before it is delivered; deliver a blow unchanged, one poll later."""
    flipped, blow = (*QUIET[:6], 7 ^ 1 << 13), (8000, *QUIET[1:])
    decoder = fresh()
    poll(decoder, packed(*calm(4), flipped), 1)
    assert len(decoder.take()) == 4
    poll(decoder, packed(*calm(2), blow), 2)
    assert decoder.repaired == 1
    assert np.abs(decoder.take().gyr).max() < 0.01
    poll(decoder, packed((*blow[:6], 8), *calm(2)), 3)
    assert decoder.repaired == 1
    np.testing.assert_array_equal(decoder.take().acc[:2, 0], 8000 / 8192 * 9.80665)


@given(st.lists(st.integers(0, 6), min_size=1, max_size=20), st.integers(1, 9))
def test_samples_do_not_depend_on_how_polls_cut_them(sizes, equal):
    """Use up to nine equal frames, and frames of a die that warms up."""
    frames = [(i // equal, 0, 8192, -2000 + 100 * (i // equal), 0, 0, 0) for i in range(sum(sizes))]
    decoder, at = fresh(frames_before=0), 0
    for n, size in enumerate(sizes):
        assert poll(decoder, packed(*frames[at : at + size]), n) is None
        at += size
    # frames at the end may be the first ones of a sensor that repeats itself
    assert poll(decoder, packed((*(frames or [QUIET])[-1][:6], 9)), len(sizes)) is None
    taken = np.rint(decoder.recording("x").acc[:-1, 0] / 9.80665 * 8192).tolist()
    assert taken == [frame[0] for frame in frames[DROPPED_FRAMES:]]


@pytest.mark.parametrize("shift", range(1, 14))
def test_misaligned_frames_are_noticed_at_the_first(shift):
    decoder = fresh()
    stream = packed(*[(100, -200, 8192, -2000, 950, -900, 700)] * 6)
    assert poll(decoder, stream[shift : shift + 5 * 14], 1) is Loss.MISALIGNED
    assert len(decoder.take()) == 0


@pytest.mark.parametrize(
    ("data", "overflow", "fault"),
    [
        pytest.param(packed(QUIET), True, Loss.OVERFLOW, id="overflow while reading"),
        pytest.param(b"", True, Loss.OVERFLOW, id="overflow before"),
        pytest.param(packed(QUIET)[:-1], False, Loss.MISALIGNED, id="a part of a frame"),
        pytest.param(packed(QUIET, (*QUIET[:3], -1500, *QUIET[4:])), False, Loss.MISALIGNED, id="jump"),
    ],
)
def test_a_poll_that_is_not_accepted_leaves_a_gap(data, overflow, fault):
    decoder = fresh()
    poll(decoder, packed(*calm(2)), 1)
    assert poll(decoder, data, 2, overflow) is fault
    decoder.reset()
    poll(decoder, packed(*calm(DROPPED_FRAMES + 2)), 3)
    poll(decoder, packed(*calm(1)), 4)
    assert decoder.recording("x").gap.tolist() == [False, False, True, False, False]


@pytest.mark.parametrize("cut", range(1, 12))
def test_a_frame_that_repeats_itself_is_not_delivered(cut):
    """Frames before the run are delivered however polls cut it, and after a reset there is a gap."""
    decoder = fresh()
    before, stuck = calm(3), [(*QUIET[:6], -9)] * 12
    faults = [poll(decoder, packed(*before, *stuck[:cut]), 1)]
    if faults[0] is None:
        faults.append(poll(decoder, packed(*stuck[cut:]), 2))
    assert faults[-1] is Loss.STUCK
    # The first frame of the run may be a valid one.
    assert len(decoder.take()) == (0 if len(faults) == 1 else 4 if cut == 1 else 3)
    decoder.reset()
    poll(decoder, packed(*calm(DROPPED_FRAMES + 2)), 3)
    assert decoder.recording("x").gap.any() == (faults[0] is None)
