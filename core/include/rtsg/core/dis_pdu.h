// Protocol data units of Distributed Interactive Simulation: decodes and encodes their bytes; where an entity is some
// time after an Entity State PDU, and how the world coordinates of an exercise map into a scene.
//
// It handles versions 5 to 7 of the protocol, which have the same layout for these types. Numbers are big-endian;
// positions are metres in the world of the exercise (usually geocentric); a body's x points forward, y to the right, z
// down; angles are radians. A PDU that is decoded is whole and finite; anything else is an error. Threading: values.
// Source: IEEE 1278.1-2012, clause 7 (layouts) and 6.2 (records); 1278.1A-1998 for the types of radios; RFC 3550 for
// the RTP header before a datagram; IEEE 1278.1-2012 annex E (models 0 to 9) and ISO/IEC 19775-1 V4.0 clause 28, 25.2
// for dead reckoning. Its errors are those of double precision at any rotation rate. The body's acceleration of models
// 6 to 9 is the rate of change of its velocity in its own, turning axes.

// Example:
//     #include <rtsg/core/dis_pdu.h>
//     const rtsg::dis::RemoveEntity gone{{1, 2, 3}, {4, 5, 6}};
//     const auto pdu = rtsg::dis::decode(rtsg::dis::encode({{}, gone}));
//     if (pdu) std::cout << std::get<rtsg::dis::RemoveEntity>(pdu->body).receiver.entity << '\n';  // 6
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/value.h>

