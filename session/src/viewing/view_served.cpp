// A view of a served scene: a replica, with the viewer's own eye.
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <limits>

#include <fmt/format.h>
#include <poll.h>

#include <rtsg/core/descriptor.h>
#include <rtsg/core/worker.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/nats/mirror_origin.h>
#include <rtsg/scripts/run_scripts.h>
#include <rtsg/session/load_scene.h>
#include <rtsg/sync/mirror_client.h>
#include <rtsg/window/own_eye.h>

#include "viewing/navigation_requests.h"
#include "viewing/open_sources.h"

namespace rtsg {

namespace {

using Clock = std::chrono::steady_clock;

/// Waits at a connection on a thread of its own, while the main thread waits for people: calls `heard` once for each
/// request to wait, when something has arrived.
class ConnectionWaiter {
  public:
    explicit ConnectionWaiter(std::function<void()> heard) : heard_(std::move(heard)) {}

    /// Asked anew while it still waits, nothing changes.
    void wait(const std::array<int, 2>& descriptors) {
        if (waits_.exchange(true)) return;
        worker_.run(
            [this, descriptors] {
                pollfd items[] = {{descriptors[0], POLLIN, 0}, {descriptors[1], POLLIN, 0}, {end_.get(), POLLIN, 0}};
                (void)::poll(items, 3, -1);
                waits_ = false;  // whoever hears may ask again at once
                if (!worker_.stops()) heard_();
            },
            [this] { end_.raise(); });
    }

  private:
    const std::function<void()> heard_;
    Wakeup end_;
    std::atomic<bool> waits_ = false;
    Worker worker_{"rtsg waiter"};  // last: it uses the others
};

/// Pointers and keys reach the origin, if it lets them.
class ServedSource final : public ViewSource {
  public:
    explicit ServedSource(const ViewSourceOptions& options)
        : patience_(options.patience),
          endsWithServer_(options.endsWithServer),
          resources_(options.resources),
          context_(options.context) {}
    Result<> open(const ViewSourceOptions& from) {
        registerDocuments(replica_);
        runScripts(replica_);
        context_.extensions().registerWith(replica_);
        replica_.setScriptResources(std::make_shared<const Resources>(resources_));
        fetches_.emplace(replica_, resources_);
        MirrorClientOptions options;
        options.name = from.author;
        if (!from.key.empty()) {
            auto keys = MirrorKeys::load(from.key);
            if (!keys) return std::unexpected(keys.error());
            options.keys = std::move(*keys);
        }
        auto origin =
            MirrorOrigin::open(from.name, std::chrono::milliseconds(static_cast<std::int64_t>(1e3 * patience_)));
        if (!origin) return std::unexpected(origin.error());
        origin_.emplace(std::move(*origin));
        endpoint_ = origin_->shown();
        if (auto ok = origin_->prepare(options); !ok) return ok;
        auto client = MirrorClient::connect(replica_, origin_->endpoint(), std::move(options));
        if (!client) return std::unexpected(client.error());
        client_ = std::move(*client);
        while (client_->statistics().frames == 0) {
            client_->poll(std::chrono::milliseconds(50));
            if (context_.interrupted()) return fail("interrupted", {}, endpoint_);
            if (!client_->refusal().empty()) return fail(fmt::format("refused: {}", client_->refusal()), {}, endpoint_);
            if (silence() > patience_) return fail(fmt::format("no server for {} s", patience_), {}, endpoint_);
        }
        if (OwnScene::isNeeded(replica_)) {
            own_.emplace(replica_);
            context_.extensions().registerWith(own_->scene());
        }
        world_.emplace(own_ ? own_->scene() : replica_, resources_, context_);
        eye_.emplace(world_->get(), own_ ? &*own_ : nullptr);
        return {};
    }

