"""Records that are fields of other records or results of functions; users do not create them.

Classes: `AttractorKind`, `Band`, `BandEnd`, `BasinCheck`, `BasinShares`, `Basis`, `Box`, `BranchCheck`, `BranchPoint`,
`BranchWalk`, `Cascade`, `Chance`, `ChangedParameter`, `Check`, `Codim2`, `Codim2Point`, `Comparison`, `Confirmation`,
`Connection`, `ContactEvent`, `ContactRecord`, `ContactRest`, `DiagramBranch`, `Direction`, `Drawn`, `DryModes`, `End`,
`EndReason`, `Equilibrium`, `Fate`, `Figure`, `ForcePeak`, `FoundOrbit`, `FrictionPhase`, `Further`, `GapSpan`,
`GapState`, `Hold`, `HowFound`, `Influences`, `Instability`, `JudgedGoal`, `JumpDelay`, `Kink`, `Lane`, `LocusEnd`,
`LocusEndReason`, `LocusPoint`, `Luck`, `MapSection`, `Margin`, `Match`, `Member`, `Modes`, `Motion`, `Mover`,
`OrbitCheck`, `Origin`, `Passage`, `Place`, `RattleBand`, `RattleMap`, `RegimeCheck`, `Rest`, `Rotation`, `Route`,
`Sample`, `ScanCheck`, `SearchResult`, `SettledSweep`, `Severity`, `Share`, `SlipEvent`, `SlowSweepOptions`,
`SpecialCheck`, `SpecialPointPath`, `Spot`, `Stretch`, `Summary`, `SummaryText`, `Table`, `Tally`, `ToleranceCheck`,
`Tree`, `Turns`, `Unexplained`, `VariedHow`, `Window`, `Worst`.
"""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
