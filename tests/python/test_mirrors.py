"""Mirrors: followers in loops and with asyncio, edits, locks and undo upstream, servers."""
import asyncio
import os
import shutil
import socket
import subprocess
import threading
import time

import pytest

import rtsg
from conftest import MOVING


class Origin:
    """A scene that is served by a thread of its own: so many frames once so many peers are there, or until it is left."""

    def __init__(self, frames=None, peers=0, **options):
        self.options, self.frames, self.peers = options, frames, peers
        self.stop, self.ready = threading.Event(), threading.Event()
        self.thread = threading.Thread(target=self.run)

    def run(self):
        scene = rtsg.loads(MOVING)
        with scene.serve(**self.options) as server:
            self.endpoint = server.endpoint
            self.ready.set()
            while server.statistics["peers"] < self.peers and not self.stop.is_set():
                server.wait(.01)
                server.service()
            number = 0
            while not self.stop.is_set() and number != self.frames:
                scene.frame(number / 60)
                number += 1
                server.wait(1 / 60)
            server.drain()
            self.hash, self.statistics = scene.hash, server.statistics

    def __enter__(self):
        self.thread.start()
        assert self.ready.wait(60)
        return self

    def __exit__(self, *_):
        self.stop.set()
        self.thread.join()


def test_a_follower_gets_every_frame_and_the_origins_hash():
    with Origin(frames=60, peers=1) as origin:
        follower = rtsg.follow(origin.endpoint)
        numbers = [changes.number for changes in follower]  # ends when the server says goodbye
    assert numbers == list(range(numbers[0], numbers[-1] + 1))
    assert follower.scene.hash == origin.hash and follower.statistics["divergences"] == 0
    assert follower.scene["BOX"].translation[0] > 0 and follower.server_left


def test_a_follower_is_an_asynchronous_iterator():
    async def follow(endpoint):
        count = 0
        async for changes in rtsg.follow(endpoint):
            count += len(changes) > 0
        return count

    async def both(endpoint):
        return await asyncio.gather(follow(endpoint), follow(endpoint))

    with Origin(frames=40, peers=2) as origin:
        counts = asyncio.run(both(origin.endpoint))
    assert min(counts) > 10


def test_asyncio_waits_on_descriptors(moving, monkeypatch):
    """Nothing is looked at in turns: there are few polls while nothing comes."""
    polls = []
    poll = rtsg.Follower.poll

    def counted(follower, timeout=0):
        polls.append(timeout)
        return poll(follower, timeout)

    async def follow(server):
        follower = rtsg.follow(server.endpoint)
        follower.wait()
        monkeypatch.setattr(rtsg.Follower, "poll", counted)
        states = follower.__aiter__()
        ahead = asyncio.ensure_future(states.__anext__())
        await asyncio.sleep(1)
        quiet = len(polls)
        for k in range(1, 6):
            moving.frame(k)
            while (await ahead).time < k:
                ahead = asyncio.ensure_future(states.__anext__())
            ahead = asyncio.ensure_future(states.__anext__())
            await asyncio.sleep(0)
        ahead.cancel()
        return quiet

    moving.frame(0)
    with moving.serve() as server:
        quiet = asyncio.run(follow(server))
    assert quiet < 60


def test_a_loop_that_was_left_loses_nothing(moving):
    async def some(follower, count):
        states = []
        async for changes in follower:
            states.append(changes.number)
            if len(states) == count:
                return states

    with moving.serve() as server, rtsg.follow(server.endpoint) as follower:
        moving.frame(0)
        follower.wait()
        for k in range(1, 10):
            moving.frame(k)
        time.sleep(.2)
        numbers = [next(iter(follower)).number for _ in range(3)] + asyncio.run(some(follower, 3)) + asyncio.run(some(follower, 2))
    assert numbers == list(range(numbers[0], numbers[0] + 8))


def test_the_origin_and_its_follower_on_one_thread(moving):
    with moving.serve() as server, rtsg.follow(server.endpoint) as follower:
        moving.frame(0)
        replica = follower.wait()
        for k in range(1, 10):
            moving.frame(k / 10)
        assert follower.wait(number=moving.number).hash == moving.hash
        assert replica["BOX"].translation.tolist() == moving["BOX"].translation.tolist()


def test_edits_events_undo_and_locks_go_upstream():
    with Origin(upstream="edits") as origin, rtsg.follow(origin.endpoint, name="anna") as anna, \
            rtsg.follow(origin.endpoint, name="bert") as bert:
        scene = anna.wait()
        verdict = anna.wait_for(anna.edit("PAINT.diffuseColor", (0, 1, 0)))
        assert verdict.refusal == "" and scene["PAINT"].diffuseColor.tolist() == [0, 1, 0]
        anna.wait_for(anna.undo())
        assert scene["PAINT"].diffuseColor.tolist() == [1, 0, 0]
        anna.wait_for(anna.redo())
        anna.wait_for(anna.send("CLOCK.enabled", False))
        assert scene["CLOCK"].enabled is False
        anna.wait_for(anna.lock(["PAINT"], 30))
        bert.wait()
        with pytest.raises(rtsg.Error, match="refused"):
            bert.wait_for(bert.edit("PAINT.diffuseColor", (0, 0, 0)))
        anna.wait_for(anna.lock(["PAINT"], 0))
        bert.wait_for(bert.edit("PAINT.diffuseColor", (0, 0, 0)))