    Scene& scene() override { return replica_; }
    SharedWorld& world() override { return world_->get(); }
    const Resources& resources() const override { return resources_; }
    bool advance(double t, bool) override {
        client_->poll(std::chrono::milliseconds(0));
        for (const Diagnostic& d : client_->takeDiagnostics())
            if (d.severity != Severity::note) context_.report(d);
        for (const Diagnostic& d : origin_->takeDiagnostics()) context_.report(d);
        for (const MirrorVerdict& verdict : client_->takeVerdicts()) {
            if (verdict.refusal.empty() || !std::exchange(mayAct_, false)) continue;
            context_.note("note: the scene is for looking: " + verdict.refusal);
        }
        eye_->advance(t);
        noteReach();
        left_ = endsWithServer_ && (client_->serverLeft() || silence() > patience_);
        const MirrorClient::Waiting waiting = client_->waiting();
        due_ = t + std::chrono::duration<double>(waiting.maximum).count();
        if (waiter_) waiter_->wait(waiting.descriptors);
        return !left_;
    }
    double restsUntil() const override {
        return eye_->isMoving() || !waiter_ ? -std::numeric_limits<double>::infinity() : due_;
    }
    void wakeBy(const std::function<void()>& wake) override {
        waiter_.reset();
        if (wake) waiter_ = std::make_unique<ConnectionWaiter>(wake);
    }
    Result<> send(FieldIndex field, Value value) override {
        using Root = x3d::RtsgScene;
        const bool isPointer = field == Root::pointer.index;
        if (mayAct_ && (isPointer || field == Root::key.index || field == Root::text.index)) {
            Value theirs = value;
            if (isPointer) {
                const auto pointer = PointerInput::fromValue(value.as<Array<double>>());
                if (!pointer) return std::unexpected(pointer.error());
                theirs = eye_->throughPicture(*pointer).toValue();
            }
            if (auto sent = client_->submitEvent(replica_.root(), field, std::move(theirs)); !sent) mayAct_ = false;
        }
        eye_->take(field, value);
        return {};
    }
    Result<> look(NodeId viewpoint) override { return eye_->goTo(viewpoint); }
    Result<> change(NodeId node, FieldIndex field, Value value) override {
        const auto sent = client_->submitEvent(node, field, std::move(value));
        return sent ? Result<>() : std::unexpected(sent.error());
    }
    std::optional<Camera> eye(double aspect) override { return eye_->camera(aspect); }
    Result<> pause(bool) override { return fail("the time of a served scene cannot be changed here"); }
    Result<> answer(const SceneWindowRequest& request) override {
        return isAboutMoving(request) ? carryOut(request, *eye_, rules_) : pause(true);
    }
    std::string status() const override {
        const MirrorStatistics& statistics = client_->statistics();
        if (client_->serverLeft()) return "the session has ended";
        return client_->originLost() ? "out of reach" : statistics.equal ? "equal" : "not equal";
    }
    void describe(SceneWindowChoices& choices) override { describeMoving(eye_->navigated(), rules_, choices); }
    void describe(SceneWindowStatus& status) override {
        const MirrorStatistics& s = client_->statistics();
        status.lines.push_back({"hash", s.equal ? "equal to the origin's" : "not the origin's", !s.equal, {}});
        status.lines.push_back(
            {"lag", fmt::format("{:.0f} ms, most {:.0f}", 1e3 * s.lag, 1e3 * s.maximumLag), false, {}});
        const std::uint64_t behind = s.originSequence - std::min(s.originSequence, s.sequence);
        if (behind > 0) status.lines.push_back({"behind", fmt::format("{} states", behind), false, {}});
        if (client_->serverLeft())
            status.lines.push_back({"origin", "has ended the session", true, {}});
        else if (client_->originLost())
            status.lines.push_back({"origin", fmt::format("out of reach for {:.0f} s", silence()), true, {}});
        if (s.holes > 0) status.lines.push_back({"missed", fmt::format("{:.1f} s", s.missed), true, {}});
    }
    Result<> finish() override {
        const bool equal = client_->statistics().equal;
        if (left_ && !client_->serverLeft())
            return fail(fmt::format("the server has been silent for {} s", patience_), {}, endpoint_);
        if (!equal) return fail("the replica differs from its origin", {}, endpoint_);
        return {};
    }

  private:
    /// Says once that the origin is gone, and once that it is back.
    void noteReach() {
        const bool isLost = client_->originLost() || client_->serverLeft();
        if (!isLost) heard_ = Clock::now();
        if (endsWithServer_ || isLost == std::exchange(wasLost_, isLost)) return;
        const char* const what = !isLost                 ? "is back"
                                 : client_->serverLeft() ? "has ended the session: the window stays, and looks for it"
                                                         : "is out of reach: the window goes on trying";
        context_.report({isLost ? Severity::warning : Severity::note, endpoint_, {}, what});
    }
    /// Seconds since the origin was heard.
    double silence() const { return std::chrono::duration<double>(Clock::now() - heard_).count(); }

    std::string endpoint_;  // for messages
    const double patience_;
    const bool endsWithServer_;
    const Resources resources_;
    const SessionContext context_;
    std::optional<FollowedFetches> fetches_;
    Scene replica_;
    std::optional<MirrorOrigin> origin_;
    std::unique_ptr<MirrorClient> client_;
    std::optional<OwnScene> own_;  // as this eye sees it; none where that makes no difference
    std::optional<WorldOnDemand> world_;
    std::optional<OwnEye> eye_;
    ObstacleRules rules_;
    Clock::time_point heard_ = Clock::now();
    bool mayAct_ = true, left_ = false, wasLost_ = false;
    double due_ = 0;                            // seconds from the start
    std::unique_ptr<ConnectionWaiter> waiter_;  // goes before the client, at whose descriptors it waits
};

}  // namespace

Result<std::unique_ptr<ViewSource>> openServed(const ViewSourceOptions& options) {
    auto source = std::make_unique<ServedSource>(options);
    if (auto ok = source->open(options); !ok) return std::unexpected(ok.error());
    return source;
}

}  // namespace rtsg
