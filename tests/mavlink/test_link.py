"""The link: which vehicle it hears and speaks to, signatures, losses, and requests."""

import pytest

from mpucal.clocks import S
from mpucal.errors import BusError, LinkError, NoAnswer, UsageError
from mpucal.mavlink.link import OWN_COMPONENT, OWN_SYSTEM, Link
from mpucal.mavlink.requests import send_command
from mpucal.mavlink.vehicle_source import choose_vehicle

KEY = b"k" * 32
HOME, STRANGER = "10.0.0.2:14555", "10.0.0.66:999"


def heartbeats(vehicle, address, seconds=10):
    return [(0.5 + k, address, vehicle.heartbeat()) for k in range(seconds)]


def in_order(*arriving):
    return sorted([packet for packets in arriving for packet in packets], key=lambda packet: packet[0])


def unlocked(transport, key=None):
    return Link(transport, lambda t_ns, data: None, key)


def locked(transport, key=None):
    """Return a link locked to the only vehicle, and the packets that it records."""
    record = []
    link = Link(transport, lambda t_ns, data: record.append((t_ns, data)), key)
    link.lock(choose_vehicle(link.listen(), None))
    return link, record


def test_a_link_only_reads_until_it_is_locked_and_then_sends_a_heartbeat_a_second(script, station, decoded):
    transport = script(heartbeats(station(), HOME))
    link = unlocked(transport)
    (vehicle,) = link.listen()
    assert (vehicle.address, vehicle.system, link.now_ns()) == (HOME, 1, 2 * S)
    assert transport.sent == []
    link.lock(vehicle)
    assert len(list(link.messages(8 * S))) == 6
    assert [address for _, address, _ in transport.sent] == [HOME] * 6
    beat = decoded(transport.sent[0][2])
    assert (beat.get_type(), beat.type, beat.get_srcSystem()) == ("HEARTBEAT", 6, OWN_SYSTEM)


def test_a_flood_is_named_and_ends_no_later(script, station):
    noise = [(k / 120, HOME, bytes([k % 256]) * 1000) for k in range(600)]
    with pytest.raises(BusError, match=r"is flooded.*within 6 s"):
        unlocked(script(noise, outward=True, datagrams=False)).listen()
    junk = [(k / 1000, f"10.0.{k % 200}.1:{k}", b"no packet") for k in range(60_000)]
    link = unlocked(script(junk))
    with pytest.raises(LinkError, match=r"a script is flooded: \d+ pieces came within 6 s that are no vehicle's"):
        link.listen()
    assert link.now_ns() == 6 * S
    link, _ = locked(script(in_order(heartbeats(station(), HOME), junk)))
    heard = list(link.messages(4 * S))
    assert (len(heard), link.now_ns()) == (2, 4 * S)


def test_several_vehicles_end_with_their_list(script, station):
    both = in_order(heartbeats(station(1), HOME), heartbeats(station(7, autopilot=12), STRANGER))
    vehicles = unlocked(script(both)).listen()
    listed = rf"several vehicles: system 1 \(ArduPilot\) at {HOME}, system 7 \(PX4\) at {STRANGER}: choose one with"
    for given, system, words in (
        (vehicles, None, listed),
        (vehicles, 9, "no vehicle is system 9"),
    ):
        with pytest.raises(UsageError, match=words):
            choose_vehicle(given, system)
    assert choose_vehicle(vehicles, 7).address == STRANGER
    twice = in_order(heartbeats(station(), HOME), heartbeats(station(), STRANGER))
    with pytest.raises(UsageError, match="stop the other"):
        choose_vehicle(unlocked(script(twice)).listen(), 1)


@pytest.mark.parametrize("stations", [False, True], ids=["nobody", "ground stations"])
def test_a_partner_that_was_named_is_spoken_to_at_once_and_no_vehicle_there_is_one_sentence(script, station, stations):
    beat = station(255, 190).message("heartbeat", 6, 8, 0, 0, 4)
    transport = script([(0.5 + k, HOME, beat) for k in range(9)] if stations else [], outward=True)
    with pytest.raises(NoAnswer, match="no autopilot's heartbeat came over a script within 6 s: power the vehicle"):
        unlocked(transport).listen()
    assert [(t, address) for t, address, _ in transport.sent[:2]] == [(0.0, None), (1.0, None)]


def test_a_vehicle_that_comes_back_at_another_port_is_found_there_once_it_is_sought(script, station, decoded):
    moved, neighbour = "10.0.0.2:40001", "10.0.0.2:999"
    after = [(20.5 + k, moved, station().heartbeat()) for k in range(10)]
    others = [(20.2 + k, neighbour, station(7).heartbeat()) for k in range(10)]
    elsewhere = [(20.1 + k, STRANGER, station().heartbeat()) for k in range(10)]
    transport = script(in_order(heartbeats(station(), HOME, 3), after, others, elsewhere))
    link, record = locked(transport)
    assert len(list(link.messages(22 * S))) == 1
    link.seek()
    assert len(list(link.messages(26 * S))) == 4
    assert link.vehicle.address == moved
    assert transport.sent[-1][1] == moved
    assert {decoded(data).get_srcSystem() for _, data in record} == {1, OWN_SYSTEM}


