// A frame of the network: receives datagrams, passes each PDU to its nodes at their intervals, and sends states.
#include <rtsg/dis/dis_network.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "stations.h"

namespace rtsg {

using namespace dis;

namespace {

double systemTime() {
    return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

/// Seconds between two PDUs at most (IEEE 1278.1-2012, 6.1.8). Signals are sent when there are some.
double heartbeatOf(TypeIndex type) {
    if (type == x3d::TransmitterPdu::type) return 2;
    if (type == x3d::ReceiverPdu::type) return 60;
    return DisNetwork::kHeartbeat;
}

constexpr double kClocksAgree = 1;  // seconds

}  // namespace

DisNetwork::DisNetwork(Scene& scene, DisOptions options, std::unique_ptr<DisTransport> transport)
    : stations_(std::make_unique<Stations>(scene, std::move(options), std::move(transport))) {}
DisNetwork::~DisNetwork() = default;
void DisNetwork::receive(double t) {
    stations_->receive(t);
}
void DisNetwork::send() {
    stations_->send();
}
DisNetwork::Counts DisNetwork::counts() const {
    return stations_->counts();
}

DisNetwork::Counts DisNetwork::Stations::counts() const {
    Counts result = counts_;
    result.addresses = open_.size();
    for (const auto& [key, manager] : managers_) result.entities += manager.entities.size();
    return result;
}

// ---- in ----------------------------------------------------------------------------------------------------------

void DisNetwork::Stations::receive(double t) {
    clearRemoved();
    openAddresses();
    for (const auto& [address, relay] : open_) {
        const std::size_t count = transport_->receive(
            address, kMaxDatagrams, [&](std::span<const std::uint8_t> one) { takeDatagram(address, one, t); });
        counts_.datagrams += count;
    }
    for (auto& [key, manager] : managers_) loseSilent(manager, t);
    deliver(t);
}

/// Noise is reported a few times only, so that it hides no other warning.
void DisNetwork::Stations::leaveOut(const DisAddress& address, std::string_view what, const std::string& why) {
    constexpr std::size_t kMaxWarnings = 8;
    ++counts_.unreadable;
    std::size_t& reported = unreadable_[address];
    if (reported == kMaxWarnings) return;
    const std::string last = reported + 1 == kMaxWarnings ? ", and more like it is not told" : "";
    reported +=
        report({}, fmt::format("a {} to {}:{} {}: it is left out{}", what, address.host, address.port, why, last));
}

void DisNetwork::Stations::takeDatagram(const DisAddress& address, std::span<const std::uint8_t> datagram, double t) {
    const auto head = rtpHeaderLength(datagram);
    if (!head) return leaveOut(address, "datagram", head.error().text);
    std::span<const std::uint8_t> rest = datagram.subspan(*head);
    // Several PDUs may come in one datagram.
    while (!rest.empty()) {
        const auto outline = outlineOf(rest);
        if (!outline) return leaveOut(address, "datagram", outline.error().text);
        if (isKnown(outline->type)) takePdu(address, rest.first(outline->length), *head > 0, t);
        rest = rest.subspan(outline->length);
    }
}

void DisNetwork::Stations::takePdu(const DisAddress& address, std::span<const std::uint8_t> bytes, bool hadRtpHeader,
                                   double t) {
    const auto pdu = decode(bytes);
    if (!pdu) return leaveOut(address, "PDU", pdu.error().text);
    for (auto& [key, manager] : managers_)
        if (manager.address == address) manage(manager, *pdu, t);
    const bool isState = !std::holds_alternative<Signal>(pdu->body) && identitiesOf(*pdu).size() == 1 &&
                         !std::holds_alternative<Fire>(pdu->body) && !std::holds_alternative<RemoveEntity>(pdu->body);
    for (const Identity& identity : identitiesOf(*pdu)) {
        const auto found = readers_.find({address, identity});
        if (found == readers_.end()) continue;
        for (const std::uint32_t key : found->second) {
            const auto station = stations_.find(key);
            if (station != stations_.end() && station->second.mode == Mode::reader)
                keep(station->second, {NodeId{key}, hadRtpHeader, {bytes.begin(), bytes.end()}}, isState);
        }
    }
}

/// Keeps a PDU until the node's readInterval is over. Only the last one of several states counts.
void DisNetwork::Stations::keep(Station& station, HeardPdu pdu, bool isState) {
    if (!(station.readInterval > 0)) return;
    const auto typeOf = [](const HeardPdu& one) { return one.bytes[2]; };
    const auto same = std::ranges::find_if(station.waiting, [&](const HeardPdu& one) {
        return typeOf(one) == typeOf(pdu) && (isState || one.bytes == pdu.bytes);
    });
    waiting_.insert(station.node.value);
    if (same != station.waiting.end())
        *same = std::move(pdu);
    else if (station.waiting.size() < kMaxWaiting)
        station.waiting.push_back(std::move(pdu));
    else
        report(station.node, fmt::format("more than {} PDUs in a readInterval: the rest is left out", kMaxWaiting));
}

void DisNetwork::Stations::deliver(double t) {
    std::vector<HeardPdu> pdus;
    for (auto at = waiting_.begin(); at != waiting_.end();) {
        const auto found = stations_.find(*at);
        if (found != stations_.end() && t < found->second.nextRead) {
            ++at;
            continue;
        }
        if (found != stations_.end()) {
            Station& station = found->second;
            station.nextRead = t + station.readInterval;
            std::ranges::move(station.waiting, std::back_inserter(pdus));
            station.waiting.clear();
        }
        at = waiting_.erase(at);
    }
    counts_.heard += pdus.size();
    if (auto ok = hear(scene_, pdus); !ok) report({}, ok.error().text);
}

// ---- out ---------------------------------------------------------------------------------------------------------

void DisNetwork::Stations::send() {
    const double t = scene_.now();
    openAddresses();
    for (const std::uint32_t key : writers_) write(stations_.at(key), t);
}

void DisNetwork::Stations::write(Station& station, double t) {
    const Node* node = scene_.find(station.node);
    if (!node || !(station.writeInterval > 0)) return;
    const bool isSignal = station.type == x3d::SignalPdu::type;
    if (t >= station.nextWrite && (!isSignal || station.hasSignal)) {
        station.nextWrite = t + std::min(station.writeInterval, heartbeatOf(station.type));
        station.hasSignal = false;
        std::string problem;
        if (auto state = stateOf(scene_, station, problem))
            sendPdu(station, *node, std::move(*state), t);
        else
            report(station.node, problem);
    }
    const EntityId& id = station.identity.entity;
    if (std::exchange(station.hasFired, false)) sendPdu(station, *node, fireOf(*node, id), t);
    if (std::exchange(station.hasDetonated, false)) sendPdu(station, *node, detonationOf(*node, id), t);
    if (std::exchange(station.hasCollided, false)) sendPdu(station, *node, collisionOf(*node, id), t);
}

void DisNetwork::Stations::sendPdu(Station& station, const Node& node, Pdu pdu, double t) {
    const double wall = options_.wallClock ? options_.wallClock() : systemTime();
    pdu.header.version = options_.version, pdu.header.exercise = options_.exercise;
    pdu.header.timestamp = timestampOf(t, std::abs(wall - t) < kClocksAgree);
    std::vector<std::uint8_t> bytes = encode(pdu);
    const FieldIndex expected = node.type().findExact("rtpHeaderExpected");
    if (*static_cast<const bool*>(node.storage(expected))) {
        const EntityId& id = station.identity.entity;
        const auto source = static_cast<std::uint32_t>(id.site) << 16 | id.application;
        const auto head = rtpHeader(rtpSequence_++, pdu.header.timestamp, source);
        bytes.insert(bytes.begin(), head.begin(), head.end());
    }
    if (auto ok = transport_->send(station.address, station.relay, bytes); !ok)
        report(station.node, ok.error().text);
    else
        ++counts_.sent;
}

}  // namespace rtsg
