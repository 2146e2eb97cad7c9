"""`make bench`: one table of measured ratios beside their targets."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from benchmarks import simulation, spec

if __name__ == "__main__":
    print(f"{'measured':>10}  {'target':<10}  what")
    for name, measured, target in [*simulation.rows(), *spec.rows()]:
        print(f"{measured:10.3g}  {target:<10}  {name}", flush=True)