@pytest.mark.parametrize("key", [None, KEY], ids=["unsigned", "signed"])
def test_a_stranger_changes_nothing(script, station, key):
    vehicle, forger = station(key=key), station(key=key)
    forger.mav.signing.timestamp = 1 << 47
    own = heartbeats(vehicle, HOME, 2) + [(2 + 0.02 * k, HOME, vehicle.raw(20_000 * k)) for k in range(100)]
    forged = [(2 + 0.02 * k, STRANGER, forger.raw(20_000 * k, acc=(9, 9, 9))) for k in range(100)]
    cut = [(2.01 + 0.02 * k, STRANGER, forger.raw(k)[:-4]) for k in range(100)]
    # Of these, the capture keeps a record, but no message is returned.
    gimbal = [(3.1, HOME, station(1, component=154, key=key).raw(1)), (3.2, HOME, station(3, key=key).raw(1))]
    heard = []
    for arriving in (own, in_order(own, forged, cut, gimbal)):
        link, record = locked(script(arriving), key)
        heard.append([m.to_dict() for m in link.messages(5 * S)])
    assert len(heard[0]) == 100
    assert heard[0] == heard[1]
    assert {(data[5], data[6]) for _, data in record} == {(1, 1), (1, 154), (3, 1), (OWN_SYSTEM, OWN_COMPONENT)}
    assert [t_ns for t_ns, _ in record] == sorted(t_ns for t_ns, _ in record)


def test_a_forged_signature_of_a_later_time_outdates_no_true_one(script, station):
    vehicle, forger = station(key=KEY), station(key=b"x" * 32)
    forger.mav.signing.timestamp = 1 << 47
    begun = heartbeats(vehicle, HOME, 2)
    own = [(2 + 0.02 * k, HOME, vehicle.raw(20_000 * k)) for k in range(100)]
    forged = [*heartbeats(forger, STRANGER, 2), (2.01, HOME, forger.raw(1, acc=(9, 9, 9)))]
    link, _ = locked(script(in_order(begun, own, forged)), KEY)
    assert link.vehicle.address == HOME
    heard = [message for message in link.messages(5 * S) if message.get_type() == "RAW_IMU"]
    assert [message.time_usec for message in heard] == [20_000 * k for k in range(100)]


def test_a_wrong_signing_key_is_named(script, station):
    with pytest.raises(LinkError, match="none is signed with the key of --signing-key"):
        unlocked(script(heartbeats(station(key=KEY), HOME)), b"x" * 32).listen()


def test_a_signed_vehicle_with_a_stopped_clock_is_accepted(script, station):
    vehicle, now_s = station(key=KEY), 1_750_000_000
    vehicle.mav.signing.timestamp = 7
    transport = script([(now_s + 0.5, HOME, vehicle.heartbeat())])
    transport._now_ns = now_s * S
    assert len(unlocked(transport, KEY).listen()) == 1


def test_we_sign_no_earlier_than_the_vehicle(script, station, decoded):
    vehicle = station(key=KEY)
    vehicle.mav.signing.timestamp = ahead = 1 << 44
    transport = script(heartbeats(vehicle, HOME))
    link, _ = locked(transport, KEY)
    list(link.messages(5 * S))
    assert transport.sent
    assert all(decoded(data).get_header().incompat_flags & 1 for _, _, data in transport.sent)
    # MAVLink 2 signing: link id, 6 bytes of time, 6 of signature at the packet's end
    assert all(int.from_bytes(data[-12:-6], "little") >= ahead for _, _, data in transport.sent)


def test_a_loop_that_is_left_early_loses_no_message(script, station):
    vehicle = station()
    burst = b"".join(vehicle.raw(10_000 * k) for k in range(20))
    link, _ = locked(script([*heartbeats(vehicle, HOME, 2), (3.0, HOME, burst)], datagrams=False))
    times, heard = [], []
    link.subscribe(lambda message: heard.append(message.get_type()))
    while len(times) < 20:
        for message in link.messages(4 * S):
            times.append(message.time_usec)
            break
    assert times == [10_000 * k for k in range(20)]
    assert len(heard) == 20


@pytest.mark.parametrize(
    ("come", "lost"),
    [
        pytest.param([(0.1 * i, k) for i, k in enumerate([0, 1, 4, 3, 5, 5, 9])], 4, id="2, 6, 7 and 8"),
        pytest.param([(0.0, 0), (0.9, 201)], 200, id="a long burst"),
        pytest.param([(0.0, 0), (2.5, 77), (2.6, 79)], 1, id="a reboot, and 78"),
    ],
)
def test_lost_packets_are_counted_and_late_or_silent_ones_are_not(script, station, come, lost):
    vehicle = station()
    heartbeat, packets = vehicle.heartbeat(), [vehicle.raw(k) for k in range(256)]
    arriving = [(3.0 + t, HOME, packets[k]) for t, k in come]
    link, _ = locked(script([(0.5, HOME, heartbeat), *arriving]))
    list(link.messages(9 * S))
    assert link.lost == lost


def test_a_request_is_repeated_until_its_own_answer(script, station, decoded):
    vehicle, asked = station(), []
    transport = script(heartbeats(vehicle, HOME, 20))

    def answer(data):
        if decoded(data).get_type() != "COMMAND_LONG":
            return []
        asked.append(data)
        # to the first only another command's answer, then nothing, then the right one after a "wait"
        ack = {1: [(400, 0)], 2: [], 3: [(511, 5), (511, 4)]}[len(asked)]
        return [vehicle.message("command_ack", *fields) for fields in ack]

    transport.answer = answer
    link, _ = locked(transport)
    assert send_command(link, 511, 27, 10_000) == 4
    assert len(asked) == 3
