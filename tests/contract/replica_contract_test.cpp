// The subscriber contract for what follows a scene as a whole: a replica, a log, a mirror.
#include <filesystem>
#include <optional>

#include <unistd.h>

#include <rtsg/sync/mirror_client.h>
#include <rtsg/sync/mirror_server.h>
#include <rtsg/sync/replay.h>

#include "support/subscriber_contract.h"

namespace rtsg::test {
namespace {

/// The whole state but for its first line, which has the sequence number.
std::string stateOf(const Scene& scene) {
    const std::string text = scene.dump();
    return text.substr(text.find("hash"));
}

class ReplicaSubject final : public BusSubject {
  public:
    ReplicaSubject() : follower_() {}
    ~ReplicaSubject() override { release(); }
    SubscriberState state() override { return {stateOf(follower_.replica), {}}; }

  private:
    struct Follower final : Subscriber {
        Scene replica;
        Follower() { replica.setBehavioursEnabled(false); }
        Result<> apply(const Scene&, const ChangeSet& changes) override {
            if (changes.isSnapshot())
                if (auto emptied = replica.reset(); !emptied) return emptied;
            return replica.apply(std::make_shared<const ChangeSet>(changes));
        }
    };
    Subscriber& subscriber() override { return follower_; }
    Follower follower_;
};

/// Its state is what a replay of the log ends with.
class LogSubject final : public BusSubject {
  public:
    LogSubject() {
        static int count = 0;
        file_ = std::filesystem::temp_directory_path() /
                ("rtsg_contract_" + std::to_string(::getpid()) + "_" + std::to_string(count++) + ".rlog");
        auto writer = LogWriter::create(file_, builtinTypes());
        if (!writer) throw std::runtime_error(writer.error().text);
        writer_ = std::move(*writer);
    }
    ~LogSubject() override {
        release();
        writer_.reset();
        std::filesystem::remove(file_);
    }
    void attach(Scene& scene, Delivery delivery) override {
        ++attached_;
        BusSubject::attach(scene, delivery);
    }
    SubscriberState state() override {
        auto replayer = Replayer::open(file_);
        if (!replayer) return {replayer.error().text, {}};
        Result<bool> more = true;
        while (more && *more) more = (*replayer)->step();
        if (!more) return {more.error().text, {}};
        EXPECT_EQ((*replayer)->verified(), (*replayer)->frames());
        EXPECT_LT((*replayer)->gaps(), attached_);  // what happened while it was detached is missing, nothing else
        return {stateOf((*replayer)->scene()), {}};
    }

  private:
    Subscriber& subscriber() override { return *writer_; }
    std::filesystem::path file_;
    std::unique_ptr<LogWriter> writer_;
    std::size_t attached_ = 0;
};

/// The server attaches by itself; its state is that of a client's replica. Lazy here means that the client looks for
/// frames now and then.
class MirrorSubject final : public Subject {
  public:
    MirrorSubject() : replica_(std::make_unique<Scene>()) {}

    void attach(Scene& scene, Delivery delivery) override {
        scene_ = &scene;
        delivery_ = delivery;
        auto server = MirrorServer::start(scene, "tcp://127.0.0.1:*");
        if (!server) throw std::runtime_error(server.error().text);
        server_ = std::move(*server);
        auto client = MirrorClient::connect(*replica_, server_->endpoint());
        if (!client) throw std::runtime_error(client.error().text);
        client_ = std::move(*client);
        poll();
    }
    void poll() override {
        // Generous: only a failing test ever waits this long.
        for (int tries = 0; tries < 3000; ++tries) {
            server_->service();
            client_->poll(std::chrono::milliseconds(10));
            // A scene that starts over may come to the same number with another state: that is waited for, too, but not
            // for ever, so that a replica which differs is seen to.
            const MirrorStatistics& s = client_->statistics();
            const bool arrived = s.originHash == scene_->hash() || tries > 100;
            if (client_->inStep() && s.sequence == scene_->sequence() && arrived) return;
        }
        failure_ = "the replica does not get there";
    }
    void detach() override {
        if (delivery_ == Delivery::immediate) poll();
        snapshots_ = client_->statistics().snapshots;
        client_.reset();
        server_.reset();
    }
    SubscriberState state() override {
        if (client_ && delivery_ == Delivery::immediate) poll();
        return {stateOf(*replica_), {}};
    }
    std::string failure() const override {
        if (client_ && client_->statistics().divergences) return "the replica diverged";
        return failure_;
    }
    std::size_t snapshots() const override { return client_ ? client_->statistics().snapshots : snapshots_; }

  private:
    Scene* scene_ = nullptr;
    Delivery delivery_ = Delivery::immediate;
    std::unique_ptr<Scene> replica_;
    std::unique_ptr<MirrorServer> server_;
    std::unique_ptr<MirrorClient> client_;
    std::size_t snapshots_ = 0;
    std::string failure_;
};

INSTANTIATE_TYPED_TEST_SUITE_P(Replica, SubscriberContract, ReplicaSubject);
INSTANTIATE_TYPED_TEST_SUITE_P(Log, SubscriberContract, LogSubject);
INSTANTIATE_TYPED_TEST_SUITE_P(Mirror, SubscriberContract, MirrorSubject);

}  // namespace
}  // namespace rtsg::test
