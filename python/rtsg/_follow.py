"""Following a scene that is served elsewhere, in a loop or with asyncio."""
from . import _rtsg
from ._following import Following


class Follower(Following, _rtsg.Follower):
    """A scene that is served elsewhere, followed: `for changes in follower` or `async for changes in follower`.

    `scene` is the replica, in the newest state that has come; `changes` come one by one, in order. A loop ends when the
    server says goodbye, or after close(). Only the thread that made it may use it.
    """


def follow(endpoint, *, name="", keys="", parts=(), latency=0.0, base=""):
    """Follows a scene that is served at a ZeroMQ endpoint, or that a NATS server passes on (nats://HOST:PORT/NAME): a Follower.

    `name`: the author of what it asks for. `keys`: a key file. `parts`: only these subtrees, or a region
    ("region:VIEWER,20"). `latency`: seconds by which frames are held back, so that they come as evenly as they were made.
    `base`: the folder whose files urls of the scene may open here; none: they open nothing.
    """
    return Follower(endpoint, name=name, keys=keys, parts=list(parts), latency=latency, base=str(base))
