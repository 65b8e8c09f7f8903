// Makes PDUs of a node's fields, and finds the entities and radios of PDUs.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include <rtsg/core/dis_pdu.h>
#include <rtsg/core/rotation.h>
#include <rtsg/core/x3d.h>

#include "stations.h"

namespace rtsg::dis {

namespace {

using Espdu = x3d::EspduTransform;

constexpr std::size_t kMarkingBytes = 11;

/// The lower bits of a field of 32 bits, as many as the PDU has room for.
template <class T, class N>
T fieldOf(const Node& node, N field) {
    return static_cast<T>(node.get(field));
}
/// Replaces values that are not finite: other programs refuse a PDU with such a number, and rightly.
glm::vec3 finite(const glm::dvec3& v) {
    return std::isfinite(v.x + v.y + v.z) ? glm::vec3(v) : glm::vec3(0);
}
float finite(float v) {
    return std::isfinite(v) ? v : 0;
}

Descriptor descriptorOf(const Node& node) {
    Descriptor d;
    d.warhead = fieldOf<std::uint16_t>(node, Espdu::warhead);
    d.fuse = fieldOf<std::uint16_t>(node, Espdu::fuse);
    d.quantity = fieldOf<std::uint16_t>(node, Espdu::munitionQuantity);
    d.rate = fieldOf<std::uint16_t>(node, Espdu::firingRate);
    return d;
}
EntityId munitionOf(const Node& node) {
    return {fieldOf<std::uint16_t>(node, Espdu::munitionSiteID),
            fieldOf<std::uint16_t>(node, Espdu::munitionApplicationID),
            fieldOf<std::uint16_t>(node, Espdu::munitionEntityID)};
}
EventId eventOf(const Node& node) {
    return {fieldOf<std::uint16_t>(node, Espdu::eventSiteID), fieldOf<std::uint16_t>(node, Espdu::eventApplicationID),
            fieldOf<std::uint16_t>(node, Espdu::eventNumber)};
}

template <class N>
ExerciseFrame frameOfNode(const Node& node) {
    return ExerciseFrame::of(node.get(N::geoSystem), node.get(N::geoCoords)).value_or(ExerciseFrame{});
}

std::vector<Articulation> partsOf(const Node& node) {
    const auto& values = node.get(Espdu::articulationParameterArray);
    const auto at = [&](Field<Array<std::int32_t>> field, std::size_t i) {
        const auto& list = node.get(field);
        return i < list.size() ? list[i] : 0;
    };
    std::vector<Articulation> parts(std::min<std::size_t>(values.size(), 255));
    for (std::size_t i = 0; i < parts.size(); ++i)
        parts[i] = {static_cast<std::uint8_t>(at(Espdu::articulationParameterDesignatorArray, i)),
                    static_cast<std::uint8_t>(at(Espdu::articulationParameterChangeIndicatorArray, i)),
                    static_cast<std::uint16_t>(at(Espdu::articulationParameterIdPartAttachedToArray, i)),
                    static_cast<std::uint32_t>(at(Espdu::articulationParameterTypeArray, i)), finite(values[i])};
    return parts;
}

EntityState entityStateOf(const Node& node, const EntityId& id, const ExerciseFrame& frame) {
    EntityState state;
    state.id = id;
    state.force = fieldOf<std::uint8_t>(node, Espdu::forceID);
    state.type = {
        fieldOf<std::uint8_t>(node, Espdu::entityKind),        fieldOf<std::uint8_t>(node, Espdu::entityDomain),
        fieldOf<std::uint16_t>(node, Espdu::entityCountry),    fieldOf<std::uint8_t>(node, Espdu::entityCategory),
        fieldOf<std::uint8_t>(node, Espdu::entitySubcategory), fieldOf<std::uint8_t>(node, Espdu::entitySpecific),
        fieldOf<std::uint8_t>(node, Espdu::entityExtra)};
    state.alternativeType = state.type;
    state.deadReckoning = fieldOf<std::uint8_t>(node, Espdu::deadReckoning);
    const glm::dvec3 position(node.get(Espdu::translation));
    state.location = std::isfinite(position.x + position.y + position.z) ? frame.toWorld(position) : frame.origin;
    state.orientation = anglesOf(frame.toWorld(toQuaternion(node.get(Espdu::rotation))));
    const auto vector = [&](const Vec3f& v) {
        return finite(isBodyModel(state.deadReckoning) ? bodyFromModel(v)
                                                       : glm::transpose(frame.sceneFromWorld) * glm::dvec3(v));
    };
    state.velocity = vector(node.get(Espdu::linearVelocity));
    state.acceleration = vector(node.get(Espdu::linearAcceleration));
    state.marking = node.get(Espdu::marking).str().substr(0, kMarkingBytes);
    state.articulations = partsOf(node);
    return state;
}

Signal signalOf(const Node& node, const Station& station) {
    using N = x3d::SignalPdu;
    constexpr std::size_t kMax = 65'535 / 8;
    Signal signal;
    signal.id = station.identity.entity, signal.radio = fieldOf<std::uint16_t>(node, N::radioID);
    signal.encoding = fieldOf<std::uint16_t>(node, N::encodingScheme);
    signal.tdlType = fieldOf<std::uint16_t>(node, N::tdlType);
    signal.sampleRate = fieldOf<std::uint32_t>(node, N::sampleRate);
    signal.samples = fieldOf<std::uint16_t>(node, N::samples);
    for (const std::int32_t byte : node.get(N::data))
        if (signal.data.size() < kMax) signal.data.push_back(static_cast<std::uint8_t>(byte));
    // dataLength counts bits, and may end within the last byte.
    const auto bits = static_cast<std::int64_t>(node.get(N::dataLength)), all = std::int64_t(8 * signal.data.size());
    signal.bits = static_cast<std::uint16_t>(bits > all - 8 && bits <= all ? bits : all);
    return signal;
}

Receiver receiverOf(const Node& node, const Station& station) {
    using N = x3d::ReceiverPdu;
    Receiver receiver;
    receiver.id = station.identity.entity, receiver.radio = fieldOf<std::uint16_t>(node, N::radioID);
    receiver.state = fieldOf<std::uint16_t>(node, N::receiverState);
    receiver.power = finite(node.get(N::receivedPower));
    receiver.transmitter = {fieldOf<std::uint16_t>(node, N::transmitterSiteID),
                            fieldOf<std::uint16_t>(node, N::transmitterApplicationID),
                            fieldOf<std::uint16_t>(node, N::transmitterEntityID)};
    receiver.transmitterRadio = fieldOf<std::uint16_t>(node, N::transmitterRadioID);
    return receiver;
}

Transmitter transmitterOf(const Node& node, const Station& station, const ExerciseFrame& frame) {
    using N = x3d::TransmitterPdu;
    Transmitter t;
    t.id = station.identity.entity, t.radio = fieldOf<std::uint16_t>(node, N::radioID);
    t.kind = fieldOf<std::uint8_t>(node, N::radioEntityTypeKind);
    t.domain = fieldOf<std::uint8_t>(node, N::radioEntityTypeDomain);
    t.country = fieldOf<std::uint16_t>(node, N::radioEntityTypeCountry);
    t.category = fieldOf<std::uint8_t>(node, N::radioEntityTypeCategory);
    t.nomenclature = fieldOf<std::uint16_t>(node, N::radioEntityTypeNomenclature);
    t.nomenclatureVersion = fieldOf<std::uint8_t>(node, N::radioEntityTypeNomenclatureVersion);
    t.state = fieldOf<std::uint8_t>(node, N::transmitState);
    t.inputSource = fieldOf<std::uint8_t>(node, N::inputSource);
    const glm::dvec3 position(finite(glm::dvec3(node.get(N::antennaLocation))));
    t.antennaLocation = frame.toWorld(position);
    t.relativeAntennaLocation = finite(bodyFromModel(node.get(N::relativeAntennaLocation)));
    t.antennaPatternType = fieldOf<std::uint16_t>(node, N::antennaPatternType);
    t.frequency = static_cast<std::uint64_t>(std::max(0, node.get(N::frequency)));
    t.bandwidth = finite(node.get(N::transmitFrequencyBandwidth));
    t.power = finite(node.get(N::power));
    t.spreadSpectrum = fieldOf<std::uint16_t>(node, N::modulationTypeSpreadSpectrum);
    t.majorModulation = fieldOf<std::uint16_t>(node, N::modulationTypeMajor);
    t.detail = fieldOf<std::uint16_t>(node, N::modulationTypeDetail);
    t.system = fieldOf<std::uint16_t>(node, N::modulationTypeSystem);
    t.cryptoSystem = fieldOf<std::uint16_t>(node, N::cryptoSystem);
    t.cryptoKey = fieldOf<std::uint16_t>(node, N::cryptoKeyID);
    return t;
}

}  // namespace

std::vector<Identity> identitiesOf(const Pdu& pdu) {
    std::vector<Identity> all;
    const auto add = [&](std::initializer_list<EntityId> ids) {
        for (const EntityId& id : ids)
            if (std::ranges::find(all, Identity{id, -1}) == all.end()) all.push_back({id, -1});
    };
    std::visit(
        [&]<class Body>(const Body& body) {
            if constexpr (std::is_same_v<Body, EntityState>)
                add({body.id});
            else if constexpr (std::is_same_v<Body, Fire>)
                add({body.firing});
            else if constexpr (std::is_same_v<Body, Detonation>)
                add({body.firing, body.target, body.munition});
            else if constexpr (std::is_same_v<Body, Collision>)
                add({body.issuing, body.colliding});
            else if constexpr (std::is_same_v<Body, CreateEntity> || std::is_same_v<Body, RemoveEntity>)
                add({body.receiver});
            else
                all.push_back({body.id, body.radio});
        },
        pdu.body);
    return all;
}

std::optional<Pdu> stateOf(const Scene& scene, const Station& station, std::string& problem) {
    const Node& node = scene.node(station.node);
    if (node.is(x3d::SignalPdu::type)) return Pdu{{}, signalOf(node, station)};
    if (node.is(x3d::ReceiverPdu::type)) return Pdu{{}, receiverOf(node, station)};
    const bool isEntity = node.is(Espdu::type);
    const auto frame = isEntity ? ExerciseFrame::of(node.get(Espdu::geoSystem), node.get(Espdu::geoCoords))
                                : ExerciseFrame::of(node.get(x3d::TransmitterPdu::geoSystem),
                                                    node.get(x3d::TransmitterPdu::geoCoords));
    if (!frame) {
        problem = frame.error().text;
        return std::nullopt;
    }
    if (isEntity) return Pdu{{}, entityStateOf(node, station.identity.entity, *frame)};
    return Pdu{{}, transmitterOf(node, station, *frame)};
}

Pdu fireOf(const Node& node, const EntityId& id) {
    const ExerciseFrame frame = frameOfNode<Espdu>(node);
    Fire fire;
    fire.firing = id, fire.munition = munitionOf(node), fire.event = eventOf(node);
    fire.mission = fieldOf<std::uint32_t>(node, Espdu::fireMissionIndex);
    const glm::dvec3 start(finite(glm::dvec3(node.get(Espdu::munitionStartPoint))));
    const glm::dvec3 end(finite(glm::dvec3(node.get(Espdu::munitionEndPoint))));
    fire.location = frame.toWorld(start);
    fire.descriptor = descriptorOf(node);
    // The fields say no speed: one that has the direction, and gets there in a second.
    fire.velocity = glm::vec3(frame.toWorld(end) - frame.toWorld(start));
    fire.range = finite(node.get(Espdu::firingRange));
    return {{}, fire};
}

Pdu detonationOf(const Node& node, const EntityId& id) {
    const ExerciseFrame frame = frameOfNode<Espdu>(node);
    Detonation detonation;
    detonation.firing = id, detonation.munition = munitionOf(node), detonation.event = eventOf(node);
    detonation.location = frame.toWorld(glm::dvec3(finite(glm::dvec3(node.get(Espdu::detonationLocation)))));
    detonation.relativeLocation = finite(bodyFromModel(node.get(Espdu::detonationRelativeLocation)));
    detonation.descriptor = descriptorOf(node);
    detonation.result = fieldOf<std::uint8_t>(node, Espdu::detonationResult);
    return {{}, detonation};
}

Pdu collisionOf(const Node& node, const EntityId& id) {
    const ExerciseFrame frame = frameOfNode<Espdu>(node);
    Collision collision;
    collision.issuing = id, collision.event = eventOf(node);
    collision.colliding = {collision.event.site, collision.event.application,
                           fieldOf<std::uint16_t>(node, Espdu::eventEntityID)};
    collision.type = fieldOf<std::uint8_t>(node, Espdu::collisionType);
    const glm::dvec3 v(node.get(Espdu::linearVelocity));
    collision.velocity = finite(isBodyModel(fieldOf<std::uint8_t>(node, Espdu::deadReckoning))
                                    ? frame.toWorld(toQuaternion(node.get(Espdu::rotation))) * bodyFromModel(v)
                                    : glm::transpose(frame.sceneFromWorld) * v);
    return {{}, collision};
}

}  // namespace rtsg::dis
