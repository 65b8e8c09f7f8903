"""Listening: samples, figures with intervals, and responses."""
import json

import numpy as np
import pytest

import rtsg
from conftest import ROOT


@pytest.fixture
def room():
    return rtsg.load(ROOT / "examples/room.x3dv")


def test_figures_of_a_room_have_intervals(room):
    room.frame(0)
    sound = room.listen(0, rays=2000, responses=True, channels="mono")
    assert sound.samples.shape[0] == 0
    source = sound.sources[0]
    assert source["T30_s"].shape == source["ci95"]["T30_s"].shape == source["bands_hz"].shape == (10,)
    assert abs(source["T30_s"][5] - .52) < .1 and 0 < source["ci95"]["T30_s"][5] < .1  # Eyring: .52
    assert room.now == 0  # measuring runs nothing
    response = sound.impulse_responses(16000)
    assert response.shape[1] == len(sound.sources) and np.abs(response).max() > 0
    assert json.loads(sound.json())["rays"] == sound.rays >= 2000


def test_listening_runs_the_scene_on(room, tmp_path):
    times = []
    room.subscribe(lambda changes: times.append(changes.time))
    room.frame(0)
    sound = room.listen(.25, fps=20, metrics=False, channels="binaural", sample_rate=16000)
    assert sound.samples.shape == (4000, 2) and sound.samples.dtype == np.float32 and sound.sample_rate == 16000
    assert np.abs(sound.samples).max() > 0 and room.now == .25 and times[-1] == .25
    samples = sound.samples
    sound.write(str(tmp_path / "a.wav"))
    del sound
    assert np.isfinite(samples).all()
    assert (tmp_path / "a.wav").stat().st_size > 4000


def test_what_a_subscriber_raises_ends_the_listening(room):
    def fails(changes):
        if changes.time > .1:
            raise LookupError("enough")

    room.frame(0)
    room.subscribe(fails)
    with pytest.raises(LookupError, match="enough"):
        room.listen(1, metrics=False)
    assert .1 < room.now < .2


def test_wrong_words(room):
    with pytest.raises(ValueError, match="ambisonic7"):
        room.listen(1, channels="surround")
    with pytest.raises(rtsg.Error, match="frame rate"):
        room.listen(1, fps=0)
