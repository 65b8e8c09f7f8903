// Distributed interactive simulation: ISO/IEC 19775-1 V4.0, clause 28. PDUs that are heard come in as events of the
// root (rtsg/core/dis_input.h); the motion of an entity between two of its PDUs follows from the last one and the
// clock. Whoever has a network reads the nodes that write. timestamp and the age of a PDU: IEEE 1278.1-2012, 6.2.88;
// timeouts 6.1.8.
#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include <rtsg/core/dead_reckoning.h>
#include <rtsg/core/dis_input.h>
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
void tell(Cascade& cascade, const Node& node, Field<T> field, const T& value) {
    if (!(node.get(field) == value)) cascade.emit(node, field, value);
}
/// Sends an unsigned number through a field of signed ones; one that is too large for it becomes the largest, with a
/// warning.
template <class T>
void tellNumber(Cascade& cascade, const Node& node, Field<std::int32_t> field, T value) {
    if constexpr (sizeof(T) > 4) {
        constexpr auto most = std::numeric_limits<std::int32_t>::max();
        if (value > static_cast<T>(most)) cascade.warn(node, fmt::format("{} is more than the field can hold", value));
        tell(cascade, node, field, static_cast<std::int32_t>(std::min(value, static_cast<T>(most))));
    } else {
        tell(cascade, node, field, static_cast<std::int32_t>(value));
    }
}

template <class N>
bool isReading(const Node& node) {
    return node.get(N::enabled) && node.get(N::networkMode).view() == "networkReader";
}

template <class N>
void tellMode(Cascade& cascade, const Node& node) {
    const std::string_view mode = node.get(N::networkMode).view();
    tell(cascade, node, N::isStandAlone, mode == "standAlone");
    tell(cascade, node, N::isNetworkReader, mode == "networkReader");
    tell(cascade, node, N::isNetworkWriter, mode == "networkWriter");
    if (mode != "standAlone" && mode != "networkReader" && mode != "networkWriter")
        cascade.warn(node, fmt::format("networkMode '{}' is none: standAlone, networkReader or networkWriter", mode));
}

