"""Gymnasium environments: `import tltlrl.gym` registers one per task, and `wrap` puts a spec around any other.

    env = gymnasium.make("tltlrl/VisitInOrder-v0", spec="my_task.tltl", constants={"goal_radius": 0.3})

This package needs the extra `gym` (pip install "tltlrl[gym]"). The reward is the spec's robustness. `telescoped`
divides it among the steps by the potential `stages` (see docs/online.md); `final` gives all of it at the end. Without
discount, `final` sums to the robustness, and `telescoped` to the robustness minus the potential of the first sample,
which no policy changes. An infinite robustness counts as -10 or 10.
"""

try:
    import gymnasium
except ModuleNotFoundError:
    raise ImportError("tltlrl.gym needs Gymnasium; install it with: pip install 'tltlrl[gym]'") from None

from tltlrl.gym.robots import SpecEnv, SpecVectorEnv
from tltlrl.gym.wrapped import wrap
from tltlrl.registry import TASKS

__all__ = ["SpecEnv", "SpecVectorEnv", "wrap"]

for _name in TASKS.names():
    gymnasium.register(
        f"tltlrl/{''.join(part.capitalize() for part in _name.split('_'))}-v0",
        entry_point="tltlrl.gym:SpecEnv",
        vector_entry_point="tltlrl.gym:SpecVectorEnv",
        kwargs={"task": _name},
    )
