// The window in front of somebody who walks through the demo's hall, without a screen: how often it has a new picture,
// how long a key takes until it is seen, and how long whoever stands still waits for the whole picture.
#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <optional>

#include <rtsg/core/device_input.h>
#include <rtsg/core/navigation.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/light_renderer.h>
#include <rtsg/renderers/world_queries.h>
#include <rtsg/window/scene_window.h>

#include "bench_view.h"

namespace rtsg::bench {

namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

double passedSince(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}
double share(std::vector<double> values, double of) {
    if (values.empty()) return 0;
    std::ranges::sort(values);
    return values[static_cast<std::size_t>(of * static_cast<double>(values.size() - 1))];
}

/// Somebody in front of it: a scene that runs at 60 frames a second, and its window.
class Viewer {
  public:
    Result<> open(const std::string& file) {
        Diagnostics diagnostics;
        if (!loadFile(scene_, file, diagnostics)) return fail("the scene cannot be read");
        // Where it is to be gone round one walks all the same.
        scene_.forEachNode([&](const Node& node) {
            if (node.is(x3d::NavigationInfo::type)) info_ = node.id();
        });
        if (info_) (void)scene_.set(info_, x3d::NavigationInfo::type_, Array<String>{String("WALK")});
        scene_.setNavigation(true);
        world_.emplace(scene_);
        queries_.emplace(*world_, Resources::ofFile(file));
        scene_.setSpaceQueries(&*queries_);
        scene_.newFrame(0);
        SceneWindowOptions options;
        options.picture.settings.width = 1280, options.picture.settings.height = 720;
        options.picture.resources = Resources::ofFile(file);
        auto window = SceneWindow::open(*world_, std::move(options));
        if (!window) return std::unexpected(window.error());
        window_ = std::move(*window);
        return {};
    }
    ~Viewer() {
        window_.reset();
        scene_.setSpaceQueries(nullptr);
    }
    void key(const char* name, bool down) { (void)sendKey(scene_, *KeyInput::named(name, down)); }
    /// A frame, and what is shown until the next one is due.
    void turn() {
        const double now = passedSince(start_);
        scene_.newFrame(now);
        window_->turn(std::chrono::ceil<std::chrono::milliseconds>(
            std::chrono::duration<double>(std::max(0., 1 / 60.0 - (passedSince(start_) - now)))));
        if (const auto shown = window_->shown(); shown && shown != last_) {
            last_ = shown;
            if (shown->isMoving) widths_.push_back(shown->width);
        }
    }
    template <class Wanted>
    double until(const Wanted& wanted) {
        const Clock::time_point begun = Clock::now();
        while (!wanted() && passedSince(begun) < 20) turn();
        return passedSince(begun);
    }
    void walk(double seconds) {
        const char* const ways[] = {"UP", "LEFT", "DOWN", "RIGHT"};
        for (const double end = passedSince(start_) + seconds; passedSince(start_) < end;) {
            const char* way = ways[steps_++ % 4];
            key(way, true);
            for (const double turned = passedSince(start_) + .7; passedSince(start_) < turned;) turn();
            key(way, false);
        }
    }
    /// Seconds from a key to the first picture of a state in which it has moved the viewer.
    double keyToPicture() {
        const std::uint64_t before = scene_.sequence();
        const ViewerPose from = viewerPose(scene_);
        key(steps_++ % 2 == 0 ? "LEFT" : "RIGHT", true);
        std::uint64_t moved = 0;
        const double took = until([&] {
            if (moved == 0 && scene_.sequence() > before && viewerPose(scene_) != from) moved = scene_.sequence();
            return moved != 0 && last_ && last_->sequence >= moved;
        });
        key("LEFT", false), key("RIGHT", false);
        for (int i = 0; i < 20; ++i) turn();
        return took;
    }
    /// Seconds from the frame in which the scene and the viewer stand still to the whole picture.
    double restToWhole() {
        key("LEFT", true);
        for (int i = 0; i < 20; ++i) turn();
        key("LEFT", false);
        turn();
        // Its clocks stop with it.
        const Clock::time_point begun = Clock::now();
        while (!(window_->shown() && window_->shown()->whole) && passedSince(begun) < 20) window_->turn(5ms);
        return passedSince(begun);
    }

    Scene& scene() { return scene_; }
    SceneWindow& window() { return *window_; }
    std::vector<double> widths() const { return widths_; }

  private:
    Scene scene_;
    NodeId info_;
    std::optional<SharedWorld> world_;
    std::optional<WorldQueries> queries_;
    std::unique_ptr<SceneWindow> window_;
    std::shared_ptr<const LivePictureShown> last_;
    std::vector<double> widths_;
    const Clock::time_point start_ = Clock::now();
    int steps_ = 0;
};

bool walked(const Report& report, const std::string& name, const std::string& file, bool quick) {
    Viewer viewer;
    if (const auto ok = viewer.open(file); !ok) {
        report({"view", name + ", " + ok.error().text, "window", "0/1", 0, "", 0, "", 0});
        return false;
    }
    const auto line = [&](const char* what, const char* unit, double value, const char* limit = "", double most = 0) {
        report({"view", name, what, unit, value, "", 0, limit, most});
    };
    viewer.until([&] { return viewer.window().statistics().presented > 0; });
    viewer.walk(quick ? 1 : 8);
    const std::vector<double> intervals = viewer.window().statistics().intervals;
    double sum = 0;
    for (const double one : intervals) sum += one;
    line("pictures a second, walking", "1/s", sum > 0 ? static_cast<double>(intervals.size()) / sum : 0, "budget", 30);
    line("from picture to picture, half", "ms", 1e3 * share(intervals, .5), "budget", 1e3 / 30);
    line("from picture to picture, 95 %", "ms", 1e3 * share(intervals, .95), "budget", 1e3 / 30);
    line("width of the picture, half", "pixels", share(viewer.widths(), .5), "whole", 1280);
    std::vector<double> keys, rests;
    for (int i = 0; i < (quick ? 2 : 12); ++i) keys.push_back(viewer.keyToPicture());
    for (int i = 0; i < (quick ? 1 : 5); ++i) rests.push_back(viewer.restToWhole());
    line("key to picture, half", "ms", 1e3 * share(keys, .5));
    line("key to picture, most", "ms", 1e3 * share(keys, 1));
    line("standing still to the whole picture, half", "ms", 1e3 * share(rests, .5));
    line("standing still to the whole picture, most", "ms", 1e3 * share(rests, 1));
    return true;
}

}  // namespace

bool view(const Report& report, bool quick) {
    // Nobody looks: it needs no display.
    if (!std::getenv("SDL_VIDEODRIVER")) ::setenv("SDL_VIDEODRIVER", "offscreen", 1);
    const std::string hall = "examples/demo/hall.x3dv";
    if (!std::filesystem::exists(hall)) {
        report({"view", "examples/demo/hall.x3dv is not below this folder", "window", "0/1", 0, "", 0, "", 0});
        return false;
    }
    return walked(report, "hall, 1280x720", hall, quick);
}

}  // namespace rtsg::bench
