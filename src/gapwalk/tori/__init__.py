"""Quasi-periodic motions: invariant closed curves of the stroboscopic map, and families of them.

Functions: `find_torus`, `find_window`, `follow_tongue`, `follow_tori`, `two_tones`.

Classes: `LockedWindow`, `Tone`, `Tongue`, `TongueTip`, `TongueTipKind`, `Torus`, `TorusDiagram`, `TorusEnd`,
`TorusEndReason`, `TorusEvent`, `TorusEventKind`, `TorusFamily`, `TorusOptions`, `TorusPoint`.
"""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
