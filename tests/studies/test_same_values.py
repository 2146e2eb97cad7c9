"""No spec of the first edition has changed its value."""

import hashlib

import numpy as np

from studies.same_values import DECLARED, digest, formulas
from tltlrl.logic import parse_spec

FIRST_EDITION = "ceb5e5f25db47d189ece6a943efd405f76e7de2b995362969361d88f46c4eb3c"  # commit 16b2176


def test_random_formulas_of_the_first_edition_have_their_values():
    digests = ""
    for seed, text in enumerate(formulas()[:300]):
        generator = np.random.default_rng(seed)
        count, steps = int(generator.integers(1, 4)), int(generator.integers(1, 12))
        digests += digest(parse_spec(DECLARED + text), seed, count, steps)
    assert hashlib.sha256(digests.encode()).hexdigest() == FIRST_EDITION
