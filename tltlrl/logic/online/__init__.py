"""Follows trajectories that still run, sample by sample: robustness, bounds, explanations, potentials (docs/online.md).

Nothing here knows a spec; `tltlrl.logic.spec` makes a monitor from its formula.
"""
