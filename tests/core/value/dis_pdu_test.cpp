// PDUs against bytes that were written by hand from the tables of IEEE 1278.1-2012, and bytes that are no PDUs.
//
// By hand, in November 2026, against open-dis-python (b9c4cd0): it reads such Entity State, Fire, Detonation,
// Collision, Remove Entity and Transmitter PDUs and writes the same bytes; of Signals all but the padding, which it
// leaves out, and of Receivers it leaves out whose radio it is. Its three recorded PDUs of these types are read and
// written byte for byte.
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include <rtsg/core/dis_pdu.h>

namespace rtsg::dis {

namespace {

std::vector<std::uint8_t> hexBytes(std::string_view text) {
    std::vector<std::uint8_t> bytes;
    std::string digits;
    for (const char c : text) {
        if (!std::isxdigit(static_cast<unsigned char>(c))) continue;
        digits += c;
        if (digits.size() < 2) continue;
        bytes.push_back(static_cast<std::uint8_t>(std::stoi(digits, nullptr, 16)));
        digits.clear();
    }
    return bytes;
}

std::string decodeError(std::span<const std::uint8_t> bytes) {
    const auto pdu = decode(bytes);
    return pdu ? "" : pdu.error().text;
}

/// Both ways.
template <class Body>
void expectBytes(std::string_view hex, const Header& header, const Body& body) {
    const std::vector<std::uint8_t> bytes = hexBytes(hex);
    EXPECT_EQ(encode({header, body}), bytes);
    const auto pdu = decode(bytes);
    ASSERT_TRUE(pdu) << pdu.error().text;
    EXPECT_EQ(pdu->header, header);
    ASSERT_TRUE(std::holds_alternative<Body>(pdu->body));
    EXPECT_TRUE(std::get<Body>(pdu->body) == body);
}

// A timestamp of 1800 s, absolute: 2^30 units times 2, and 1.
const Header kHalfHour{7, 3, 0x80000001, 0};
const std::string kIds = "0001 0002 0003  0004 0005 0006";

// Field by field, in the order of the tables; nothing of it comes from our own writer.
const std::string kEntityState =
    "07 03 01 01 80000001 00A0 00 00"  // 7.1.2: version, exercise, type, family, timestamp, length, status
    "0001 0002 0003  02 01"            // entity, force, 1 variable parameter
    "01 02 00E1 03 04 05 06"           // type
    "01 02 00E1 03 04 05 07"           // alternative type
    "3F800000 C0000000 3F000000"       // 1, -2, 0.5 m/s
    "4158541440000000 C05EDD2F1A9FBE77 0000000000000000"  // 6377553, -123.456, 0 m
    "3F800000 BF000000 40000000"                          // psi 1, theta -0.5, phi 2
    "00800000"                                            // appearance: deactivated
    "04 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00"     // RVW
    "00000000 BF800000 41200000"                          // 0, -1, 10 m/s2
    "3DCCCCCD 00000000 80000000"                          // 0.1, 0, -0 rad/s
    "01 54 41 4E 4B 2D 31 00 00 00 00 00"                 // "TANK-1"
    "00000005"                                            // capabilities
    "00 09 0007 00001005 3FC00000 00000000";              // an articulated part: 1.5

EntityState writtenState() {
    EntityState state;
    state.id = {1, 2, 3};
    state.force = 2;
    state.type = {1, 2, 225, 3, 4, 5, 6};
    state.alternativeType = {1, 2, 225, 3, 4, 5, 7};
    state.velocity = {1, -2, .5f};
    state.location = {6377553, -123.456, 0};
    state.orientation = {1, -.5f, 2};
    state.appearance = EntityState::kDeactivated;
    state.deadReckoning = 4;
    state.acceleration = {0, -1, 10};
    state.angularVelocity = {.1f, 0, -0.f};
    state.marking = "TANK-1";
    state.capabilities = 5;
    state.articulations = {{0, 9, 7, 0x1005, 1.5f}};
    return state;
}

}  // namespace

TEST(DisPdu, EntityState) {
    expectBytes(kEntityState, kHalfHour, writtenState());
}

TEST(DisPdu, Fire) {
    Fire fire;
    fire.firing = {1, 2, 3}, fire.target = {4, 5, 6}, fire.munition = {7, 8, 9};
    fire.event = {1, 2, 77};
    fire.mission = 0x01020304;
    fire.location = {1, 2, -4};
    fire.descriptor = {{2, 1, 225, 2, 1, 0, 0}, 1000, 100, 3, 600};
    fire.velocity = {100, 0, -1};
    fire.range = 2500;
    expectBytes("07 03 02 02 80000001 0060 00 00" + kIds +
                    "0007 0008 0009  0001 0002 004D  01020304"
                    "3FF0000000000000 4000000000000000 C010000000000000"
                    "02 01 00E1 02 01 00 00  03E8 0064 0003 0258"
                    "42C80000 00000000 BF800000  451C4000",
                kHalfHour, fire);
}

TEST(DisPdu, Detonation) {
    Detonation detonation;
    detonation.firing = {1, 2, 3}, detonation.target = {4, 5, 6}, detonation.munition = {7, 8, 9};
    detonation.event = {1, 2, 78};
    detonation.velocity = {1, 2, -2};
    detonation.location = {1, 2, -4};
    detonation.descriptor = {{2, 1, 225, 2, 1, 0, 0}, 1000, 100, 3, 600};
    detonation.relativeLocation = {.5f, 0, -1};
    detonation.result = 5;
    detonation.articulations = {{0, 1, 0, 4096, -2}};
    expectBytes("07 03 03 02 80000001 0078 00 00" + kIds +
                    "0007 0008 0009  0001 0002 004E  3F800000 40000000 C0000000"
                    "3FF0000000000000 4000000000000000 C010000000000000"
                    "02 01 00E1 02 01 00 00  03E8 0064 0003 0258"
                    "3F000000 00000000 BF800000  05 01 0000"
                    "00 01 0000 00001000 C0000000 00000000",
                kHalfHour, detonation);
}

TEST(DisPdu, CollisionsOfBothKinds) {
    Collision collision;
    collision.issuing = {1, 2, 3}, collision.colliding = {4, 5, 6};
    collision.event = {1, 2, 79};
    collision.type = 1;
    collision.velocity = {1, 0, -2};
    collision.mass = 1000;
    collision.location = {.5f, 0, 2};
    const std::string rest = "3F800000 00000000 C0000000  447A0000  3F000000 00000000 40000000";
    expectBytes("07 03 04 01 80000001 003C 00 00" + kIds + "0001 0002 004F 01 00" + rest, kHalfHour, collision);
    // Elastic: two bytes of padding, then the same, then what nobody here asks for.
    const auto elastic = decode(hexBytes("07 03 42 01 80000001 0064 00 00" + kIds + "0001 0002 004F 00 00" + rest +
                                         "00000000 00000000 00000000 00000000 00000000 00000000"
                                         "00000000 00000000 3F800000 3F000000"));
    ASSERT_TRUE(elastic) << elastic.error().text;
    EXPECT_TRUE(std::get<Collision>(elastic->body) == collision);
}

TEST(DisPdu, EntitiesThatComeAndGo) {
    expectBytes("07 03 0B 05 80000001 001C 00 00" + kIds + "0000002A", kHalfHour,
                CreateEntity{{1, 2, 3}, {4, 5, 6}, 42});
    expectBytes("06 03 0C 05 80000001 001C 00 00" + kIds + "0000002A", Header{6, 3, 0x80000001, 0},
                RemoveEntity{{1, 2, 3}, {4, 5, 6}, 42});
}

TEST(DisPdu, Transmitter) {
    Transmitter t;
    t.id = {1, 2, 3}, t.radio = 4;
    t.kind = 7, t.domain = 1, t.country = 225, t.category = 2, t.nomenclatureVersion = 3, t.nomenclature = 0x0405;
    t.state = 2, t.inputSource = 8;
    t.antennaLocation = {1, 2, -4};
    t.relativeAntennaLocation = {.5f, 0, -1};
    t.antennaPatternType = 1;
    t.frequency = 5'000'000'000;
    t.bandwidth = 25000, t.power = 40;
    t.spreadSpectrum = 1, t.majorModulation = 2, t.detail = 3, t.system = 4;
    t.cryptoSystem = 5, t.cryptoKey = 6;
    t.modulationParameters = {1, 2, 3, 4, 5, 6, 7, 8};
    t.antennaPattern = {9, 8, 7, 6, 5, 4, 3, 2};
    expectBytes(
        "07 03 19 04 80000001 0078 00 00  0001 0002 0003 0004  07 01 00E1 02 03 0405  02 08 0000"
        "3FF0000000000000 4000000000000000 C010000000000000  3F000000 00000000 BF800000"
        "0001 0008  000000012A05F200  46C35000 42200000  0001 0002 0003 0004  0005 0006  08 000000"
        "01 02 03 04 05 06 07 08  09 08 07 06 05 04 03 02",
        kHalfHour, t);
}

TEST(DisPdu, SignalPadsItsData) {
    Signal signal;
    signal.id = {1, 2, 3}, signal.radio = 4, signal.encoding = 0x4001, signal.tdlType = 0;
    signal.sampleRate = 8000, signal.bits = 37, signal.samples = 4;
    signal.data = {0xDE, 0xAD, 0xBE, 0xEF, 0x80};
    expectBytes("07 03 1A 04 80000001 0028 00 00  0001 0002 0003 0004  4001 0000 00001F40 0025 0004  DEADBEEF 80000000",
                kHalfHour, signal);
}

TEST(DisPdu, Receiver) {
    expectBytes("07 03 1B 04 80000001 0024 00 00  0001 0002 0003 0004  0002 0000  C2480000  0004 0005 0006 0007",
                kHalfHour, Receiver{{1, 2, 3}, 4, 2, -50, {4, 5, 6}, 7});
}

TEST(DisPdu, TimestampsAreOfTheHour) {
    EXPECT_EQ(secondsOf(0x80000001), 1800);
    EXPECT_EQ(timestampOf(3600 * 12 + 1800, true), 0x80000001);
    EXPECT_EQ(timestampOf(1800, false), 0x80000000);
    EXPECT_EQ(timestampOf(7200, false), 0u);
    for (const double t : {0.001, 59.5, 3599.999}) EXPECT_NEAR(secondsOf(timestampOf(t, true)), t, 3600. / 2147483648);
}

TEST(DisPdu, ArticulationsOfOtherKindsHaveNoValue) {
    auto bytes = hexBytes(kEntityState);
    bytes[144] = 1;  // an attached part: an entity's type stands where the number was, here a NaN's bits
    bytes[152] = 0x7f, bytes[153] = 0xff;
    const auto pdu = decode(bytes);
    ASSERT_TRUE(pdu) << pdu.error().text;
    EXPECT_EQ(std::get<EntityState>(pdu->body).articulations.at(0).value, 0);
}

TEST(DisPdu, WhatIsNoPduIsRefused) {
    const auto good = hexBytes(kEntityState);
    EXPECT_EQ(decodeError(std::span(good).first(11)), "has 11 bytes, a header has 12");
    EXPECT_EQ(decodeError(std::span(good).first(159)), "says it has 160 bytes, 159 are there");
    const auto with = [&](std::size_t at, std::uint8_t byte) {
        auto bytes = good;
        bytes[at] = byte;
        return bytes;
    };
    EXPECT_EQ(decodeError(with(0, 4)), "is of version 4, 5 to 7 are known");
    EXPECT_EQ(decodeError(with(2, 200)), "is of type 200");
    EXPECT_EQ(decodeError(with(9, 11)), "says it has 11 bytes, 160 are there");
    EXPECT_EQ(decodeError(with(9, 143)), "of type 1 ends too early, after 143 bytes");
    EXPECT_EQ(decodeError(with(19, 255)), "of type 1 ends too early, after 160 bytes");
    auto nan = good;
    nan[48] = 0x7f, nan[49] = 0xf8;  // the x of its location
    EXPECT_EQ(decodeError(nan), "of type 1 has a number that is not finite or beyond 1e30");
    auto far = good;
    far[48] = 0x7f, far[49] = 0xe0;  // finite there, but not in a scene
    EXPECT_EQ(decodeError(far), "of type 1 has a number that is not finite or beyond 1e30");
    EXPECT_EQ(decodeError(good), "");
}

TEST(DisPdu, TruncatedAndRandomBytesNeverCrash) {
    const auto good = hexBytes(kEntityState);
    std::mt19937 random(7);
    std::size_t read = 0;
    for (int round = 0; round < 20'000; ++round) {
        auto bytes = good;
        bytes[2] = static_cast<std::uint8_t>(std::array{1, 2, 3, 4, 11, 12, 25, 26, 27, 66}[random() % 10]);
        bytes.resize(12 + random() % (bytes.size() - 11));
        for (int k = 0; k < 4; ++k)
            bytes[12 + random() % std::max<std::size_t>(1, bytes.size() - 12)] = static_cast<std::uint8_t>(random());
        bytes[0] = static_cast<std::uint8_t>(5 + random() % 3);
        bytes[10] = static_cast<std::uint8_t>(random());  // a status in version 7, padding before
        bytes[8] = 0, bytes[9] = static_cast<std::uint8_t>(bytes.size());
        const auto pdu = decode(bytes);
        if (!pdu) continue;
        ++read;
        // A PDU that can be read can be written, and is then read as the same.
        const auto again = decode(encode(*pdu));
        ASSERT_TRUE(again) << round;
        EXPECT_TRUE(*again == *pdu) << round;
    }
    EXPECT_GT(read, 1000u);
}

TEST(DisPdu, RtpHeadersAreFoundByTheirFirstByte) {
    const auto pdu = hexBytes(kEntityState);
    EXPECT_EQ(rtpHeaderLength(pdu).value(), 0u);
    const auto head = rtpHeader(0x1234, 0x80000001, 0x00010002);
    EXPECT_EQ(std::vector(head.begin(), head.end()), hexBytes("80 6F 1234 80000001 00010002"));
    std::vector<std::uint8_t> both(head.begin(), head.end());
    both.insert(both.end(), pdu.begin(), pdu.end());
    EXPECT_EQ(rtpHeaderLength(both).value(), 12u);
    both[0] = 0x82;  // two contributing sources of four bytes
    EXPECT_EQ(rtpHeaderLength(both).value(), 20u);
    both[0] = 0x90, both[14] = 0, both[15] = 1;  // an extension of one number
    EXPECT_EQ(rtpHeaderLength(both).value(), 20u);
    both[14] = 0xff;
    EXPECT_FALSE(rtpHeaderLength(both));
    EXPECT_FALSE(rtpHeaderLength(head));
}

}  // namespace rtsg::dis
