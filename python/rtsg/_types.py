"""What the package's calls return as plain tuples with names, and tables."""
from typing import NamedTuple, Optional, Tuple

import numpy as np


class Pick(NamedTuple):
    """One point of one surface. Places in metres, world space; `normal` is of unit length."""
    node: object  # the Shape
    path: tuple  # nodes from a root to the Shape
    point: np.ndarray
    normal: np.ndarray
    distance: float
    texture: Tuple[float, float]
    triangle: int


class Irradiance(NamedTuple):
    """Light on a place: red, green, blue, and as an eye weighs them; intervals are half the 95 % ones."""
    value: np.ndarray
    interval: np.ndarray
    luminous: float
    luminous_interval: float
    samples: int
    missing: float
    reached: bool


class Verdict(NamedTuple):
    """What the origin made of a request."""
    request: int
    refusal: str  # empty: it was carried out
    state: int  # that has its effect
    created: dict  # numbers of nodes as asked for, and what they have become
    kept: str  # undo, redo: what was left as it is, and why


class Damage(NamedTuple):
    """Bytes of a log that no intact record covers."""
    offset: int
    length: int
    text: str


class FieldStep(NamedTuple):
    """A field got another value: when (seconds since the log's start), which, by whom and by which routes."""
    state: int
    time: float
    value: str
    author: str
    cause: str


class Divergence(NamedTuple):
    """Where two states or logs part."""
    frame: int
    time: float  # seconds since the log's start; of diff() scene time
    node: str
    field: str
    text: str


class FieldDifference(NamedTuple):
    """A field that was not as recorded, from state `frame` on."""
    node: str
    field: str
    frame: int
    time: float  # seconds since the log's start
    states: int
    largest: float
    text: str
    cause: str


class ReplayReport(NamedTuple):
    """What came of a replay test; `str()` of it is one line."""
    passed: bool
    frames: int  # states reached
    verified: int  # of these, as recorded
    divergence: Optional[Divergence]
    differences: list  # FieldDifference by FieldDifference, where fields were chosen
    updated: bool
    text: str

    def __str__(self):
        return self.text


class Table(dict):
    """Columns by their names: "time" (n seconds since the log's start), and "NODE.field" (n rows) each.

    Numbers are arrays of n, n x 3 and so on; texts, nodes and MF fields arrays of objects. Rows of states in which the
    node was not there are NaN, or None. `types`: the type of each field.
    """

    def __init__(self, columns, types, parts):
        super().__init__(columns)
        self.types = types
        self._parts = parts

    def flat(self):
        """The same with one number a row in each column: "TRAIN.rotation" becomes "TRAIN.rotation.x" and so on."""
        columns = {}
        for name, column in self.items():
            parts = self._parts.get(name)
            rows = column.reshape(len(column), len(parts)) if parts else column
            columns.update({f"{name}.{part}": rows[:, i] for i, part in enumerate(parts)} if parts else {name: rows})
        return columns

    def frame(self):
        """A pandas DataFrame of flat(), with the times as its index; where there is only polars, one of that."""
        columns = self.flat()
        try:
            import pandas
        except ImportError:
            import polars
            return polars.DataFrame(columns)
        return pandas.DataFrame({name: column for name, column in columns.items() if name != "time"},
                                index=pandas.Index(columns["time"], name="time"))
