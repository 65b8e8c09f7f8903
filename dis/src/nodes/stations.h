// The network's record of each DIS node of a scene: where it listens or sends, for whom, and when next.
//
// Stations follow the scene by its bus; the rest is found in the nodes' fields when it is needed. Threading: the
// scene's thread.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include <rtsg/core/bus.h>
#include <rtsg/core/dis_input.h>
#include <rtsg/core/dis_pdu.h>
#include <rtsg/dis/dis_network.h>

namespace rtsg {

namespace dis {

enum class Mode : std::uint8_t { standAlone, reader, writer };

/// The identity of an entity (then the radio is -1), or of one of its radios.
struct Identity {
    EntityId entity;
    std::int32_t radio = -1;
    friend auto operator<=>(const Identity&, const Identity&) = default;
};

struct Station {
    NodeId node;
    TypeIndex type;
    Mode mode = Mode::standAlone;
    DisAddress address, relay;
    Identity identity;
    double readInterval = 0, writeInterval = 0, nextRead = -1e300, nextWrite = -1e300;
    std::vector<HeardPdu> waiting;
    // The events of a writer since it last sent.
    bool hasFired = false, hasDetonated = false, hasCollided = false, hasSignal = false;
};

/// A DISEntityManager, and the entities that it has made nodes for.
struct Manager {
    struct Entity {
        NodeId node;
        double heard = 0;
    };
    NodeId node;
    DisAddress address;
    std::map<EntityId, Entity> entities;
    double nextLook = -1e300;
};

/// The entities or radios that the PDU is about. PDUs of collisions and detonations are about several.
std::vector<Identity> identitiesOf(const Pdu& pdu);
/// The PDU with a writer's own state; nothing for other nodes.
std::optional<Pdu> stateOf(const Scene& scene, const Station& station, std::string& problem);
Pdu fireOf(const Node& node, const EntityId& id);
Pdu detonationOf(const Node& node, const EntityId& id);
Pdu collisionOf(const Node& node, const EntityId& id);

}  // namespace dis

class DisNetwork::Stations final : public Subscriber {
  public:
    Stations(Scene& scene, DisOptions options, std::unique_ptr<DisTransport> transport);
    ~Stations() override;

    Result<> apply(const Scene& scene, const ChangeSet& changes) override;
    std::string subscriberName() const override { return "DIS network"; }
    void receive(double t);
    void send();
    Counts counts() const;

  private:
    // stations.cpp: who there is
    void note(const Node& node);
    void forget(NodeId id);
    void look(const Node& node);
    void readFields(dis::Station& station, const Node& node);
    bool mayUse(NodeId node, const DisAddress& address);
    void openAddresses();
    /// False: it has been said, or enough has.
    bool report(NodeId node, const std::string& text);

    // dis_network.cpp: what comes and goes
    void takeDatagram(const DisAddress& address, std::span<const std::uint8_t> datagram, double t);
    void leaveOut(const DisAddress& address, std::string_view what, const std::string& why);
    void takePdu(const DisAddress& address, std::span<const std::uint8_t> bytes, bool hadRtpHeader, double t);
    void keep(dis::Station& station, HeardPdu pdu, bool isState);
    void deliver(double t);
    void write(dis::Station& station, double t);
    void sendPdu(dis::Station& station, const Node& node, dis::Pdu pdu, double t);

    // managers.cpp: entities that are heard of
    void manage(dis::Manager& manager, const dis::Pdu& pdu, double t);
    void add(dis::Manager& manager, const dis::EntityState& state, double t);
    void remove(dis::Manager& manager, std::map<dis::EntityId, dis::Manager::Entity>::iterator entity);
    void loseSilent(dis::Manager& manager, double t);
    void clearRemoved();

    Scene& scene_;
    DisOptions options_;
    std::unique_ptr<DisTransport> transport_;
    Attachment attachment_;
    std::unordered_map<std::uint32_t, dis::Station> stations_;
    std::unordered_map<std::uint32_t, dis::Manager> managers_;
    /// By address and identity: readers. And all that some node stands for, for managers.
    std::map<std::pair<DisAddress, dis::Identity>, std::vector<std::uint32_t>> readers_;
    std::set<std::uint32_t> writers_, waiting_;  // waiting_: readers with PDUs
    std::map<DisAddress, DisAddress> open_;      // addresses listened to, with their relays
    std::set<std::uint32_t> dirty_;              // nodes whose fields are to be read again
    std::set<std::pair<std::uint32_t, std::string>> reported_;
    std::map<DisAddress, std::size_t> unreadable_;  // how many were told of
    std::vector<std::pair<NodeId, int>> removed_;   // nodes of entities that are gone, and frames since
    std::uint16_t rtpSequence_ = 0;
    Counts counts_;
    bool isStale_ = false;  // readers or managers have come, gone or changed
};

}  // namespace rtsg
