"""What `make bench` measures can be measured; how fast it is, is not judged here."""

import math

import pytest

from benchmarks import scale, simulation, spec


@pytest.mark.usefixtures("with_sketches")
def test_hundreds_of_runs_can_be_made_up_and_summarised(monkeypatch):
    monkeypatch.setattr(scale, "ITERATIONS", 3)
    monkeypatch.setattr(scale, "SEEDS", 1)
    monkeypatch.setattr(scale, "TASKS", ("toast",))
    rows = scale.rows()
    assert "2 runs of 3 iterations" in rows[2][0]
    assert all(measured > 0 for _, measured, _, _ in rows)


def test_a_closed_loop_is_timed_beside_raw_steps_and_dm_env():
    assert all(measured > 0 for _, measured, _, _ in simulation.closed_loop(2))


def test_updates_iterations_and_runs_are_timed():
    rates = [simulation.raw_rate(1, 1000), simulation.experiment_rate(1, 1)]
    rows = [simulation.update(), simulation.iteration("reach_avoid")]
    assert all(0 < measured < math.inf for measured in [*rates, *(row[1] for row in rows)])


def test_robustness_is_timed_beside_sentil_and_as_it_grows(monkeypatch):
    monkeypatch.setattr(spec, "best", lambda *functions: [function() is not None for function in functions])
    assert spec.against_sentil("reach_avoid", spec.REACH_AVOID, 2, 20) == 1
    assert spec.growth("G (x < 1)", (1, 10), (2, 10)) == 0.5
    assert spec.windows("F[0,w] (x > 0)", 10, 100) == 1
    assert spec.monitoring("reach_avoid", 2, 20) > 0
