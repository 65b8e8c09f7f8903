"""Logs: their states one by one, and their fields as columns."""
import csv

import numpy as np

from . import _rtsg

_COMPONENTS = {"SFVec2f": "xy", "SFVec2d": "xy", "SFVec3f": "xyz", "SFVec3d": "xyz", "SFVec4f": "xyzw", "SFVec4d": "xyzw",
               "SFColor": "rgb", "SFColorRGBA": "rgba", "SFRotation": ("x", "y", "z", "angle")}


class Table(dict):
    """Columns by their names: "time" (n seconds since the log's start), and "NODE.field" (n rows) each.

    Numbers are arrays of n, n x 3 and so on; texts, nodes and MF fields arrays of objects. Rows of states in which the
    node was not there are NaN, or None. `types`: the type of each field.
    """

    def __init__(self, columns, types):
        super().__init__(columns)
        self.types = types

    def flat(self):
        """The same with one number a row in each column: "TRAIN.rotation" becomes "TRAIN.rotation.x" and so on."""
        columns = {}
        for name, column in self.items():
            if column.ndim == 1:
                columns[name] = column
                continue
            rows = column.reshape(len(column), int(np.prod(column.shape[1:])))
            words = _COMPONENTS.get(self.types[name])
            for i in range(rows.shape[1]):
                columns[f"{name}.{words[i] if words else i}"] = rows[:, i]
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

    def write_csv(self, path):
        """Writes flat() as CSV, numbers as the shortest text that reads back as the same."""
        columns = self.flat()
        with open(path, "w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(columns)
            writer.writerows(zip(*(column.tolist() if column.dtype.kind == "O" else map(str, column)
                                   for column in columns.values())))


class Log(_rtsg.Log):
    """A log, and `scene`, which is brought to any state of it: at first to the first one.

    Urls of the scene may open files below the log's folder and the working one, or below `base`. What is damaged is
    skipped, and a warning says so once.
    """

    def states(self, *, start=0.0, stop=float("inf"), every=1):
        """Goes through the states from `start` to `stop` (seconds since the log's start), every one or every so many.

        `scene` is in the state; what is yielded is the ChangeSet that led to it from the state before.
        """
        if every < 1:
            raise ValueError("every is 1 or more")
        number, more = 0, self._seek_first(start)
        while more and self.time <= stop + 1e-6:
            if number % every == 0:
                yield self.changes
            number += 1
            more = self.step()

    def table(self, *paths, start=0.0, stop=float("inf"), every=1):
        """A Table of fields: "TRAIN.rotation", "DOOR.*", "#12.translation"; one row for each state, or every so many.

        Raises NoSuchName for a path that no state has. The log's scene stays in its state.
        """
        return Table(*self._table(list(paths), start, stop, every))
