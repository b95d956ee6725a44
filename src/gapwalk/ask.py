"""Questions that engineers ask of a machine with gaps: where it rattles, what makes it stop, and how sure that is.

Functions: `design`, `rattle_bands`, `run_up`, `run_ups`, `scan`, `threshold`, `tolerance`,
`variations`.

Classes: `Change`, `Design`, `DesignOptions`, `LeastChangeOptions`, `MotionClaim`, `Need`, `NoPoint`,
`PeakBelow`, `PointClaim`, `Quiet`, `RattleBands`, `RattleOptions`, `Resonance`, `RunUp`, `RunUps`, `Scan`,
`ScanOptions`, `SlowSweepOptions`, `SpeedCourse`, `Spread`, `Threshold`, `ThresholdOptions`, `Tolerance`,
`ToleranceOptions`, `Variations`.
"""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
