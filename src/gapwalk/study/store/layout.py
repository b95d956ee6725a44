"""The tables of a result file: those that every file has, and those of some kinds of study."""

SCHEMA = 3
"""Version of the tables below and of what stands in them; each change adds one, and a step in `older.py`."""

# The one branch of a response goes on from its `state` unless it has `ends`. The branches of a diagram, or of the
# sections of a map, are written whole. The points of one moment stand in one row: thousands of small rows would take
# longer to write than the points to compute. (A file is known by these texts, comments apart.)
TABLES = (
    """CREATE TABLE result (
    key TEXT PRIMARY KEY, -- title, name, text, changes, system, study, versions, diagram: all in JSON
    value TEXT NOT NULL
) WITHOUT ROWID""",
    """CREATE TABLE branch (
    id INTEGER PRIMARY KEY,
    name TEXT NOT NULL, -- such as P2-3
    parameter TEXT NOT NULL,
    period INTEGER NOT NULL, -- m
    unknowns INTEGER NOT NULL, -- scaled variables of a point, N + 1
    start BLOB, -- of a response: the orbit that was found first, see gapwalk.study.store.codec
    start_events BLOB,
    begins TEXT, -- where it begins on another branch, and where it ends on one, in JSON
    joins TEXT,
    state TEXT, -- where the walk has come to, in JSON
    ends TEXT -- where and why it ends, at its beginning and at its end, in JSON
)""",
    """CREATE TABLE points (
    branch INTEGER NOT NULL,
    first INTEGER NOT NULL, -- number of the first of these points on the branch
    count INTEGER NOT NULL,
    data BLOB NOT NULL, -- see gapwalk.study.store.codec
    events BLOB NOT NULL,
    checksum INTEGER NOT NULL, -- CRC-32 of data, then events
    PRIMARY KEY (branch, first)
)""",
    """CREATE TABLE special_point (
    branch INTEGER NOT NULL,
    number INTEGER NOT NULL, -- in the order of the walk
    kind TEXT NOT NULL,
    value REAL NOT NULL, -- of the parameter
    uncertainty REAL NOT NULL,
    contact TEXT NOT NULL,
    nature TEXT NOT NULL,
    judged REAL NOT NULL,
    before TEXT NOT NULL, -- multipliers beyond +1, beyond -1, complex pairs outside the unit circle
    after TEXT NOT NULL,
    data BLOB NOT NULL,
    events BLOB NOT NULL,
    checksum INTEGER NOT NULL,
    PRIMARY KEY (branch, number)
)""",
)
"""The tables that every file has."""

# The points of a locus stand in one row: it is written whole.
_MAP_TABLES = (
    """CREATE TABLE locus (
    id INTEGER PRIMARY KEY,
    kind TEXT NOT NULL, -- what happens on it
    period INTEGER NOT NULL, -- m
    contact TEXT NOT NULL, -- what grazes on it
    unknowns INTEGER NOT NULL, -- scaled variables of a point, N + 1
    ends TEXT NOT NULL, -- where and why it ends, at its beginning and at its end, in JSON
    count INTEGER NOT NULL, -- of its points
    data BLOB NOT NULL, -- see gapwalk.study.map.codec
    events BLOB NOT NULL,
    checksum INTEGER NOT NULL
)""",
    """CREATE TABLE codim2_point (
    locus INTEGER NOT NULL,
    number INTEGER NOT NULL, -- in the order of the walk
    kind TEXT NOT NULL, -- what happens there
    first REAL NOT NULL, -- the values of both parameters
    second REAL NOT NULL,
    contact TEXT NOT NULL,
    data BLOB NOT NULL,
    events BLOB NOT NULL,
    checksum INTEGER NOT NULL,
    PRIMARY KEY (locus, number)
)""",
)

# What jobs over many values or cells have done, part by part; see `gapwalk.study.store.shelf`.
_CHUNK_TABLES = (
    """CREATE TABLE chunk (
    number INTEGER PRIMARY KEY, -- of the part
    data BLOB NOT NULL, -- see the job of the kind of study
    checksum INTEGER NOT NULL -- CRC-32 of data
)""",
)

EXTRA_TABLES: dict[str, tuple[str, ...]] = {
    "map": _MAP_TABLES,
    "locus": _MAP_TABLES,
    **dict.fromkeys(("family", "settle", "sweep", "basins", "regimes"), _CHUNK_TABLES),
}
"""The tables that only some kinds of study have, by kind."""
