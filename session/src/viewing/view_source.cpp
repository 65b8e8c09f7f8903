// Opens the source of `rtsg view` by its name, and implements the scene that runs here.
#include "view_source.h"

#include <limits>
#include <utility>

#include <rtsg/core/web_address.h>

namespace rtsg::app {

namespace {

/// A file that runs here.
class RunningSource final : public ViewSource {
  public:
    explicit RunningSource(const ViewSourceArguments& arguments)
        : running_(arguments.name, inBackground(arguments.resources), arguments.start) {
        running_.allowNetwork(arguments.network);
        if (arguments.reload) running_.followEdits();
    }
    Result<> open(const ViewSourceArguments& arguments) {
        if (!running_.load()) return fail("nothing to see", {}, arguments.name);
        if (auto ok = running_.inject(arguments.set, 1e9); !ok) return ok;
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
    Result<> finish() override {
        running_.printDiagnostics();
        return {};
    }

  private:
    /// A window does not stand still while something comes.
    static ResourceArguments inBackground(ResourceArguments resources) {
        resources.inBackground = true;
        return resources;
    }

    RunningScene running_;
    bool isPaused_ = false;
    double last_ = 0, stood_ = 0;  // seconds
};

Result<std::unique_ptr<ViewSource>> openRunning(const ViewSourceArguments& arguments) {
    auto source = std::make_unique<RunningSource>(arguments);
    if (auto ok = source->open(arguments); !ok) return std::unexpected(ok.error());
    return source;
}

bool isEndpoint(const std::string& name) {
    return name.find("://") != std::string::npos && !name.starts_with("file:") && !isWebAddress(name);
}

}  // namespace

bool isSceneFile(const std::string& name) {
    return !isEndpoint(name) && !isLogOrNamedSo(name);
}

Result<std::unique_ptr<ViewSource>> openViewSource(const ViewSourceArguments& arguments) {
    const bool isHere = isSceneFile(arguments.name);
    if (!isHere && !arguments.set.empty()) return fail("--set goes with a scene's file", {}, arguments.name);
    if (!isHere && arguments.reload) return fail("--reload is for a scene's file", {}, arguments.name);
    if (isEndpoint(arguments.name)) return openServed(arguments);
    return isHere ? openRunning(arguments) : openLog(arguments);
}

}  // namespace rtsg::app
