// Distributed interactive simulation: ISO/IEC 19775-1 V4.0, clause 28. PDUs that are heard come in as events of the
// root (rtsg/core/dis_input.h); the motion of an entity between two of its PDUs follows from the last one and the
// clock. Whoever has a network reads the nodes that write. timestamp and the age of a PDU: IEEE 1278.1-2012, 6.2.88;
// timeouts 6.1.8.
#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include <rtsg/core/dis_input.h>
#include <rtsg/core/dis_pdu.h>
#include <rtsg/core/x3d.h>

#include <rtsg/core/rotation.h>
#include "behaviours.h"

namespace rtsg::behaviours {

namespace {

using Espdu = x3d::EspduTransform;

/// 2.4 times the longest time between two PDUs, seconds; of signals there is none.
template <class N>
constexpr double kDisTimeout = 12;
template <>
constexpr double kDisTimeout<x3d::TransmitterPdu> = 4.8;
template <>
constexpr double kDisTimeout<x3d::ReceiverPdu> = 144;

template <class T>
void sendField(Cascade& cascade, const Node& node, Field<T> field, const T& value) {
    if (!(node.get(field) == value)) cascade.emit(node, field, value);
}
/// Sends an unsigned number through a field of signed ones; one that is too large for it becomes the largest, with a
/// warning.
template <class T>
void sendNumber(Cascade& cascade, const Node& node, Field<std::int32_t> field, T value) {
    if constexpr (sizeof(T) > 4) {
        constexpr auto maximum = std::numeric_limits<std::int32_t>::max();
        if (value > static_cast<T>(maximum))
            cascade.warn(node, fmt::format("{} is more than the field can hold", value));
        sendField(cascade, node, field, static_cast<std::int32_t>(std::min(value, static_cast<T>(maximum))));
    } else {
        sendField(cascade, node, field, static_cast<std::int32_t>(value));
    }
}

template <class N>
bool isReading(const Node& node) {
    return node.get(N::enabled) && node.get(N::networkMode).view() == "networkReader";
}

template <class N>
void sendMode(Cascade& cascade, const Node& node) {
    const std::string_view mode = node.get(N::networkMode).view();
    sendField(cascade, node, N::isStandAlone, mode == "standAlone");
    sendField(cascade, node, N::isNetworkReader, mode == "networkReader");
    sendField(cascade, node, N::isNetworkWriter, mode == "networkWriter");
    if (mode != "standAlone" && mode != "networkReader" && mode != "networkWriter")
        cascade.warn(node, fmt::format("networkMode '{}' is none: standAlone, networkReader or networkWriter", mode));
}

/// isActive of a node that reads. Returns the time at which it ends if nothing is heard.
template <class N>
double sendActive(Cascade& cascade, const Node& node) {
    const double until = node.get(N::_heardTime).seconds + kDisTimeout<N>;
    if (!node.get(N::isActive)) return kNever;
    if (isReading<N>(node) && cascade.now() < until) return until;
    cascade.emit(node, N::isActive, false);
    return kNever;
}

/// Seconds from a time of the hour to `now`, from -1800 to 1800.
double ageOf(const dis::Header& header, double now) {
    const double age = std::fmod(now - dis::secondsOf(header.timestamp), 3600);
    return age < -1800 ? age + 3600 : age >= 1800 ? age - 3600 : age;
}

template <class N>
void sendHeard(Cascade& cascade, const Node& node, const dis::Header& header, bool hadRtpHeader) {
    cascade.store(node, N::_heardTime, Time{cascade.now()});
    sendField(cascade, node, N::isActive, true);
    sendField(cascade, node, N::isRtpHeaderHeard, hadRtpHeader);
    cascade.emit(node, N::timestamp, Time{cascade.now() - ageOf(header, cascade.now())});
    if (node.get(N::rtpHeaderExpected) && !hadRtpHeader)
        cascade.warn(node, "a PDU came without the RTP header that rtpHeaderExpected says");
    cascade.wake(node);
}

template <class N>
bool isOf(const Node& node, const dis::EntityId& id) {
    return node.get(N::siteID) == id.site && node.get(N::applicationID) == id.application &&
           node.get(N::entityID) == id.entity;
}

template <class N>
std::optional<dis::ExerciseFrame> frameOf(Cascade& cascade, const Node& node) {
    const auto frame = dis::ExerciseFrame::of(node.get(N::geoSystem), node.get(N::geoCoords));
    if (!frame) {
        cascade.warn(node, frame.error().text);
        return std::nullopt;
    }
    return *frame;
}

// ---- articulated parts -------------------------------------------------------------------------------------------

constexpr std::size_t kParts = 8;  // that have fields of their own

constexpr Field<float> kSetPart[kParts] = {
    Espdu::set_articulationParameterValue0, Espdu::set_articulationParameterValue1,
    Espdu::set_articulationParameterValue2, Espdu::set_articulationParameterValue3,
    Espdu::set_articulationParameterValue4, Espdu::set_articulationParameterValue5,
    Espdu::set_articulationParameterValue6, Espdu::set_articulationParameterValue7};
constexpr Field<float> kPart[kParts] = {
    Espdu::articulationParameterValue0_changed, Espdu::articulationParameterValue1_changed,
    Espdu::articulationParameterValue2_changed, Espdu::articulationParameterValue3_changed,
    Espdu::articulationParameterValue4_changed, Espdu::articulationParameterValue5_changed,
    Espdu::articulationParameterValue6_changed, Espdu::articulationParameterValue7_changed};

void sendParts(Cascade& cascade, const Node& node, const Array<float>& values) {
    for (std::size_t i = 0; i < std::min(kParts, values.size()); ++i) sendField(cascade, node, kPart[i], values[i]);
}

template <class T>
Array<T> longEnough(const Array<T>& list, std::size_t size) {
    if (list.size() >= size) return list;
    auto longer = Array<T>::ofSize(size);
    std::ranges::fill(std::ranges::copy(list, longer.mutableData()).out, longer.mutableData() + size, T{});
    return longer;
}

/// set_articulationParameterValue: the lists grow as far as that; a part that changed counts its changes (28.3).
void setPart(Cascade& cascade, const Node& node, std::size_t part, float value) {
    auto values = longEnough(node.get(Espdu::articulationParameterArray), part + 1);
    auto changes = longEnough(node.get(Espdu::articulationParameterChangeIndicatorArray), values.size());
    values.mutableData()[part] = value;
    changes.mutableData()[part] = (changes[part] + 1) & 0xff;
    sendField(cascade, node, Espdu::articulationParameterArray, values);
    sendField(cascade, node, Espdu::articulationParameterChangeIndicatorArray, changes);
    for (const auto field : {Espdu::articulationParameterDesignatorArray,
                             Espdu::articulationParameterIdPartAttachedToArray, Espdu::articulationParameterTypeArray})
        sendField(cascade, node, field, longEnough(node.get(field), values.size()));
    sendField(cascade, node, Espdu::articulationParameterCount, static_cast<std::int32_t>(values.size()));
    cascade.emit(node, kPart[part], value);
}

void takeParts(Cascade& cascade, const Node& node, const std::vector<dis::Articulation>& parts) {
    const auto list = [&]<class T>(Field<Array<T>> field, auto member) {
        auto values = Array<T>::ofSize(parts.size());
        T* out = values.mutableData();
        for (const dis::Articulation& part : parts) *out++ = static_cast<T>(part.*member);
        sendField(cascade, node, field, values);
    };
    list(Espdu::articulationParameterArray, &dis::Articulation::value);
    list(Espdu::articulationParameterChangeIndicatorArray, &dis::Articulation::change);
    list(Espdu::articulationParameterDesignatorArray, &dis::Articulation::designator);
    list(Espdu::articulationParameterIdPartAttachedToArray, &dis::Articulation::attachedTo);
    list(Espdu::articulationParameterTypeArray, &dis::Articulation::type);
    sendNumber(cascade, node, Espdu::articulationParameterCount, parts.size());
    sendParts(cascade, node, node.get(Espdu::articulationParameterArray));
}

// ---- entities ----------------------------------------------------------------------------------------------------

void takeState(Cascade& cascade, const Node& node, const dis::Pdu& pdu, std::span<const std::uint8_t> bytes) {
    const auto& state = std::get<dis::EntityState>(pdu.body);
    const auto frame = frameOf<Espdu>(cascade, node);
    if (!frame) return;
    // A PDU that says when it was true is taken from then on, if that can be: clocks may differ.
    const double age = ageOf(pdu.header, cascade.now());
    const bool isDated = (pdu.header.timestamp & 1) && age >= 0 && age < kDisTimeout<Espdu>;
    cascade.store(node, Espdu::_state, rtsg::wordsOf(bytes));
    cascade.store(node, Espdu::_stateTime, Time{cascade.now() - (isDated ? age : 0)});
    sendField(cascade, node, Espdu::marking, String(state.marking));
    sendNumber(cascade, node, Espdu::forceID, state.force);
    sendNumber(cascade, node, Espdu::entityKind, state.type.kind);
    sendNumber(cascade, node, Espdu::entityDomain, state.type.domain);
    sendNumber(cascade, node, Espdu::entityCountry, state.type.country);
    sendNumber(cascade, node, Espdu::entityCategory, state.type.category);
    sendNumber(cascade, node, Espdu::entitySubcategory, state.type.subcategory);
    sendNumber(cascade, node, Espdu::entitySpecific, state.type.specific);
    sendNumber(cascade, node, Espdu::entityExtra, state.type.extra);
    sendNumber(cascade, node, Espdu::deadReckoning, state.deadReckoning);
    if (state.deadReckoning > 9)
        cascade.warn(node, fmt::format("dead reckoning {} is none of 0 to 9: it stands", state.deadReckoning));
    const bool isBody = dis::isBodyModel(state.deadReckoning);
    const auto vector = [&](const glm::dvec3& v) {
        return Vec3f(isBody ? dis::modelFromBody(v) : frame->sceneFromWorld * v);
    };
    sendField(cascade, node, Espdu::linearVelocity, vector(state.velocity));
    sendField(cascade, node, Espdu::linearAcceleration, vector(state.acceleration));
    takeParts(cascade, node, state.articulations);
}

void takeEvent(Cascade& cascade, const Node& node, const dis::EventId& event, const dis::EntityId& author) {
    sendNumber(cascade, node, Espdu::eventSiteID, event.site);
    sendNumber(cascade, node, Espdu::eventApplicationID, event.application);
    sendNumber(cascade, node, Espdu::eventNumber, event.number);
    sendNumber(cascade, node, Espdu::eventEntityID, author.entity);
}
void takeMunition(Cascade& cascade, const Node& node, const dis::EntityId& id, const dis::Descriptor& descriptor) {
    sendNumber(cascade, node, Espdu::munitionSiteID, id.site);
    sendNumber(cascade, node, Espdu::munitionApplicationID, id.application);
    sendNumber(cascade, node, Espdu::munitionEntityID, id.entity);
    sendNumber(cascade, node, Espdu::munitionQuantity, descriptor.quantity);
    sendNumber(cascade, node, Espdu::firingRate, descriptor.rate);
    sendNumber(cascade, node, Espdu::fuse, descriptor.fuse);
    sendNumber(cascade, node, Espdu::warhead, descriptor.warhead);
}

void takeFire(Cascade& cascade, const Node& node, const dis::Fire& fire) {
    const auto frame = frameOf<Espdu>(cascade, node);
    if (!frame) return;
    takeEvent(cascade, node, fire.event, fire.firing);
    takeMunition(cascade, node, fire.munition, fire.descriptor);
    sendField(cascade, node, Espdu::fireMissionIndex, static_cast<std::int32_t>(fire.mission));
    sendField(cascade, node, Espdu::firingRange, fire.range);
    const glm::dvec3 velocity(fire.velocity);
    const double speed = glm::length(velocity);
    const glm::dvec3 displacement = speed > 0 ? velocity / speed * double{fire.range} : glm::dvec3(0);
    sendField(cascade, node, Espdu::munitionStartPoint, Vec3f(frame->toScene(fire.location)));
    sendField(cascade, node, Espdu::munitionEndPoint, Vec3f(frame->toScene(fire.location + displacement)));
    cascade.emit(node, Espdu::fired1, true);
    cascade.emit(node, Espdu::firedTime, Time{cascade.now()});
}

void takeDetonation(Cascade& cascade, const Node& node, const dis::Detonation& detonation) {
    const auto frame = frameOf<Espdu>(cascade, node);
    if (!frame) return;
    takeEvent(cascade, node, detonation.event, detonation.firing);
    takeMunition(cascade, node, detonation.munition, detonation.descriptor);
    const Vec3f location(frame->toScene(detonation.location));
    sendField(cascade, node, Espdu::munitionEndPoint, location);
    sendField(cascade, node, Espdu::detonationLocation, location);
    sendField(cascade, node, Espdu::detonationRelativeLocation, Vec3f(dis::modelFromBody(detonation.relativeLocation)));
    sendNumber(cascade, node, Espdu::detonationResult, detonation.result);
    cascade.emit(node, Espdu::isDetonated, true);
    cascade.emit(node, Espdu::detonateTime, Time{cascade.now()});
}

void takeCollision(Cascade& cascade, const Node& node, const dis::Collision& collision) {
    takeEvent(cascade, node, collision.event, collision.issuing);
    sendNumber(cascade, node, Espdu::collisionType, collision.type);
    cascade.emit(node, Espdu::isCollided, true);
    cascade.emit(node, Espdu::collideTime, Time{cascade.now()});
}

/// Whether the PDU is about the node's entity.
bool takeEntityPdu(Cascade& cascade, const Node& node, const dis::Pdu& pdu, std::span<const std::uint8_t> bytes) {
    const auto isMe = [&](const dis::EntityId& id) { return isOf<Espdu>(node, id); };
    if (const auto* state = std::get_if<dis::EntityState>(&pdu.body)) {
        if (!isMe(state->id)) return false;
        takeState(cascade, node, pdu, bytes);
    } else if (const auto* fire = std::get_if<dis::Fire>(&pdu.body)) {
        if (!isMe(fire->firing)) return false;
        takeFire(cascade, node, *fire);
    } else if (const auto* detonation = std::get_if<dis::Detonation>(&pdu.body)) {
        if (!isMe(detonation->firing) && !isMe(detonation->target) && !isMe(detonation->munition)) return false;
        takeDetonation(cascade, node, *detonation);
    } else if (const auto* collision = std::get_if<dis::Collision>(&pdu.body)) {
        if (!isMe(collision->issuing) && !isMe(collision->colliding)) return false;
        takeCollision(cascade, node, *collision);
    } else if (const auto* removal = std::get_if<dis::RemoveEntity>(&pdu.body)) {
        if (!isMe(removal->receiver)) return false;
        cascade.store(node, Espdu::_state, Array<std::int32_t>{});
    } else {
        return false;
    }
    return true;
}

/// Returns when it will be elsewhere: at once, or not before a PDU says so.
double reckon(Cascade& cascade, const Node& node) {
    const Array<std::int32_t>& words = node.get(Espdu::_state);
    if (words.empty() || !isReading<Espdu>(node) || !node.get(Espdu::isActive)) return kNever;
    const auto pdu = dis::decode(bytesOf(words));
    const auto* state = pdu ? std::get_if<dis::EntityState>(&pdu->body) : nullptr;
    const auto frame = frameOf<Espdu>(cascade, node);
    if (!state || !frame) return kNever;
    const dis::EntityPose pose = dis::deadReckon(*state, cascade.now() - node.get(Espdu::_stateTime).seconds);
    const Vec3f position(frame->toScene(pose.location));
    if (!std::isfinite(position.x + position.y + position.z)) {
        cascade.warn(node, "its entity is further away than a float can say: it stays where it was");
        return kNever;
    }
    sendField(cascade, node, Espdu::translation, position);
    sendField(cascade, node, Espdu::rotation, toRotation(frame->toScene(pose.worldFromBody)));
    return dis::isMoving(*state) ? cascade.now() : kNever;
}

double espduOnTime(Cascade& cascade, const Node& node) {
    sendMode<Espdu>(cascade, node);
    const double end = sendActive<Espdu>(cascade, node);
    return std::min(end, reckon(cascade, node));
}

/// Handles events to an entity that no network speaks for: its own events are the truth, and a writer sends them on.
void espduOnEvent(Cascade& cascade, const Node& node, FieldIndex field, EventValue value) {
    for (std::size_t i = 0; i < kParts; ++i)
        if (field == kSetPart[i].index) return setPart(cascade, node, i, value.as<float>());
    if (field == Espdu::articulationParameterArray.index) {
        sendField(cascade, node, Espdu::articulationParameterCount,
                  static_cast<std::int32_t>(value.as<Array<float>>().size()));
        return sendParts(cascade, node, value.as<Array<float>>());
    }
    if (isReading<Espdu>(node) || !node.get(Espdu::enabled)) return;
    if (field == Espdu::fired1.index || field == Espdu::fired2.index) {
        if (value.as<bool>()) sendField(cascade, node, Espdu::firedTime, Time{cascade.now()});
    } else if (field == Espdu::detonationResult.index || field == Espdu::detonationLocation.index ||
               field == Espdu::detonationRelativeLocation.index) {
        sendField(cascade, node, Espdu::isDetonated, true);
        sendField(cascade, node, Espdu::detonateTime, Time{cascade.now()});
    } else if (field == Espdu::collisionType.index) {
        sendField(cascade, node, Espdu::isCollided, true);
        sendField(cascade, node, Espdu::collideTime, Time{cascade.now()});
    }
}

// ---- radios ------------------------------------------------------------------------------------------------------

template <class N>
bool isOfRadio(const Node& node, const auto& radio) {
    return isOf<N>(node, radio.id) && node.get(N::radioID) == radio.radio;
}

void take(Cascade& cascade, const Node& node, const dis::Receiver& r) {
    using N = x3d::ReceiverPdu;
    sendNumber(cascade, node, N::receiverState, r.state);
    sendField(cascade, node, N::receivedPower, r.power);
    sendNumber(cascade, node, N::transmitterSiteID, r.transmitter.site);
    sendNumber(cascade, node, N::transmitterApplicationID, r.transmitter.application);
    sendNumber(cascade, node, N::transmitterEntityID, r.transmitter.entity);
    sendNumber(cascade, node, N::transmitterRadioID, r.transmitterRadio);
}

void take(Cascade& cascade, const Node& node, const dis::Signal& s) {
    using N = x3d::SignalPdu;
    sendNumber(cascade, node, N::encodingScheme, s.encoding);
    sendNumber(cascade, node, N::tdlType, s.tdlType);
    sendNumber(cascade, node, N::sampleRate, std::uint64_t{s.sampleRate});
    sendNumber(cascade, node, N::dataLength, s.bits);
    sendNumber(cascade, node, N::samples, s.samples);
    auto data = Array<std::int32_t>::ofSize(s.data.size());
    std::ranges::copy(s.data, data.mutableData());
    cascade.emit(node, N::data, data);  // each is more of the signal, though it be the same
}

void take(Cascade& cascade, const Node& node, const dis::Transmitter& t) {
    using N = x3d::TransmitterPdu;
    const auto frame = frameOf<N>(cascade, node);
    if (!frame) return;
    sendNumber(cascade, node, N::radioEntityTypeKind, t.kind);
    sendNumber(cascade, node, N::radioEntityTypeDomain, t.domain);
    sendNumber(cascade, node, N::radioEntityTypeCountry, t.country);
    sendNumber(cascade, node, N::radioEntityTypeCategory, t.category);
    sendNumber(cascade, node, N::radioEntityTypeNomenclature, t.nomenclature);
    sendNumber(cascade, node, N::radioEntityTypeNomenclatureVersion, t.nomenclatureVersion);
    sendNumber(cascade, node, N::transmitState, t.state);
    sendNumber(cascade, node, N::inputSource, t.inputSource);
    sendField(cascade, node, N::antennaLocation, Vec3f(frame->toScene(t.antennaLocation)));
    sendField(cascade, node, N::relativeAntennaLocation, Vec3f(dis::modelFromBody(t.relativeAntennaLocation)));
    sendNumber(cascade, node, N::antennaPatternType, t.antennaPatternType);
    sendNumber(cascade, node, N::antennaPatternLength, t.antennaPattern.size());
    sendNumber(cascade, node, N::frequency, t.frequency);
    sendField(cascade, node, N::transmitFrequencyBandwidth, t.bandwidth);
    sendField(cascade, node, N::power, t.power);
    sendNumber(cascade, node, N::modulationTypeSpreadSpectrum, t.spreadSpectrum);
    sendNumber(cascade, node, N::modulationTypeMajor, t.majorModulation);
    sendNumber(cascade, node, N::modulationTypeDetail, t.detail);
    sendNumber(cascade, node, N::modulationTypeSystem, t.system);
    sendNumber(cascade, node, N::cryptoSystem, t.cryptoSystem);
    sendNumber(cascade, node, N::cryptoKeyID, t.cryptoKey);
    sendNumber(cascade, node, N::lengthOfModulationParameters, t.modulationParameters.size());
}

template <class N, class Body>
bool takeRadioPdu(Cascade& cascade, const Node& node, const dis::Pdu& pdu) {
    const auto* body = std::get_if<Body>(&pdu.body);
    if (!body || !isOfRadio<N>(node, *body)) return false;
    take(cascade, node, *body);
    return true;
}

template <class N>
double radioOnTime(Cascade& cascade, const Node& node) {
    sendMode<N>(cascade, node);
    return sendActive<N>(cascade, node);
}

// ---- all of them -------------------------------------------------------------------------------------------------

template <class N>
void hearAs(Cascade& cascade, const Node& node, const HeardPdu& heard, const auto& take) {
    if (!isReading<N>(node)) return;
    const auto pdu = dis::decode(heard.bytes);
    if (!pdu) return cascade.warn(node, fmt::format("a PDU that it was given {}", pdu.error().text));
    if (take(*pdu)) sendHeard<N>(cascade, node, pdu->header, heard.hadRtpHeader);
}

/// The network has found or lost entities: the manager reports them in the next frame.
double managerOnTime(Cascade& cascade, const Node& node) {
    using M = x3d::DISEntityManager;
    const Array<NodeId> added = node.get(M::_added), removed = node.get(M::_removed);
    if (added.empty() && removed.empty()) return kNever;
    std::vector<NodeId> entities(node.get(M::_entities).begin(), node.get(M::_entities).end());
    entities.insert(entities.end(), added.begin(), added.end());
    std::erase_if(entities, [&](NodeId id) { return std::ranges::find(removed, id) != removed.end(); });
    cascade.store(node, M::_entities, Array<NodeId>(std::span<const NodeId>(entities)));
    cascade.store(node, M::_added, Array<NodeId>{});
    cascade.store(node, M::_removed, Array<NodeId>{});
    if (!added.empty()) cascade.emit(node, M::addedEntities, added);
    if (!removed.empty()) cascade.emit(node, M::removedEntities, removed);
    return kNever;
}

}  // namespace

void heardOnEvent(Cascade& cascade, const Node& root, EventValue value) {
    const auto pdus = HeardPdu::fromValue(value.as<Array<std::int32_t>>());
    if (!pdus) return cascade.warn(root, pdus.error().text);
    for (const HeardPdu& heard : *pdus) {
        const Node* node = cascade.scene().find(heard.node);
        if (!node) continue;
        if (node->is(Espdu::type))
            hearAs<Espdu>(cascade, *node, heard,
                          [&](const dis::Pdu& pdu) { return takeEntityPdu(cascade, *node, pdu, heard.bytes); });
        const auto radio = [&]<class N, class Body>() {
            if (node->is(N::type))
                hearAs<N>(cascade, *node, heard,
                          [&](const dis::Pdu& pdu) { return takeRadioPdu<N, Body>(cascade, *node, pdu); });
        };
        radio.template operator()<x3d::ReceiverPdu, dis::Receiver>();
        radio.template operator()<x3d::SignalPdu, dis::Signal>();
        radio.template operator()<x3d::TransmitterPdu, dis::Transmitter>();
    }
}

void appendDis(std::vector<BuiltinBehaviour>& table) {
    table.push_back({x3d::DISEntityManager::type, {.onTime = managerOnTime}});
    table.push_back({x3d::EspduTransform::type, {.onEvent = espduOnEvent, .onTime = espduOnTime}});
    table.push_back({x3d::ReceiverPdu::type, {.onTime = radioOnTime<x3d::ReceiverPdu>}});
    table.push_back({x3d::SignalPdu::type, {.onTime = radioOnTime<x3d::SignalPdu>}});
    table.push_back({x3d::TransmitterPdu::type, {.onTime = radioOnTime<x3d::TransmitterPdu>}});
}

}  // namespace rtsg::behaviours