def test_who_may_not_write_is_told():
    with Origin() as origin, rtsg.follow(origin.endpoint) as follower:
        scene = follower.wait()
        with pytest.raises(rtsg.Error, match="refused"):
            follower.wait_for(follower.edit("PAINT.diffuseColor", (0, 1, 0)))
        with pytest.raises(rtsg.Error, match="Follower.edit"):
            scene["PAINT"].diffuseColor = 0, 1, 0
        with pytest.raises(rtsg.Error, match="follows"):
            scene.frame(1)
        with pytest.raises(TypeError):
            follower.edit("PAINT.diffuseColor", "green")
        with pytest.raises(rtsg.NoSuchName):
            follower.edit("NOBODY.diffuseColor", (0, 0, 0))


def test_a_replica_has_subscribers_and_pictures(moving):
    with moving.serve() as server, rtsg.follow(server.endpoint) as follower:
        seen = []
        follower.scene.subscribe(lambda changes: seen.append(changes.number))
        moving.frame(0)
        follower.wait(number=moving.number)
        picture = follower.scene.render(width=32, height=18)
        assert (picture == moving.render(width=32, height=18)).all() and seen[-1] == follower.scene.number

        def fails(changes):
            raise LookupError("mine")

        with pytest.raises(LookupError):
            follower.scene.subscribe(fails)


def test_what_cannot_be(moving):
    with pytest.raises(rtsg.Error):
        moving.serve("nonsense")
    with pytest.raises(rtsg.Error, match="keys"):
        moving.serve("tcp://0.0.0.0:*")
    with pytest.raises(ValueError, match="upstream"):
        moving.serve(upstream="all")
    with pytest.raises(rtsg.Error):
        rtsg.follow("nonsense")
    with pytest.raises(rtsg.Error, match="not in step"):
        rtsg.follow("tcp://127.0.0.1:1").wait(.2)
    server = moving.serve()
    server.close()
    with pytest.raises(rtsg.Closed):
        server.endpoint
    server.close()


def test_a_closed_scene_ends_its_server_and_a_closed_follower_its_loop(moving):
    server = moving.serve()
    follower = rtsg.follow(server.endpoint)
    moving.close()
    with pytest.raises(rtsg.Closed):
        server.statistics
    follower.close()
    with pytest.raises(rtsg.Closed):
        follower.poll()


def test_a_scene_served_in_real_time(moving):
    endpoints = []
    rtsg.serve(moving, seconds=.3, fps=30, started=lambda server: endpoints.append(server.endpoint))
    assert endpoints[0].startswith("tcp://127.0.0.1:") and moving.now == pytest.approx(.3)


def test_what_a_nats_server_passes_on_is_followed(tmp_path):
    program, nats = os.environ.get("RTSG_PROGRAM"), shutil.which("nats-server", path=os.environ["PATH"] + ":/usr/sbin:/usr/local/bin")
    if not program or not nats:
        pytest.skip("needs the program rtsg and nats-server")
    with pytest.raises(rtsg.Error, match="ends with /NAME"):
        rtsg.follow("nats://127.0.0.1:4222")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    scene, address = tmp_path / "moving.x3dv", f"nats://127.0.0.1:{port}/hall"
    scene.write_text(MOVING)
    running = [subprocess.Popen([nats, "-a", "127.0.0.1", "-p", str(port)], stderr=subprocess.DEVNULL)]
    try:
        for _ in range(600):
            with socket.socket() as attempt:
                if attempt.connect_ex(("127.0.0.1", port)) == 0:
                    break
            time.sleep(.05)
        running.append(subprocess.Popen([program, "serve", scene, "--nats", address, "--json", "--for", "60s"], stdout=subprocess.PIPE, text=True))
        first = running[1].stdout.readline()
        if not first:
            pytest.skip("built without libnats")
        with rtsg.follow(address) as follower:
            for count, _ in enumerate(follower):
                if count == 20:
                    break
            assert follower.statistics["equal"] and follower.statistics["divergences"] == 0
            assert follower.scene["BOX"].translation[0] > 0
        with pytest.raises(rtsg.Error, match="keys are for ZeroMQ"):
            keys = tmp_path / "keys"
            subprocess.run([program, "keys", keys, "--client", tmp_path / "client"], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            rtsg.follow(address, keys=str(tmp_path / "client"))
    finally:
        for process in reversed(running):
            process.terminate()
            process.wait()
