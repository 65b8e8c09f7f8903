// Opens what `rtsg view` shows, by its name.
#include "view_source.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include <rtsg/core/terminal.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/scripts/run_scripts.h>
#include <rtsg/sync/log_player.h>
#include <rtsg/sync/mirror_client.h>
#include <rtsg/window/own_eye.h>

namespace rtsg::app {

namespace {

/// A file that runs here.
class RunningSource final : public ViewSource {
  public:
    explicit RunningSource(const ViewSourceArguments& arguments)
        : running_(arguments.name, arguments.resources, arguments.start) {
        running_.allowNetwork(arguments.network);
    }
    Result<> open(const ViewSourceArguments& arguments) {
        if (!running_.load()) return fail("nothing to see", {}, arguments.name);
        if (!arguments.mayHaveErrors && running_.errorsOfLoading() > 0) return fail("not shown", {}, arguments.name);
        if (auto ok = running_.inject(arguments.set, 1e9); !ok) return ok;
        running_.frame(0);
        return {};
    }

    Scene& scene() override { return running_.scene(); }
    SharedWorld& world() override { return running_.world().get(); }
    const Resources& resources() const override { return running_.resources(); }
    bool advance(double t, bool acts) override {
        if (acts || t >= running_.restsUntil()) running_.frame(t);
        return true;
    }
    double restsUntil() const override { return running_.restsUntil(); }
    Result<> send(FieldIndex field, Value value) override {
        return scene().sendEvent(scene().root(), field, std::move(value));
    }
    std::optional<Camera> eye(double) override { return std::nullopt; }
    Result<> seek(double) override { return fail("a scene that runs has one time: a log of it has all"); }
    Result<> finish() override {
        running_.printDiagnostics();
        return {};
    }

  private:
    RunningScene running_;
};

using Clock = std::chrono::steady_clock;

/// The replica of a served scene. The viewer is the user's own. Pointers and keys reach the origin, if it allows them.
class MirrorSource final : public ViewSource {
  public:
    explicit MirrorSource(const ViewSourceArguments& arguments)
        : endpoint_(arguments.name),
          patience_(parseSeconds(arguments.patience)),
          resources_(arguments.resources.ofReplica()) {}
    Result<> open(const ViewSourceArguments& arguments) {
        registerDocuments(replica_);
        runScripts(replica_);
        replica_.setScriptResources(std::make_shared<const Resources>(resources_));
        MirrorClientOptions options;
        options.name = arguments.author;
        if (!arguments.key.empty()) {
            auto keys = MirrorKeys::load(arguments.key);
            if (!keys) return std::unexpected(keys.error());
            options.keys = std::move(*keys);
        }
        auto client = MirrorClient::connect(replica_, endpoint_, std::move(options));
        if (!client) return std::unexpected(client.error());
        client_ = std::move(*client);
        while (client_->statistics().frames == 0) {
            client_->poll(std::chrono::milliseconds(50));
            if (interrupted()) return fail("interrupted", {}, endpoint_);
            if (!client_->refusal().empty()) return fail(fmt::format("refused: {}", client_->refusal()), {}, endpoint_);
            if (silence() > patience_) return fail(fmt::format("no server for {} s", patience_), {}, endpoint_);
        }
        world_.emplace(replica_, resources_);
        eye_.emplace(world_->get());
        return {};
    }

    Scene& scene() override { return replica_; }
    SharedWorld& world() override { return world_->get(); }
    const Resources& resources() const override { return resources_; }
    bool advance(double t, bool) override {
        client_->poll(std::chrono::milliseconds(0));
        for (const Diagnostic& d : client_->takeDiagnostics())
            if (d.severity != Severity::note) fmt::print(stderr, "{}\n", terminalText(d.format()));
        for (const MirrorVerdict& verdict : client_->takeVerdicts()) {
            if (verdict.refusal.empty() || !std::exchange(mayAct_, false)) continue;
            fmt::print(stderr, "note: the scene is for looking: {}\n", terminalText(verdict.refusal));
        }
        eye_->advance(t);
        if (!client_->originLost()) heard_ = Clock::now();
        left_ = client_->serverLeft() || silence() > patience_;
        return !left_;
    }
    /// It must be polled.
    double restsUntil() const override { return -std::numeric_limits<double>::infinity(); }
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
    std::optional<Camera> eye(double aspect) override { return eye_->camera(aspect); }
    Result<> seek(double) override { return fail("the time of a served scene is its own"); }
    std::string status() const override {
        const MirrorStatistics& statistics = client_->statistics();
        return client_->originLost() ? "out of reach" : statistics.equal ? "equal" : "not equal";
    }
    Result<> finish() override {
        const bool equal = client_->statistics().equal;
        if (left_ && !client_->serverLeft())
            return fail(fmt::format("the server has been silent for {} s", patience_), {}, endpoint_);
        if (!equal) return fail("the replica differs from its origin", {}, endpoint_);
        return {};
    }

