"""What a follower of a mirror does by polling: loops, also with asyncio, and waits."""
import asyncio
import collections
import time

from ._errors import Error

_WAIT = 0.5  # seconds of one wait for something to come


async def _readable(descriptors, seconds):
    """Waits until one of the file descriptors can be read, so many seconds at most."""
    loop = asyncio.get_running_loop()
    woken = loop.create_future()
    for descriptor in descriptors:
        loop.add_reader(descriptor, lambda: woken.done() or woken.set_result(None))
    try:
        await asyncio.wait([woken], timeout=seconds)
    finally:
        for descriptor in descriptors:
            loop.remove_reader(descriptor)
        woken.cancel()


class Following:
    """Needs poll(), verdicts(), _waiting, scene, in_step and server_left of what is derived from it."""

    _come = collections.deque()  # what loops have polled; one that was left early leaves the rest to the next

    def _polled(self, seconds):
        if not self._come:
            self._come = collections.deque(self.poll(seconds))
        while self._come:
            yield self._come.popleft()

    def __iter__(self):
        while True:
            yield from self._polled(_WAIT)
            if self._ended():
                return

    async def __aiter__(self):
        while True:
            for changes in self._polled(0):
                yield changes
            if self._ended():
                return
            await _readable(*self._waiting)

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
