"""Fitting of the weights of pointing learns what tells things apart."""

import numpy as np

from training.pointing import Example, fit


def test_the_measure_that_tells_gets_the_weight():
    random = np.random.default_rng(3)
    found = []
    for _ in range(6):
        inside = (random.random(40) < 0.3).astype(float)
        noise = random.normal(size=40)
        found.append(Example({"good": 2 * inside, "noise": noise}, inside, np.full(40, 1 / 40)))
    weights = fit(found, steps=60)
    assert list(weights) == ["bias", "good", "noise"]
    assert weights["good"] > 1
    assert weights["good"] > 5 * abs(weights["noise"])
    assert weights["bias"] < 0
    assert fit(found, steps=60) == weights
