"""A recorded session as a test: door.rlog lies beside this file, and door.x3dv.

    rtsg record door.x3dv -o door.rlog --for 3s --set PRESSED.set_boolean=TRUE@0.5
    pytest test_door.py
"""


def test_the_door_opens_as_it_did(rtsg_replay):
    angles = []
    rtsg_replay("door.rlog", fields=["DOOR.*", "LAMP.on"], tolerance=1e-4,
                check=lambda scene: angles.append(scene["DOOR"].rotation[3]))
    assert max(angles) > 1.3