/// isActive of a node that reads. Returns the time at which it ends if nothing is heard.
template <class N>
double tellActive(Cascade& cascade, const Node& node) {
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
void tellHeard(Cascade& cascade, const Node& node, const dis::Header& header, bool hadRtpHeader) {
    cascade.store(node, N::_heardTime, Time{cascade.now()});
    tell(cascade, node, N::isActive, true);
    tell(cascade, node, N::isRtpHeaderHeard, hadRtpHeader);
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

void tellParts(Cascade& cascade, const Node& node, const Array<float>& values) {
    for (std::size_t i = 0; i < std::min(kParts, values.size()); ++i) tell(cascade, node, kPart[i], values[i]);
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
    tell(cascade, node, Espdu::articulationParameterArray, values);
    tell(cascade, node, Espdu::articulationParameterChangeIndicatorArray, changes);
    for (const auto field : {Espdu::articulationParameterDesignatorArray,
                             Espdu::articulationParameterIdPartAttachedToArray, Espdu::articulationParameterTypeArray})
        tell(cascade, node, field, longEnough(node.get(field), values.size()));
    tell(cascade, node, Espdu::articulationParameterCount, static_cast<std::int32_t>(values.size()));
    cascade.emit(node, kPart[part], value);
}

void takeParts(Cascade& cascade, const Node& node, const std::vector<dis::Articulation>& parts) {
    const auto list = [&]<class T>(Field<Array<T>> field, auto member) {
        auto values = Array<T>::ofSize(parts.size());
        T* out = values.mutableData();
        for (const dis::Articulation& part : parts) *out++ = static_cast<T>(part.*member);
        tell(cascade, node, field, values);
    };
    list(Espdu::articulationParameterArray, &dis::Articulation::value);
    list(Espdu::articulationParameterChangeIndicatorArray, &dis::Articulation::change);
    list(Espdu::articulationParameterDesignatorArray, &dis::Articulation::designator);
    list(Espdu::articulationParameterIdPartAttachedToArray, &dis::Articulation::attachedTo);
    list(Espdu::articulationParameterTypeArray, &dis::Articulation::type);
    tellNumber(cascade, node, Espdu::articulationParameterCount, parts.size());
    tellParts(cascade, node, node.get(Espdu::articulationParameterArray));
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
    tell(cascade, node, Espdu::marking, String(state.marking));
    tellNumber(cascade, node, Espdu::forceID, state.force);
    tellNumber(cascade, node, Espdu::entityKind, state.type.kind);
    tellNumber(cascade, node, Espdu::entityDomain, state.type.domain);
    tellNumber(cascade, node, Espdu::entityCountry, state.type.country);
    tellNumber(cascade, node, Espdu::entityCategory, state.type.category);
    tellNumber(cascade, node, Espdu::entitySubcategory, state.type.subcategory);
    tellNumber(cascade, node, Espdu::entitySpecific, state.type.specific);
    tellNumber(cascade, node, Espdu::entityExtra, state.type.extra);
    tellNumber(cascade, node, Espdu::deadReckoning, state.deadReckoning);
    if (state.deadReckoning > 9)
        cascade.warn(node, fmt::format("dead reckoning {} is none of 0 to 9: it stands", state.deadReckoning));
    const bool isBody = dis::isBodyModel(state.deadReckoning);
    const auto vector = [&](const glm::dvec3& v) {
        return Vec3f(isBody ? dis::modelFromBody(v) : frame->sceneFromWorld * v);
    };
    tell(cascade, node, Espdu::linearVelocity, vector(state.velocity));
    tell(cascade, node, Espdu::linearAcceleration, vector(state.acceleration));
    takeParts(cascade, node, state.articulations);
}

void takeEvent(Cascade& cascade, const Node& node, const dis::EventId& event, const dis::EntityId& author) {
    tellNumber(cascade, node, Espdu::eventSiteID, event.site);
    tellNumber(cascade, node, Espdu::eventApplicationID, event.application);
    tellNumber(cascade, node, Espdu::eventNumber, event.number);
    tellNumber(cascade, node, Espdu::eventEntityID, author.entity);
}
void takeMunition(Cascade& cascade, const Node& node, const dis::EntityId& id, const dis::Descriptor& descriptor) {
    tellNumber(cascade, node, Espdu::munitionSiteID, id.site);
    tellNumber(cascade, node, Espdu::munitionApplicationID, id.application);
    tellNumber(cascade, node, Espdu::munitionEntityID, id.entity);
    tellNumber(cascade, node, Espdu::munitionQuantity, descriptor.quantity);
    tellNumber(cascade, node, Espdu::firingRate, descriptor.rate);
    tellNumber(cascade, node, Espdu::fuse, descriptor.fuse);
    tellNumber(cascade, node, Espdu::warhead, descriptor.warhead);
}

void takeFire(Cascade& cascade, const Node& node, const dis::Fire& fire) {
    const auto frame = frameOf<Espdu>(cascade, node);
    if (!frame) return;
    takeEvent(cascade, node, fire.event, fire.firing);
    takeMunition(cascade, node, fire.munition, fire.descriptor);
    tell(cascade, node, Espdu::fireMissionIndex, static_cast<std::int32_t>(fire.mission));
    tell(cascade, node, Espdu::firingRange, fire.range);
    const glm::dvec3 velocity(fire.velocity);
    const double speed = glm::length(velocity);
    const glm::dvec3 way = speed > 0 ? velocity / speed * double{fire.range} : glm::dvec3(0);
    tell(cascade, node, Espdu::munitionStartPoint, Vec3f(frame->toScene(fire.location)));
    tell(cascade, node, Espdu::munitionEndPoint, Vec3f(frame->toScene(fire.location + way)));
    cascade.emit(node, Espdu::fired1, true);
    cascade.emit(node, Espdu::firedTime, Time{cascade.now()});
}

void takeDetonation(Cascade& cascade, const Node& node, const dis::Detonation& detonation) {
    const auto frame = frameOf<Espdu>(cascade, node);
    if (!frame) return;
    takeEvent(cascade, node, detonation.event, detonation.firing);
    takeMunition(cascade, node, detonation.munition, detonation.descriptor);
    const Vec3f location(frame->toScene(detonation.location));
    tell(cascade, node, Espdu::munitionEndPoint, location);
    tell(cascade, node, Espdu::detonationLocation, location);
    tell(cascade, node, Espdu::detonationRelativeLocation, Vec3f(dis::modelFromBody(detonation.relativeLocation)));
    tellNumber(cascade, node, Espdu::detonationResult, detonation.result);
    cascade.emit(node, Espdu::isDetonated, true);
    cascade.emit(node, Espdu::detonateTime, Time{cascade.now()});
}

void takeCollision(Cascade& cascade, const Node& node, const dis::Collision& collision) {
    takeEvent(cascade, node, collision.event, collision.issuing);
    tellNumber(cascade, node, Espdu::collisionType, collision.type);
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
    const Vec3f place(frame->toScene(pose.location));
    if (!std::isfinite(place.x + place.y + place.z)) {
        cascade.warn(node, "its entity is further away than a float can say: it stays where it was");
        return kNever;
    }
    tell(cascade, node, Espdu::translation, place);
    tell(cascade, node, Espdu::rotation, toRotation(frame->toScene(pose.worldFromBody)));
    return dis::isMoving(*state) ? cascade.now() : kNever;
}

double espduOnTime(Cascade& cascade, const Node& node) {
    tellMode<Espdu>(cascade, node);
    const double end = tellActive<Espdu>(cascade, node);
    return std::min(end, reckon(cascade, node));
}

/// Handles events to an entity that no network speaks for: its own events are the truth, and a writer sends them on.
void espduOnEvent(Cascade& cascade, const Node& node, FieldIndex field, EventValue value) {
    for (std::size_t i = 0; i < kParts; ++i)
        if (field == kSetPart[i].index) return setPart(cascade, node, i, value.as<float>());
    if (field == Espdu::articulationParameterArray.index) {
        tell(cascade, node, Espdu::articulationParameterCount,
             static_cast<std::int32_t>(value.as<Array<float>>().size()));
        return tellParts(cascade, node, value.as<Array<float>>());
    }
    if (isReading<Espdu>(node) || !node.get(Espdu::enabled)) return;
    if (field == Espdu::fired1.index || field == Espdu::fired2.index) {
        if (value.as<bool>()) tell(cascade, node, Espdu::firedTime, Time{cascade.now()});
    } else if (field == Espdu::detonationResult.index || field == Espdu::detonationLocation.index ||
               field == Espdu::detonationRelativeLocation.index) {
        tell(cascade, node, Espdu::isDetonated, true);
        tell(cascade, node, Espdu::detonateTime, Time{cascade.now()});
    } else if (field == Espdu::collisionType.index) {
        tell(cascade, node, Espdu::isCollided, true);
        tell(cascade, node, Espdu::collideTime, Time{cascade.now()});
    }
}

// ---- radios ------------------------------------------------------------------------------------------------------

template <class N>
bool isOfRadio(const Node& node, const auto& radio) {
    return isOf<N>(node, radio.id) && node.get(N::radioID) == radio.radio;
}

void take(Cascade& cascade, const Node& node, const dis::Receiver& r) {
    using N = x3d::ReceiverPdu;
    tellNumber(cascade, node, N::receiverState, r.state);
    tell(cascade, node, N::receivedPower, r.power);
    tellNumber(cascade, node, N::transmitterSiteID, r.transmitter.site);
    tellNumber(cascade, node, N::transmitterApplicationID, r.transmitter.application);
    tellNumber(cascade, node, N::transmitterEntityID, r.transmitter.entity);
    tellNumber(cascade, node, N::transmitterRadioID, r.transmitterRadio);
}

void take(Cascade& cascade, const Node& node, const dis::Signal& s) {
    using N = x3d::SignalPdu;
    tellNumber(cascade, node, N::encodingScheme, s.encoding);
    tellNumber(cascade, node, N::tdlType, s.tdlType);
    tellNumber(cascade, node, N::sampleRate, std::uint64_t{s.sampleRate});
    tellNumber(cascade, node, N::dataLength, s.bits);
    tellNumber(cascade, node, N::samples, s.samples);
    auto data = Array<std::int32_t>::ofSize(s.data.size());
    std::ranges::copy(s.data, data.mutableData());
    cascade.emit(node, N::data, data);  // each is more of the signal, though it be the same
}

void take(Cascade& cascade, const Node& node, const dis::Transmitter& t) {
    using N = x3d::TransmitterPdu;
    const auto frame = frameOf<N>(cascade, node);
    if (!frame) return;
    tellNumber(cascade, node, N::radioEntityTypeKind, t.kind);
    tellNumber(cascade, node, N::radioEntityTypeDomain, t.domain);
    tellNumber(cascade, node, N::radioEntityTypeCountry, t.country);
    tellNumber(cascade, node, N::radioEntityTypeCategory, t.category);
    tellNumber(cascade, node, N::radioEntityTypeNomenclature, t.nomenclature);
    tellNumber(cascade, node, N::radioEntityTypeNomenclatureVersion, t.nomenclatureVersion);
    tellNumber(cascade, node, N::transmitState, t.state);
    tellNumber(cascade, node, N::inputSource, t.inputSource);
    tell(cascade, node, N::antennaLocation, Vec3f(frame->toScene(t.antennaLocation)));
    tell(cascade, node, N::relativeAntennaLocation, Vec3f(dis::modelFromBody(t.relativeAntennaLocation)));
    tellNumber(cascade, node, N::antennaPatternType, t.antennaPatternType);
    tellNumber(cascade, node, N::antennaPatternLength, t.antennaPattern.size());
    tellNumber(cascade, node, N::frequency, t.frequency);
    tell(cascade, node, N::transmitFrequencyBandwidth, t.bandwidth);
    tell(cascade, node, N::power, t.power);
    tellNumber(cascade, node, N::modulationTypeSpreadSpectrum, t.spreadSpectrum);
    tellNumber(cascade, node, N::modulationTypeMajor, t.majorModulation);
    tellNumber(cascade, node, N::modulationTypeDetail, t.detail);
    tellNumber(cascade, node, N::modulationTypeSystem, t.system);
    tellNumber(cascade, node, N::cryptoSystem, t.cryptoSystem);
    tellNumber(cascade, node, N::cryptoKeyID, t.cryptoKey);
    tellNumber(cascade, node, N::lengthOfModulationParameters, t.modulationParameters.size());
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
    tellMode<N>(cascade, node);
    return tellActive<N>(cascade, node);
}

// ---- all of them -------------------------------------------------------------------------------------------------

template <class N>
void hearAs(Cascade& cascade, const Node& node, const HeardPdu& heard, const auto& take) {
    if (!isReading<N>(node)) return;
    const auto pdu = dis::decode(heard.bytes);
    if (!pdu) return cascade.warn(node, fmt::format("a PDU that it was given {}", pdu.error().text));
    if (take(*pdu)) tellHeard<N>(cascade, node, pdu->header, heard.hadRtpHeader);
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
