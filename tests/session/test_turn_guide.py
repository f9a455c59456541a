import math
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from mpucal.session.aims import ALL_AROUND
from mpucal.session.meter import TURN_WORDS, TurnGuide


def test_the_missing_turn_leads_to_the_wanted_orientation():
    attitude = Rotation.random(random_state=3)
    for down in ALL_AROUND.tolist():
        turn = TurnGuide().turn_to(down, attitude.as_quat(scalar_first=True).tolist())
        reached = Rotation.from_quat(turn.attitude, scalar_first=True)
        assert np.allclose(reached.apply(down), [0, 0, -1], atol=1e-9), down
        between = np.degrees((reached * attitude.inv()).magnitude())
        # The turn is about one of eight axes if that leads near enough, so it may exceed the shortest turn a little.
        assert turn.missing_deg - 1e-6 <= between <= turn.missing_deg + 5.0, down


def test_turning_by_the_words_approaches_the_target():
    """Turn by the angle and the words alone, from 200 random attitudes: at most 0.6 of it is left."""
    rng = np.random.default_rng(1)
    words = [f"deg more, {each}" for each in TURN_WORDS]
    for down in rng.normal(size=(200, 3)):
        guide, attitude = TurnGuide(), Rotation.random(random_state=rng)
        toward = tuple(down / np.linalg.norm(down))
        left = [180.0]
        while left[-1] > 15.0:
            turn = guide.turn_to(toward, attitude.as_quat(scalar_first=True).tolist())
            left.append(turn.missing_deg)
            if not turn.words:
                break
            heading = words.index(turn.words.partition(" ")[2]) * math.pi / 4.0
            axis = math.radians(turn.missing_deg) * np.array([-math.sin(heading), math.cos(heading), 0.0])
            attitude = Rotation.from_rotvec(axis) * attitude
        assert all(after < 0.6 * before for before, after in pairwise(left[1:])), left