namespace rtsg::dis {

enum class PduType : std::uint8_t {
    entityState = 1,
    fire = 2,
    detonation = 3,
    collision = 4,
    createEntity = 11,
    removeEntity = 12,
    transmitter = 25,
    signal = 26,
    receiver = 27,
    collisionElastic = 66,
};

struct Header {
    std::uint8_t version = 7, exercise = 1;
    std::uint32_t timestamp = 0;  // time within the hour in units of 3600 s / 2^31, times 2; odd: absolute time
    std::uint8_t status = 0;      // version 7 only
    friend bool operator==(const Header&, const Header&) = default;
};
/// The time within the hour of a timestamp, in seconds from 0 to 3600.
double secondsOf(std::uint32_t timestamp);
std::uint32_t timestampOf(double secondsSince1970, bool isAbsolute);

struct EntityId {
    std::uint16_t site = 0, application = 0, entity = 0;
    friend auto operator<=>(const EntityId&, const EntityId&) = default;
};
struct EntityType {
    std::uint8_t kind = 0, domain = 0;
    std::uint16_t country = 0;
    std::uint8_t category = 0, subcategory = 0, specific = 0, extra = 0;
    friend bool operator==(const EntityType&, const EntityType&) = default;
};
struct EventId {
    std::uint16_t site = 0, application = 0, number = 0;
    friend bool operator==(const EventId&, const EventId&) = default;
};
/// Radians: psi about z, then theta about the new y, then phi about the new x.
struct EulerAngles {
    float psi = 0, theta = 0, phi = 0;
    friend bool operator==(const EulerAngles&, const EulerAngles&) = default;
};
struct Articulation {
    std::uint8_t designator = 0, change = 0;  // 0: an articulated part; 1: an attached part, without a value
    std::uint16_t attachedTo = 0;
    std::uint32_t type = 0;
    float value = 0;
    friend bool operator==(const Articulation&, const Articulation&) = default;
};

struct EntityState {
    static constexpr std::uint32_t kDeactivated = 1u << 23;  // in `appearance`: the last PDU of an entity
    EntityId id;
    std::uint8_t force = 0;
    EntityType type, alternativeType;
    glm::vec3 velocity{0};  // m/s; in the body's axes with dead reckoning models 6 to 9
    glm::dvec3 location{0};
    EulerAngles orientation;
    std::uint32_t appearance = 0;
    std::uint8_t deadReckoning = 0;
    std::array<std::uint8_t, 15> deadReckoningParameters{};
    glm::vec3 acceleration{0}, angularVelocity{0};  // m/s2, axes as for velocity; rad/s about the body's axes
    std::uint8_t markingCharacters = 1;             // 1: ASCII
    std::string marking;                            // 11 bytes at most
    std::uint32_t capabilities = 0;
    std::vector<Articulation> articulations;  // 255 at most
    friend bool operator==(const EntityState&, const EntityState&) = default;
};

struct Descriptor {
    EntityType type;
    std::uint16_t warhead = 0, fuse = 0, quantity = 0, rate = 0;
    friend bool operator==(const Descriptor&, const Descriptor&) = default;
};
struct Fire {
    EntityId firing, target, munition;
    EventId event;
    std::uint32_t mission = 0;
    glm::dvec3 location{0};
    Descriptor descriptor;
    glm::vec3 velocity{0};
    float range = 0;
    friend bool operator==(const Fire&, const Fire&) = default;
};
struct Detonation {
    EntityId firing, target, munition;
    EventId event;
    glm::vec3 velocity{0};
    glm::dvec3 location{0};
    Descriptor descriptor;
    glm::vec3 relativeLocation{0};  // in the target's axes
    std::uint8_t result = 0;
    std::vector<Articulation> articulations;
    friend bool operator==(const Detonation&, const Detonation&) = default;
};
/// It also holds the common part of a Collision-Elastic PDU (type 66), which is decoded but not encoded.
struct Collision {
    EntityId issuing, colliding;
    EventId event;
    std::uint8_t type = 0;
    glm::vec3 velocity{0};
    float mass = 0;
    glm::vec3 location{0};
    friend bool operator==(const Collision&, const Collision&) = default;
};
struct CreateEntity {
    EntityId originator, receiver;
    std::uint32_t request = 0;
    friend bool operator==(const CreateEntity&, const CreateEntity&) = default;
};
struct RemoveEntity {
    EntityId originator, receiver;
    std::uint32_t request = 0;
    friend bool operator==(const RemoveEntity&, const RemoveEntity&) = default;
};

struct Transmitter {
    EntityId id;
    std::uint16_t radio = 0;
    std::uint8_t kind = 0, domain = 0;
    std::uint16_t country = 0;
    std::uint8_t category = 0, nomenclatureVersion = 0;
    std::uint16_t nomenclature = 0;
    std::uint8_t state = 0, inputSource = 0;
    glm::dvec3 antennaLocation{0};
    glm::vec3 relativeAntennaLocation{0};
    std::uint16_t antennaPatternType = 0;
    std::uint64_t frequency = 0;     // Hz
    float bandwidth = 0, power = 0;  // Hz; dBm
    std::uint16_t spreadSpectrum = 0, majorModulation = 0, detail = 0, system = 0;
    std::uint16_t cryptoSystem = 0, cryptoKey = 0;
    std::vector<std::uint8_t> modulationParameters,
        antennaPattern;  // whole multiples of 8 bytes; 255 and 65,535 at most
    friend bool operator==(const Transmitter&, const Transmitter&) = default;
};
struct Signal {
    EntityId id;
    std::uint16_t radio = 0, encoding = 0, tdlType = 0;
    std::uint32_t sampleRate = 0;  // Hz, or bits a second
    std::uint16_t bits = 0, samples = 0;
    std::vector<std::uint8_t> data;  // ceil(bits / 8) bytes
    friend bool operator==(const Signal&, const Signal&) = default;
};
struct Receiver {
    EntityId id;
    std::uint16_t radio = 0, state = 0;
    float power = 0;  // dBm
    EntityId transmitter;
    std::uint16_t transmitterRadio = 0;
    friend bool operator==(const Receiver&, const Receiver&) = default;
};

struct Pdu {
    Header header;
    std::variant<EntityState, Fire, Detonation, Collision, CreateEntity, RemoveEntity, Transmitter, Signal, Receiver>
        body;
    friend bool operator==(const Pdu&, const Pdu&) = default;
};

/// The type and length of a datagram's first PDU, from the header alone. Errors: fewer than 12 bytes; a version other
/// than 5 to 7; a length that is less than the header's or more than the datagram's.
struct Outline {
    PduType type{};
    std::size_t length = 0;
};
Result<Outline> outlineOf(std::span<const std::uint8_t> bytes);
/// Whether decode() knows the type.
bool isKnown(PduType type);

/// Reads the first PDU of `bytes`, and ignores what follows it. Errors: those of outlineOf(); a type other than these;
/// counts that lead beyond the PDU's end; a number that is not finite.
Result<Pdu> decode(std::span<const std::uint8_t> bytes);
/// Precondition, checked: no list is longer than its limit.
std::vector<std::uint8_t> encode(const Pdu& pdu);

/// The length in bytes of the RTP header before the PDU; 0 if the first byte shows that there is none. Error: a header
/// that ends beyond the datagram.
Result<std::size_t> rtpHeaderLength(std::span<const std::uint8_t> datagram);
/// Makes the 12 bytes of the header. `timestamp` is the PDU's.
std::array<std::uint8_t, 12> rtpHeader(std::uint16_t sequence, std::uint32_t timestamp, std::uint32_t source);

/// The rotation from the body's axes to the world's.
glm::dquat orientationOf(const EulerAngles& angles);
/// The Euler angles of a unit quaternion; phi is 0 where the nose points straight up or down.
EulerAngles anglesOf(const glm::dquat& worldFromBody);

struct EntityPose {
    glm::dvec3 location{0};
    glm::dquat worldFromBody{1, 0, 0, 0};
};
/// The pose `seconds` after the PDU. With models 0 and 1, and those above 9, the entity does not move.
EntityPose deadReckon(const EntityState& state, double seconds);
/// Whether the linear velocity and acceleration are in the body's axes.
bool isBodyModel(std::uint8_t deadReckoning);
/// Whether deadReckon() gives another pose at another time.
bool isMoving(const EntityState& state);

/// The frame in which geoSystem and geoCoords put the coordinates of a node: at geoCoords, x points east, y up and z
/// south. In a geocentric system with geoCoords at the Earth's centre, the axes are the Earth's. In any other system,
/// geoCoords 0 0 0 mean that no place was given. The exercise is then on a plane: its x is the scene's x, its y the
/// scene's z, and its z, which points down, the scene's -y.
struct ExerciseFrame {
    glm::dvec3 origin{0};
    glm::dmat3 sceneFromWorld{1};

    /// Error: an invalid geoSystem; geoCoords that are no place in it.
    static Result<ExerciseFrame> of(const Array<String>& geoSystem, const Vec3d& geoCoords);
    glm::dvec3 toScene(const glm::dvec3& location) const { return sceneFromWorld * (location - origin); }
    glm::dvec3 toWorld(const glm::dvec3& point) const { return origin + glm::transpose(sceneFromWorld) * point; }
    /// A model looks along x, with y up and z to its right; a body looks along x, with y to its right and z down.
    glm::dquat toScene(const glm::dquat& worldFromBody) const;
    glm::dquat toWorld(const glm::dquat& sceneFromModel) const;
};
/// Turns a vector from the body's axes to the model's, and back.
glm::dvec3 modelFromBody(const glm::dvec3& v);
glm::dvec3 bodyFromModel(const glm::dvec3& v);

}  // namespace rtsg::dis
