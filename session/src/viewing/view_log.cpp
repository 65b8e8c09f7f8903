// A view of a log: plays its states or jumps among them, with the viewer's own eye.
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include <rtsg/scripts/run_scripts.h>
#include <rtsg/session/load_scene.h>
#include <rtsg/sync/log_player.h>
#include <rtsg/window/own_eye.h>

#include "viewing/log_notes.h"
#include "viewing/navigation_requests.h"
#include "viewing/open_sources.h"

namespace rtsg {

namespace {

class LogSource final : public ViewSource {
  public:
    explicit LogSource(const ViewSourceOptions& options)
        : file_(options.name), resources_(options.resources), context_(options.context), notes_(file_) {}
    Result<> open() {
        auto player = LogPlayer::open(file_);
        if (!player) return std::unexpected(player.error());
        player_ = std::move(*player);
        runScripts(scene());
        context_.extensions().registerWith(scene());
        scene().setScriptResources(std::make_shared<const Resources>(resources_));
        fetches_.emplace(scene(), resources_);
        if (OwnScene::isNeeded(scene())) {
            own_.emplace(scene());
            context_.extensions().registerWith(own_->scene());
        }
        world_.emplace(own_ ? own_->scene() : scene(), resources_, context_);
        eye_.emplace(world_->get(), own_ ? &*own_ : nullptr);
        return {};
    }

    Scene& scene() override { return player_->scene(); }
    SharedWorld& world() override { return world_->get(); }
    const Resources& resources() const override { return resources_; }
    /// The eye goes on where the log stands still.
    bool advance(double t, bool) override {
        const double seconds = t - std::exchange(time_, t);
        if (auto ok = player_->advance(seconds); !ok) context_.report(ok.error());
        eye_->advance(t);
        return true;
    }
    double restsUntil() const override {
        const bool rests = (player_->ended() || player_->paused()) && !eye_->isMoving();
        return (rests ? 1 : -1) * std::numeric_limits<double>::infinity();
    }
    Result<> send(FieldIndex field, Value value) override {
        eye_->take(field, value);
        return {};
    }
    Result<> look(NodeId viewpoint) override { return eye_->goTo(viewpoint); }
    Result<> change(NodeId, FieldIndex, Value) override { return fail("a log cannot be changed"); }
    std::optional<Camera> eye(double aspect) override { return eye_->camera(aspect); }
    Result<> pause(bool on) override {
        player_->pause(on);
        return {};
    }
    Result<> answer(const SceneWindowRequest& request) override {
        using Kind = SceneWindowRequest::Kind;
        if (isAboutMoving(request)) return carryOut(request, *eye_, rules_);
        switch (request.kind) {
            case Kind::skip:
                return player_->seek(std::clamp(player_->time() + request.number, 0., player_->length()));
            case Kind::seek:
                return player_->seek(std::clamp(request.number, 0., player_->length()));
            case Kind::rate:
                if (request.number > 0) player_->setRate(std::min(request.number, 1000.));
                return {};
            case Kind::step:
                return step(request.number);
            case Kind::history: {
                if (request.field.empty()) return notes_.forget(), Result<>();
                const std::string_view name = scene().name(request.node);
                notes_.ask(
                    fmt::format("{}.{}", name.empty() ? fmt::format("#{}", request.node.value) : name, request.field));
                return {};
            }
            default:
                return {};
        }
    }
    std::string status() const override {
        return fmt::format("{:.1f} of {:.1f} s", player_->time(), player_->length());
    }
    void describe(SceneWindowChoices& choices) override { describeMoving(eye_->navigated(), rules_, choices); }
    void describe(SceneWindowStatus& status) override {
        const Replayer& replayer = player_->replayer();
        status.lines.push_back({"verified",
                                fmt::format("{} of {} states", replayer.verified(), replayer.frames()),
                                replayer.divergence().has_value(),
                                {}});
        SceneWindowTimeline& line = status.timeline.emplace();
        line.time = player_->time(), line.length = player_->length(), line.rate = player_->rate();
        notes_.marks(line);
        status.showsHistory = true;
        status.history = notes_.history();
    }
    Result<> finish() override {
        const Replayer& replayer = player_->replayer();
        if (replayer.divergence()) return fail(replayer.divergence()->format(), {}, file_);
        return {};
    }

  private:
    /// A state on, or to one before: the last that is earlier than the present one.
    Result<> step(double states) {
        if (states > 0) return player_->step(static_cast<std::uint64_t>(states));
        player_->pause(true);
        const std::uint64_t now = scene().sequence();
        const double time = player_->time();
        for (double back = kShortest; scene().sequence() >= now; back *= 2) {
            if (auto ok = player_->seek(std::max(0., time - back)); !ok) return ok;
            if (back > time) break;
        }
        // Steps from there to the state before the wanted one.
        while (scene().sequence() + 1 < now) {
            const std::uint64_t before = scene().sequence();
            if (auto ok = player_->step(1); !ok) return ok;
            if (scene().sequence() <= before) break;
        }
        return {};
    }
    static constexpr double kShortest = 1 / 120.;  // seconds

    const std::string file_;
    const Resources resources_;
    const SessionContext context_;
    std::optional<FollowedFetches> fetches_;
    std::unique_ptr<LogPlayer> player_;
    std::optional<OwnScene> own_;  // as this eye sees it; none where that makes no difference
    std::optional<WorldOnDemand> world_;
    std::optional<OwnEye> eye_;
    ObstacleRules rules_;
    LogNotes notes_;
    double time_ = 0;
};

}  // namespace

Result<std::unique_ptr<ViewSource>> openLog(const ViewSourceOptions& options) {
    auto source = std::make_unique<LogSource>(options);
    if (auto ok = source->open(); !ok) return std::unexpected(ok.error());
    return source;
}

}  // namespace rtsg