  private:
    /// Seconds since the origin was heard.
    double silence() const { return std::chrono::duration<double>(Clock::now() - heard_).count(); }

    const std::string endpoint_;
    const double patience_;
    const Resources resources_;
    Scene replica_;
    std::unique_ptr<MirrorClient> client_;
    std::optional<WorldOnDemand> world_;
    std::optional<OwnEye> eye_;
    Clock::time_point heard_ = Clock::now();
    bool mayAct_ = true, left_ = false;
};

/// A log that is played. The viewer is the user's own.
class LogSource final : public ViewSource {
  public:
    explicit LogSource(const ViewSourceArguments& arguments)
        : file_(arguments.name), resources_(arguments.resources.ofReplica()) {}
    Result<> open() {
        auto player = LogPlayer::open(file_);
        if (!player) return std::unexpected(player.error());
        player_ = std::move(*player);
        runScripts(scene());
        scene().setScriptResources(std::make_shared<const Resources>(resources_));
        world_.emplace(scene(), resources_);
        eye_.emplace(world_->get());
        return {};
    }

    Scene& scene() override { return player_->scene(); }
    SharedWorld& world() override { return world_->get(); }
    const Resources& resources() const override { return resources_; }
    bool advance(double t, bool) override {
        const double seconds = t - std::exchange(time_, t);
        if (auto ok = player_->advance(seconds); !ok) printError(ok.error());
        eye_->advance(t);
        return true;
    }
    double restsUntil() const override {
        const bool rests = player_->ended() && !eye_->isMoving();
        return (rests ? 1 : -1) * std::numeric_limits<double>::infinity();
    }
    Result<> send(FieldIndex field, Value value) override {
        eye_->take(field, value);
        return {};
    }
    std::optional<Camera> eye(double aspect) override { return eye_->camera(aspect); }
    Result<> seek(double seconds) override {
        return player_->seek(std::clamp(player_->time() + seconds, 0., player_->length()));
    }
    std::string status() const override {
        return fmt::format("{:.1f} of {:.1f} s", player_->time(), player_->length());
    }
    Result<> finish() override {
        const Replayer& replayer = player_->replayer();
        if (replayer.divergence()) return fail(replayer.divergence()->format(), {}, file_);
        return {};
    }

  private:
    const std::string file_;
    const Resources resources_;
    std::unique_ptr<LogPlayer> player_;
    std::optional<WorldOnDemand> world_;
    std::optional<OwnEye> eye_;
    double time_ = 0;
};

template <class Source, class... Arguments>
Result<std::unique_ptr<ViewSource>> opened(const ViewSourceArguments& arguments, const Arguments&... more) {
    auto source = std::make_unique<Source>(arguments);
    if (auto ok = source->open(more...); !ok) return std::unexpected(ok.error());
    return source;
}

}  // namespace

Result<std::unique_ptr<ViewSource>> openViewSource(const ViewSourceArguments& arguments) {
    const bool isEndpoint = arguments.name.find("://") != std::string::npos && !arguments.name.starts_with("file:");
    const bool isHere = !isEndpoint && !isLogOrNamedSo(arguments.name);
    if (!isHere && !arguments.set.empty()) return fail("--set goes with a scene's file", {}, arguments.name);
    if (isEndpoint) return opened<MirrorSource>(arguments, arguments);
    if (!isHere) return opened<LogSource>(arguments);
    return opened<RunningSource>(arguments, arguments);
}

}  // namespace rtsg::app
