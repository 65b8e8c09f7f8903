// Opens what people look at, and implements the scene that runs here.
#include <rtsg/session/view_source.h>

#include <limits>
#include <utility>

#include <fmt/format.h>

#include <rtsg/renderers/world_queries.h>

#include "viewing/navigation_requests.h"
#include "viewing/open_sources.h"

namespace rtsg {

namespace {

/// A file that runs here.
class RunningSource final : public ViewSource {
  public:
    explicit RunningSource(const ViewSourceOptions& options)
        : running_(options.name, options.resources, options.start, options.context) {
        running_.allowNetwork(options.addresses);
    }
    Result<> open(const ViewSourceOptions& options) {
        if (options.reload)
            if (auto ok = running_.followEdits(); !ok) return ok;
        if (!running_.load()) return fail("nothing to see", {}, options.name);
        if (const std::size_t errors = running_.errors(); options.onlyWhole && errors > 0)
            return fail(fmt::format("it has {}, and is not opened",
                                    errors == 1 ? "an error" : fmt::format("{} errors", errors)),
                        {}, options.name);
        if (auto ok = running_.inject(options.set, 1e9); !ok) return ok;
        running_.frame(0);
        return {};
    }

    Scene& scene() override { return running_.scene(); }
    SharedWorld& world() override { return running_.world().get(); }
    const Resources& resources() const override { return running_.resources(); }
    bool takesEvents() const override { return !isPaused_; }
    /// Time that it stood still counts for nothing.
    bool advance(double t, bool acts) override {
        if (isPaused_) stood_ += t - last_;
        last_ = t;
        const bool isDue = !isPaused_ && (acts || t - stood_ >= running_.restsUntil());
        if (isDue || running_.isEdited()) running_.frame(t - stood_);
        running_.reportNews();
        return true;
    }
    double restsUntil() const override {
        return isPaused_ ? std::numeric_limits<double>::infinity() : running_.restsUntil() + stood_;
    }
    Result<> send(FieldIndex field, Value value) override {
        return scene().sendEvent(scene().root(), field, std::move(value));
    }
    Result<> look(NodeId viewpoint) override {
        const Node* node = scene().find(viewpoint);
        if (!node) return fail("the viewpoint is no longer there");
        return scene().sendEvent(viewpoint, node->type().findExact("set_bind"), Value(true));
    }
    Result<> change(NodeId node, FieldIndex field, Value value) override {
        return scene().sendEvent(node, field, std::move(value));
    }
    std::optional<Camera> eye(double) override { return std::nullopt; }
    Result<> pause(bool on) override {
        isPaused_ = on;
        return {};
    }
    Result<> answer(const SceneWindowRequest& request) override {
        if (!isAboutMoving(request)) return ViewSource::answer(request);
        const Result<> done = carryOut(request, scene(), running_.queries(), rules_);
        running_.queries().setObstacles(rules_);
        return done;
    }
    using ViewSource::describe;
    void describe(SceneWindowChoices& choices) override { describeMoving(running_.scene(), rules_, choices); }
    Result<> finish() override {
        running_.reportDiagnostics();
        return {};
    }

  private:
    RunningScene running_;
    ObstacleRules rules_;
    bool isPaused_ = false;
    double last_ = 0, stood_ = 0;  // seconds
};

Result<std::unique_ptr<ViewSource>> openRunning(const ViewSourceOptions& options) {
    auto source = std::make_unique<RunningSource>(options);
    if (auto ok = source->open(options); !ok) return std::unexpected(ok.error());
    return source;
}

}  // namespace

Result<std::unique_ptr<ViewSource>> openViewSource(const ViewSourceOptions& options) {
    using Kind = ViewSourceOptions::Kind;
    const bool isHere = options.kind == Kind::scene;
    if (!isHere && !options.set.empty()) return fail("--set goes with a scene's file", {}, options.name);
    if (!isHere && options.reload) return fail("--reload is for a scene's file", {}, options.name);
    if (options.kind == Kind::served) return openServed(options);
    return isHere ? openRunning(options) : openLog(options);
}

}  // namespace rtsg
