"""The stand-in keeps to the protocol as Haply documents it, asked with a plain client."""

import json

import pytest
from clocks import Clock
from websockets.sync.client import connect

from asperity.realtime.devices.haply.fake_service import HOME, Cursor, FakeService, still_hand
from asperity.realtime.devices.haply.messages import force_message


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def service(clock):
    with FakeService(still_hand, clock=clock) as service:
        yield service


def plain(service):
    return connect(service.uri, compression=None, open_timeout=10)


def reply(client):
    return json.loads(client.recv(timeout=10))


def push(service, client, force, spelling="vector"):
    client.send(force_message(service.device_id, force, spelling).decode())
    return reply(client)


def test_the_inventory_comes_unasked_with_configuration(service):
    with plain(service) as client:
        inventory = reply(client)
    (entry,) = inventory["inverse3"]
    assert inventory["session_id"] == 1
    assert entry["config"]["basis"] == {"permutation": "XYZ"}
    position = entry["state"]["cursor_position"]
    assert tuple(position.values()) == pytest.approx(HOME)


def test_exactly_one_frame_for_each_message(service):
    with plain(service) as client:
        reply(client)
        with pytest.raises(TimeoutError):
            client.recv(timeout=0.05)  # nothing unasked
        for _ in range(5):
            client.send(force_message(service.device_id, (0, 0, 0)).decode())
        client.send("no JSON at all")  # also a message
        frames = [reply(client) for _ in range(6)]
        with pytest.raises(TimeoutError):
            client.recv(timeout=0.05)
    assert all("config" not in frame["inverse3"][0] for frame in frames)
    assert service.messages == 6


def test_the_whole_inventory_can_be_asked_for(service):
    with plain(service) as client:
        reply(client)
        client.send('{"session": {"force_render_full_state": {}}}')
        assert "config" in reply(client)["inverse3"][0]


@pytest.mark.parametrize("spelling", ["vector", "values"])
def test_both_spellings_of_a_force(service, spelling):
    with plain(service) as client:
        reply(client)
        state = push(service, client, (0.0, 0.5, 1.0), spelling)["inverse3"][0]["state"]
    assert state["current_cursor_force"] == {"x": 0.0, "y": 0.5, "z": 1.0}
    assert state["control_mode"] == "force"


def test_a_command_does_not_last(service, clock):
    with plain(service) as client:
        reply(client)
        push(service, client, (0.0, 0.0, 1.0))
        assert service.force() == (0.0, 0.0, 1.0)
        clock.now += 0.03
        assert service.force() == (0.0, 0.0, 0.0)
        client.send("{}")
        state = reply(client)["inverse3"][0]["state"]
    assert state["control_mode"] == "idle"
    assert state["current_cursor_force"] == {"x": 0.0, "y": 0.0, "z": 0.0}


def test_forces_of_several_clients_add(service):
    with plain(service) as one, plain(service) as two:
        reply(one), reply(two)
        push(service, one, (0.5, 0.0, 0.0))
        state = push(service, two, (0.25, 1.0, 0.0))["inverse3"][0]["state"]
    assert state["current_cursor_force"] == {"x": 0.75, "y": 1.0, "z": 0.0}


def test_the_cursor_obeys_newton():
    # A mass on the hand's spring under a constant force comes to rest at F / k.
    cursor = Cursor(still_hand, mass=0.2, stiffness=300.0, damping=6.0)
    for i in range(1, 1001):
        cursor.advance(1e-3 * i, (0.6, 0.0, 0.0))
    assert cursor.position[0] - HOME[0] == pytest.approx(0.6 / 300.0, rel=1e-3)
    # Free, from rest, it goes F t^2 / 2 m.
    cursor = Cursor(still_hand, mass=0.2, stiffness=0.0, damping=0.0)
    for i in range(1, 101):
        cursor.advance(1e-3 * i, (0.0, 0.6, 0.0))
    assert cursor.position[1] - HOME[1] == pytest.approx(0.5 * 0.6 / 0.2 * 0.1**2, rel=5e-3)
    assert cursor.velocity[1] == pytest.approx(0.6 / 0.2 * 0.1, rel=5e-3)
