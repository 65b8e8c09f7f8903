// What `rtsg view` shows, opened by its name.
#include "view_source.h"

#include <cmath>

#include <fmt/format.h>

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

}  // namespace

Result<std::unique_ptr<ViewSource>> openViewSource(const ViewSourceArguments& arguments) {
    auto running = std::make_unique<RunningSource>(arguments);
    if (auto ok = running->open(arguments); !ok) return std::unexpected(ok.error());
    return running;
}

}  // namespace rtsg::app
