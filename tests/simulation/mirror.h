// Mirror, Relay, Stranger: the processes that follow an origin, ask it for edits, or send it nonsense.
#pragma once

#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include <rtsg/core/scene.h>
#include <rtsg/sync/mirror_client.h>
#include <rtsg/sync/mirror_relay.h>
#include <rtsg/sync/optimistic_scene.h>

#include "origin.h"

namespace rtsg::simulation {

/// What became of edits: each creates a node with a name of its own.
class EditLedger {
  public:
    enum class State : std::uint8_t { asked, accepted, refused, unknown };
    struct Edit {
        State state = State::asked;
        std::uint32_t lineage = 0;
        std::uint64_t at = 0;  // the state that has it
    };
    void ask(const std::string& name) { edits_[name] = {}; }
    void answer(const std::string& name, const MirrorVerdict& verdict, std::uint32_t lineage);
    /// The origin went on from an earlier state, or anew: what came later is lost, and was not acknowledged for good.
    void forgetAfter(std::uint64_t state, std::uint32_t lineage);
    /// What does not hold in the origin's scene; empty if all does.
    std::string check(const Scene& scene, std::uint32_t lineage) const;
    std::size_t size() const { return edits_.size(); }

  private:
    std::map<std::string, Edit> edits_;
};

struct MirrorSettings {
    enum class Kind : std::uint8_t { whole, part, region, aspects, optimistic, inputs, latency };
    Kind kind = Kind::whole;
    MirrorClientOptions options;
    std::string endpoint;
    bool edits = false, locks = false, undoes = false;
    std::uint32_t number = 0;
};

class Mirror : public Process {
  public:
    Mirror(World& world, System& system, Network& network, MirrorSettings settings, EditLedger& ledger)
        : Process(world, system), network_(network), settings_(std::move(settings)), ledger_(ledger) {}
    ~Mirror() override { die(); }

    void start();
    void die();
    void leave();
    /// Empty, or what does not hold.
    std::string poll(const Origin& origin);
    void edit(Random random, std::uint32_t movers);
    /// Edits each node; none of these requests may be refused.
    void editAll(std::uint32_t movers);
    /// Somebody else edits the replica; the client has to notice and repair it.
    void meddle(Random random, std::uint32_t movers);
    bool isRunning() const { return client_ != nullptr; }
    /// The last edit has been answered, and this is in the origin's newest state.
    bool isSettled(const Origin& origin) const;
    const MirrorSettings& settings() const { return settings_; }
    MirrorClient& client() { return *client_; }
    const Scene& scene() const { return *replica_; }
    bool isWhole() const;
    /// False if it may be between two states, because values of what is far come later.
    bool isInStates() const { return isWhole() && settings_.options.whenSlow != MirrorWhenSlow::nearFirst; }
    /// With what is written of its state when something does not hold.
    std::string status() const;

    Nanoseconds startAt = 0;
    std::uint64_t edits = 0;

  private:
    std::string takeVerdicts(const Origin& origin);

    Network& network_;
    const MirrorSettings settings_;
    EditLedger& ledger_;
    std::unique_ptr<Scene> replica_;
    std::unique_ptr<MirrorClient> client_;
    std::unique_ptr<OptimisticScene> optimistic_;
    std::map<std::uint64_t, std::string> asked_;  // names of the nodes that requests create
    std::set<std::uint64_t> certain_;             // requests that may not be refused
    std::uint32_t next_ = 0;
    bool isMeddledWith_ = false;
    std::uint64_t divergences_ = 0;  // that meddling has led to
};

class Relay : public Process {
  public:
    Relay(World& world, System& system, Network& network, std::string from, std::string endpoint,
          MirrorUpstream upstream)
        : Process(world, system),
          network_(network),
          from_(std::move(from)),
          endpoint_(std::move(endpoint)),
          upstream_(upstream) {}
    ~Relay() override { die(); }

    void start();
    void die();
    std::string poll(const Origin& origin);
    bool isRunning() const { return relay_ != nullptr; }
    bool isSettled(const Origin& origin) const;
    const Scene& scene() const { return *replica_; }

    Nanoseconds startAt = 0;

  private:
    Network& network_;
    const std::string from_, endpoint_;
    const MirrorUpstream upstream_;
    std::unique_ptr<Scene> replica_;
    std::unique_ptr<MirrorRelay> relay_;
};

/// Sends messages that are nearly right.
class Stranger : public Process {
  public:
    Stranger(World& world, System& system, Network& network) : Process(world, system), network_(network) {}
    void send(Random random, std::uint32_t count, const std::string& endpoint);
    void poll();

  private:
    Network& network_;
    std::unique_ptr<Connection> connection_;
};

}  // namespace rtsg::simulation
