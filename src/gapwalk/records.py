"""Records that are fields of other records or results of functions; users do not create them.

Classes: `AttractorKind`, `Band`, `BasinCheck`, `BasinShares`, `Basis`, `Box`, `BranchCheck`, `BranchPoint`,
`BranchWalk`, `Cascade`, `ChangedParameter`, `Check`, `Codim2`, `Codim2Point`, `Comparison`, `Connection`,
`ContactEvent`, `ContactRecord`, `ContactRest`, `Design`, `DiagramBranch`, `DryModes`, `End`, `EndReason`,
`Equilibrium`, `Fate`, `Figure`, `FoundOrbit`, `FrictionPhase`, `Hold`, `Instability`, `JudgedGoal`, `Kink`, `Lane`,
`LocusEnd`, `LocusEndReason`, `LocusPoint`, `MapSection`, `Match`, `Member`, `Modes`, `Motion`, `OrbitCheck`,
`Origin`, `Passage`, `Place`, `RegimeCheck`, `Rest`, `Rotation`, `Route`, `SearchResult`, `Share`, `SlipEvent`,
`SpecialCheck`, `SpecialPointPath`, `Spot`, `Summary`, `SummaryText`, `Table`, `Tally`, `Tree`, `Turns`,
`Unexplained`, `Window`.
"""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
