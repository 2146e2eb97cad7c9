"""`make bench`: one table of measured ratios beside their targets."""

import os

if __name__ == "__main__":  # and not in the worker processes, which import this file, too
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

    from benchmarks import scale, simulation, spec, startup

    print(f"{'measured':>10}  {'target':<10}  what")
    for part in (simulation, scale, spec, startup):
        for name, measured, target, bound in part.rows():
            wanted = "" if target is None else f"{bound} {target:g}"
            print(f"{measured:10.3g}  {wanted:<10}  {name}", flush=True)
