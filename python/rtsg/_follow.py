"""Following a scene that is served elsewhere, in a loop or with asyncio."""
import asyncio
import time

from . import _rtsg
from ._errors import Error

_WAIT = 0.5  # seconds of one wait for something to come
_NAP = (0.001, 0.01)  # with asyncio: pauses between two looks, soon after something came and later on


class Follower(_rtsg.Follower):
    """A scene that is served elsewhere, followed: `for changes in follower` or `async for changes in follower`.

    `scene` is the replica, in the newest state that has come; `changes` come one by one, in order. A loop ends when the
    server says goodbye, or after close(). Only the thread that made it may use it.
    """

    def __iter__(self):
        while True:
            for changes in self.poll(_WAIT):
                yield changes
            if self._ended():
                return

    async def __aiter__(self):
        nap = _NAP[0]
        while True:
            came = self.poll(0)
            for changes in came:
                yield changes
            if self._ended():
                return
            nap = _NAP[0] if came else min(2 * nap, _NAP[1])
            await asyncio.sleep(nap)

    def _ended(self):
        return self.scene.closed or self.server_left

    def wait_for(self, request, timeout=10.0):
        """Waits for what becomes of a request: its Verdict. Raises Error if it is refused, or takes too long.

        Sets of changes that come meanwhile are applied, and not handed out again; verdicts on other requests neither.
        """
        end = time.monotonic() + timeout
        while True:
            for verdict in self.verdicts():
                if verdict.request == request:
                    if verdict.refusal:
                        raise Error(f"request {request} was refused: {verdict.refusal}", code="mirror")
                    return verdict
            if time.monotonic() >= end:
                raise Error(f"no verdict on request {request} within {timeout:g} s", code="mirror")
            self.poll(min(_WAIT, end - time.monotonic()))

    def wait(self, timeout=10.0, *, number=0):
        """Waits until the replica is in the newest state that was heard of, or in that of this `number` or a later one.

        Returns its scene. Raises Error after `timeout` seconds.
        """
        end = time.monotonic() + timeout
        while not (self.in_step and self.scene.number >= max(number, 1)):
            if time.monotonic() >= end:
                raise Error(f"not in step with the origin after {timeout:g} s", code="mirror")
            self.poll(min(_WAIT, max(0.0, end - time.monotonic())))
        return self.scene


def follow(endpoint, *, name="", keys="", parts=(), latency=0.0, base=""):
    """Follows a scene that is served at a ZeroMQ endpoint: a Follower.

    `name`: the author of what it asks for. `keys`: a key file. `parts`: only these subtrees, or a region
    ("region:VIEWER,20"). `latency`: seconds by which frames are held back, so that they come as evenly as they were made.
    `base`: the folder whose files urls of the scene may open here; none: they open nothing.
    """
    return Follower(endpoint, name=name, keys=keys, parts=list(parts), latency=latency, base=str(base))
