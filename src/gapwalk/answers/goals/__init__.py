"""Goals of a design: one class in one file each, and one line here.

`gapwalk.answers.goals.goal.Goal` says what a kind of goal must give.
"""

from gapwalk.answers.goals.goal import EXACT, MARGIN, Goal, Need
from gapwalk.answers.goals.no_point import NoPoint
from gapwalk.answers.goals.peak_below import PeakBelow
from gapwalk.answers.goals.quiet import Quiet
from gapwalk.answers.goals.resonance import Resonance

AnyGoal = NoPoint | Quiet | PeakBelow | Resonance
"""A goal of any kind."""

__all__ = ["EXACT", "MARGIN", "AnyGoal", "Goal", "Need", "NoPoint", "PeakBelow", "Quiet", "Resonance"]
