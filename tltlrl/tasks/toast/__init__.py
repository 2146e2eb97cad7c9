"""Toast domain: Baxter's right arm places a slice of bread in a toaster (case study, eqs 3.7 to 3.9).

The model is in toast.xml, the task in scene.py, the hand-made reward in rewards.py.
"""

from dataclasses import replace

from tltlrl.tasks.task import TaskEntry
from tltlrl.tasks.toast.rewards import ToastReward, toast_rewards
from tltlrl.tasks.toast.scene import Toast, ToastConfig

__all__ = ["TOAST"]

TOAST = TaskEntry(
    config=ToastConfig,
    make=Toast,
    spec="toast.tltl",
    reward=ToastReward,
    rewards=toast_rewards,
    hand_made=("continuous",),
    evaluation=lambda config: replace(config, solid=True),
)
