"""Studies: complete jobs that a model file requests, and their execution.

Functions: `add_kind`, `check_signal`, `check_study`, `compare_results`, `read_studies`.

Classes: `BasinStudy`, `BranchOptions`, `Carry`, `CellComparison`, `CellDifference`, `Counted`, `DiagramStudyOptions`,
`Entry`, `FamilyStudy`, `Finding`, `Found`, `FullCheck`, `LocusStudyOptions`, `Lone`, `MapStudyOptions`,
`MemberParameter`, `Pair`, `ParameterRange`, `Part`, `Parts`, `Patience`, `RangeStudy`, `ReducedFrom`, `RegimeStudy`,
`ResponseOptions`, `ResultComparison`, `Rows`, `SettleFinding`, `SettleStudyOptions`, `Shift`, `Start`, `StudyKind`,
`Surroundings`, `SweepStudy`, `ToleranceStudy`, `Way`, `Which`, `Work`.

Values: `OPEN`.
"""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
