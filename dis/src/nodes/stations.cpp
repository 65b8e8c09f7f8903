// The list of DIS nodes, the settings in their fields, and the addresses that are listened to for them.
#include "stations.h"

#include <algorithm>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

namespace rtsg {

using namespace dis;

namespace {

using Espdu = x3d::EspduTransform;
using EntityManager = x3d::DISEntityManager;

/// Calls with the handles of the node's type; false if the node neither reads nor writes.
template <class F>
bool withDisType(TypeIndex type, F&& call) {
    if (type == Espdu::type) return call.template operator()<Espdu>(), true;
    if (type == x3d::ReceiverPdu::type) return call.template operator()<x3d::ReceiverPdu>(), true;
    if (type == x3d::SignalPdu::type) return call.template operator()<x3d::SignalPdu>(), true;
    if (type == x3d::TransmitterPdu::type) return call.template operator()<x3d::TransmitterPdu>(), true;
    return false;
}

bool isStation(TypeIndex type) {
    return withDisType(type, []<class N>() {});
}

/// Whether a station that reads or writes depends on the field.
bool isSetup(std::string_view name) {
    for (const std::string_view one :
         {"address", "port", "multicastRelayHost", "multicastRelayPort", "networkMode", "enabled", "siteID",
          "applicationID", "entityID", "radioID", "readInterval", "writeInterval"})
        if (name == one) return true;
    return false;
}

DisAddress addressOf(std::string_view host, std::int32_t port) {
    return {std::string(host), port > 0 && port < 65536 ? static_cast<std::uint16_t>(port) : std::uint16_t{0}};
}

EntityId entityIdOf(std::int32_t site, std::int32_t application, std::int32_t entity) {
    return {static_cast<std::uint16_t>(site), static_cast<std::uint16_t>(application),
            static_cast<std::uint16_t>(entity)};
}

}  // namespace

DisNetwork::Stations::Stations(Scene& scene, DisOptions options, std::unique_ptr<DisTransport> transport)
    : scene_(scene), options_(std::move(options)), transport_(std::move(transport)) {
    attachment_ = scene_.bus().attach(*this);
}
DisNetwork::Stations::~Stations() = default;

Result<> DisNetwork::Stations::apply(const Scene& scene, const ChangeSet& changes) {
    if (changes.isSnapshot()) {
        stations_.clear(), managers_.clear(), readers_.clear(), writers_.clear(), waiting_.clear();
        isStale_ = true;
        scene.forEachNode([&](const Node& node) { note(node); });
        return {};
    }
    for (const Change& change : changes.changes) {
        if (change.kind == ChangeKind::createNode) {
            if (const Node* node = scene.find(change.node)) note(*node);
            continue;
        }
        if (stations_.empty() && managers_.empty()) continue;
        if (change.kind == ChangeKind::destroyNode) forget(change.node);
        if (change.kind != ChangeKind::setField) continue;
        const Node* node = scene.find(change.node);
        if (!node) continue;
        const bool isManager = node->is(EntityManager::type);
        if (!isManager && !isStation(node->typeIndex())) continue;
        if (isSetup(node->type().fields[change.field].name)) dirty_.insert(change.node.value);
        const auto found = stations_.find(change.node.value);
        if (found == stations_.end()) continue;
        Station& station = found->second;
        station.hasFired |= station.type == Espdu::type && change.field == Espdu::firedTime.index;
        station.hasDetonated |= station.type == Espdu::type && change.field == Espdu::detonateTime.index;
        station.hasCollided |= station.type == Espdu::type && change.field == Espdu::collideTime.index;
        station.hasSignal |= station.type == x3d::SignalPdu::type && change.field == x3d::SignalPdu::data.index;
    }
    return {};
}

void DisNetwork::Stations::note(const Node& node) {
    const std::uint32_t key = node.id().value;
    if (isStation(node.typeIndex())) {
        if (stations_.contains(key)) return;
        Station& station = stations_[key];
        station.node = node.id(), station.type = node.typeIndex();
    } else if (node.is(EntityManager::type)) {
        if (managers_.contains(key)) return;
        managers_[key].node = node.id();
    } else {
        return;
    }
    dirty_.insert(key);
}

void DisNetwork::Stations::forget(NodeId id) {
    isStale_ = isStale_ || stations_.contains(id.value) || managers_.contains(id.value);
    stations_.erase(id.value), managers_.erase(id.value), writers_.erase(id.value), waiting_.erase(id.value);
    dirty_.erase(id.value);
}

bool DisNetwork::Stations::report(NodeId node, const std::string& text) {
    constexpr std::size_t kMax = 1000;
    if (reported_.size() >= kMax || !reported_.emplace(node.value, text).second) return false;
    const Node* of = scene_.find(node);
    const std::string_view name = scene_.name(node);
    scene_.diagnostics().warning(
        {}, fmt::format("{}{}{}: {}", of ? of->type().name : "DIS", name.empty() ? "" : " ", name, text));
    return true;
}

/// "HOST", "HOST:PORT" or "any" of --dis; a port of its own follows the last colon behind any bracket.
bool DisNetwork::Stations::mayUse(NodeId node, const DisAddress& address) {
    if (address.host.empty() || address.port == 0) {
        report(node, fmt::format("address '{}' and port {} are none: no network is used", address.host, address.port));
        return false;
    }
    const std::string withPort = fmt::format("{}:{}", address.host, address.port);
    const std::string bracketed = fmt::format("[{}]:{}", address.host, address.port);
    for (const std::string& one : options_.allowed)
        if (one == "any" || one == address.host || one == withPort || one == bracketed) return true;
    report(node, fmt::format("no network is used for {}: --dis {} allows it", withPort, withPort));
    return false;
}

void DisNetwork::Stations::readFields(Station& station, const Node& node) {
    withDisType(node.typeIndex(), [&]<class N>() {
        const std::string_view mode = node.get(N::networkMode).view();
        station.mode = !node.get(N::enabled)     ? Mode::standAlone
                       : mode == "networkReader" ? Mode::reader
                       : mode == "networkWriter" ? Mode::writer
                                                 : Mode::standAlone;
        station.address = addressOf(node.get(N::address).view(), node.get(N::port));
        station.relay = addressOf(node.get(N::multicastRelayHost).view(), node.get(N::multicastRelayPort));
        station.identity.entity = entityIdOf(node.get(N::siteID), node.get(N::applicationID), node.get(N::entityID));
        if constexpr (!std::is_same_v<N, Espdu>) station.identity.radio = node.get(N::radioID);
        station.readInterval = node.get(N::readInterval).seconds;
        station.writeInterval = node.get(N::writeInterval).seconds;
    });
}

void DisNetwork::Stations::look(const Node& node) {
    isStale_ = true;
    if (const auto found = managers_.find(node.id().value); found != managers_.end()) {
        Manager& manager = found->second;
        manager.address = addressOf(node.get(EntityManager::address).view(), node.get(EntityManager::port));
        // A session that goes on: its entities have until the timeout to be heard of.
        for (const NodeId id : node.get(EntityManager::_entities))
            if (const Node* one = scene_.find(id); one && one->is(Espdu::type))
                manager.entities.try_emplace(
                    entityIdOf(one->get(Espdu::siteID), one->get(Espdu::applicationID), one->get(Espdu::entityID)),
                    Manager::Entity{id, scene_.now()});
        return;
    }
    const auto found = stations_.find(node.id().value);
    if (found == stations_.end()) return;
    Station& station = found->second;
    readFields(station, node);
    writers_.erase(node.id().value);
    if (station.mode == Mode::standAlone || !mayUse(node.id(), station.address)) {
        station.mode = Mode::standAlone;
        return;
    }
    if (!station.relay.host.empty() && !mayUse(node.id(), station.relay)) station.relay = {};
    if (station.mode == Mode::writer) writers_.insert(node.id().value);
}

/// Listens to what somebody asks for, and no longer to the rest.
void DisNetwork::Stations::openAddresses() {
    for (const std::uint32_t key : std::exchange(dirty_, {}))
        if (const Node* node = scene_.find(NodeId{key})) look(*node);
    if (!std::exchange(isStale_, false)) return;
    readers_.clear();
    std::map<DisAddress, std::pair<NodeId, DisAddress>> wanted;
    for (const auto& [key, station] : stations_) {
        if (station.mode == Mode::standAlone) continue;
        if (station.mode == Mode::writer && station.type != Espdu::type) continue;
        readers_[{station.address, station.identity}].push_back(key);
        if (station.mode == Mode::reader && station.readInterval > 0)
            wanted.try_emplace(station.address, station.node, station.relay);
    }
    for (const auto& [key, manager] : managers_)
        if (mayUse(manager.node, manager.address)) wanted.try_emplace(manager.address, manager.node, DisAddress{});
    for (auto at = open_.begin(); at != open_.end();) {
        if (wanted.contains(at->first)) {
            ++at;
            continue;
        }
        transport_->stopListening(at->first);
        at = open_.erase(at);
    }
    for (const auto& [address, who] : wanted) {
        if (open_.contains(address)) continue;
        if (auto ok = transport_->listen(address, who.second); !ok)
            report(who.first, ok.error().text);
        else
            open_.emplace(address, who.second);
    }
}

}  // namespace rtsg
