"""Serving a scene in real time."""
import time


def serve(scene, endpoint="tcp://127.0.0.1:*", *, seconds=float("inf"), fps=60.0, started=None, **options):
    """Serves a scene and runs it in real time, from its present time on, for `seconds` or until Ctrl-C.

    `started` is called with the Server once it listens: for its endpoint. `options` are those of Scene.serve().
    """
    with scene.serve(endpoint, **options) as server:
        if started:
            started(server)
        begin, first, number = time.monotonic(), scene.now, 0
        while number / fps <= seconds:
            scene.frame(first + number / fps)
            number += 1
            while (left := begin + number / fps - time.monotonic()) > 0:
                server.wait(left)
                server.service()
        server.drain()
