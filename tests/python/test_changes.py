"""Subscribers that are functions: what they get, when, and what becomes of those that raise."""
import pytest

import rtsg


def test_a_subscriber_gets_a_snapshot_then_every_frame(moving):
    seen = []
    subscription = moving.subscribe(lambda changes: seen.append((changes.is_snapshot, changes.number, changes.time)))
    moving.frame(0)
    moving.frame(.5)
    assert [one[0] for one in seen] == [True, False, False]
    assert [one[1] for one in seen] == sorted(one[1] for one in seen) and seen[-1][2] == .5
    subscription.close()
    moving.frame(1)
    assert len(seen) == 3 and not subscription.active


def test_the_changes_of_a_frame(moving):
    moving.frame(0)
    changes = moving.frame(.5)
    by_path = {change.path: change for change in changes if change.kind == "set_field"}
    assert by_path["BOX.translation"].value.tolist() == [1, 0, 0]
    assert changes["BOX.translation"].tolist() == [1, 0, 0] and "BOX.rotation" not in changes
    assert changes.get("BOX.rotation") is None
    assert by_path["BOX.translation"].node == moving["BOX"] and by_path["BOX.translation"].field == "translation"
    assert not by_path["BOX.translation"].external
    with pytest.raises(KeyError):
        changes["BOX.rotation"]
    with pytest.raises(rtsg.NoSuchName):
        changes["NOBODY.rotation"]


def test_nodes_that_come_and_go(moving):
    moving.frame(0)
    lamp, = moving.add("DEF LAMP PointLight { }")
    kinds = {change.kind: change for change in moving.frame(.1)}
    assert kinds["create_node"].node == lamp and kinds["insert_child"].other == lamp and kinds["insert_child"].external
    assert kinds["set_name"].value == "LAMP"
    moving.remove(lamp)
    gone = [change for change in moving.frame(.2) if change.kind == "destroy_node"]
    assert [change.node for change in gone] == [lamp] and gone[0].field is None


def test_a_set_that_is_kept_stays_as_it_was(moving):
    kept = []
    moving.subscribe(kept.append)
    for k in range(5):
        moving.frame(k / 4)
    assert [changes.number for changes in kept] == list(range(1, 7))
    assert [changes["BOX.translation"][0] for changes in kept[2:]] == [.5, 1, 1.5, 2]
    one = kept[3][0]
    del kept[:]
    assert one.kind == "set_field"


def test_what_a_subscriber_raises_comes_out_of_the_frame_after_all_had_their_turn(moving):
    heard = []

    def fails(changes):
        if not changes.is_snapshot:
            raise LookupError("mine")

    first = moving.subscribe(fails)
    moving.subscribe(lambda changes: heard.append(changes.time))
    with pytest.raises(LookupError, match="mine"):
        moving.frame(1)
    assert moving.now == 1 and heard[-1] == 1  # the frame is complete
    assert not first.active and isinstance(first.error, LookupError)
    moving.frame(2)  # it is called no more
    assert heard[-1] == 2


def test_one_that_raises_at_once_is_not_attached(moving):
    def fails(_):
        raise ValueError("at once")

    with pytest.raises(ValueError, match="at once"):
        moving.subscribe(fails)
    moving.frame(0)


def test_a_subscriber_may_edit_run_frames_and_end_itself(moving):
    times = []

    def edits(changes):
        times.append(changes.time)
        if changes.time == 1:
            moving["PAINT"].diffuseColor = 0, 0, 1
            moving.frame(1.5)
        if changes.time >= 1.5:
            subscription.close()

    subscription = moving.subscribe(edits)
    moving.frame(1)
    assert times == [0, 1, 1.5] and moving["PAINT"].diffuseColor.tolist() == [0, 0, 1]


def test_frames_without_end_are_refused(moving):
    moving.frame(0)
    subscription = moving.subscribe(lambda changes: None if changes.is_snapshot else moving.frame(moving.now))
    with pytest.raises(rtsg.Error) as raised:
        moving.frame(1)
    assert raised.value.code == "from-within"
    subscription.close()
    moving.frame(2)


def test_edits_without_a_frame_are_sealed(moving):
    moving.frame(0)
    assert moving.seal() is None
    moving["BOX"].scale = 2, 2, 2
    assert moving.seal()["BOX.scale"].tolist() == [2, 2, 2]
    assert moving.snapshot().is_snapshot
