"""Questions that engineers ask of a machine with gaps: where it rattles, what makes it stop, and how sure that is.

Functions: `design`, `rattle_bands`, `run_up`, `run_ups`, `threshold`, `tolerance`.

Classes: `Change`, `Design`, `DesignOptions`, `LeastChangeOptions`, `Need`, `NoPoint`, `PeakBelow`, `Quiet`,
`RattleBands`, `RattleOptions`, `Resonance`, `RunUp`, `RunUps`, `SpeedCourse`, `Spread`, `Threshold`,
`ThresholdOptions`, `Tolerance`, `ToleranceOptions`.
"""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
