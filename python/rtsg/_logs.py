"""Logs: their states one by one, and their fields as columns."""
from . import _rtsg
from ._types import Table


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
