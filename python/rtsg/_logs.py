"""Logs: their states one by one, and their fields as columns."""
from . import _rtsg


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
