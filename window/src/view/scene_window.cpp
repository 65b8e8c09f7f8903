// Ties a window to a scene: pictures go one way, what people do goes the other.
#include <rtsg/window/scene_window.h>

#include <algorithm>
#include <deque>
#include <filesystem>
#include <set>

#include <fmt/format.h>

#include <rtsg/core/device_input.h>
#include <rtsg/core/module.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

#include "key_input.h"
#include "window_module.h"

namespace rtsg {

namespace {

using Clock = std::chrono::steady_clock;
using Kind = WindowEvent::Kind;
using Root = x3d::RtsgScene;

constexpr std::size_t kIntervalsKept = 1000;
constexpr double kSkip = 5;              // seconds
constexpr double kLongestInterval = .5;  // seconds: longer ones are rests

Result<std::unique_ptr<WindowModule>> openWindow(const WindowSettings& settings) {
#ifdef RTSG_NO_WINDOW
    (void)settings;
    return fail("this program was built without a window: SDL 2 was not there, or RTSG_WINDOW was off");
#else
    const auto found = loadModule("rtsg_sdl", RTSG_WINDOW_SYMBOL, "a window needs");
    if (!found) return std::unexpected(found.error());
    std::string problem;
    auto window = reinterpret_cast<OpenWindow (*)()>(*found)()(settings, problem);
    if (!window) return fail(fmt::format("no window can be opened: {}", problem));
    return window;
#endif
}

}  // namespace

struct SceneWindow::Impl {
    Impl(SharedWorld& w, SceneWindowOptions o) : world(w), options(std::move(o)) {}

    SharedWorld& world;
    SceneWindowOptions options;
    std::unique_ptr<WindowModule> window;
    std::unique_ptr<LivePicture> picture;  // wakes the window: goes first
    std::optional<Camera> eye;
    std::shared_ptr<const LivePictureShown> shown;
    KeyTranslator keys;
    SceneWindowStatistics statistics;
    std::deque<double> intervals;
    Clock::time_point presentedAt{};
    std::vector<std::string> dropped;
    Diagnostics diagnostics;
    std::set<std::string> told;
    std::string failure;
    double skip = 0;  // seconds
    bool closed = false, paused = false, lost = false;
    int screenshots = 0;

    void tell(const std::string& what) {
        if (told.insert(what).second) diagnostics.warning({}, what);
    }
    void send(FieldIndex field, Value value) {
        ++statistics.events;
        const Result<> sent = options.send ? options.send(field, std::move(value))
                                           : world.scene().sendEvent(world.scene().root(), field, std::move(value));
        if (!sent) tell(sent.error().text);
    }

    // ---- what people do ----------------------------------------------------------------------------------------
    void point(const WindowEvent& event) {
        PointerInput input;
        input.kind = event.kind == Kind::left ? PointerInput::Kind::absent : PointerInput::Kind::picture;
        input.x = event.x, input.y = event.y;
        input.aspect = static_cast<double>(window->width()) / window->height();
        input.buttons = event.buttons;
        send(Root::pointer.index, Value(input.toValue()));
    }

    /// True: the key was for the window itself.
    bool isOwnKey(const WindowEvent& event) {
        const bool isSave = event.control && event.character == U's';
        const bool isPause = event.control && event.key == WindowEvent::Key::space;
        const bool isBack = event.control && event.key == WindowEvent::Key::left;
        const bool isAhead = event.control && event.key == WindowEvent::Key::right;
        const bool isClose = event.key == WindowEvent::Key::escape;
        if (!isClose && event.functionKey != 11 && !isSave && !isPause && !isBack && !isAhead) return false;
        if (event.down && (isBack || isAhead)) skip += isBack ? -kSkip : kSkip;
        if (!event.down || event.repeats) return true;
        if (isClose) closed = true;
        if (event.functionKey == 11) window->toggleFullscreen();
        if (isPause) paused = !paused;
        if (isSave) takeScreenshot();
        return true;
    }

    void takeScreenshot() {
        std::string file;
        do {
            file = fmt::format(fmt::runtime(numbered()), ++screenshots);
        } while (std::filesystem::exists(file));
        if (auto ok = write(file); !ok)
            diagnostics.add(ok.error());
        else
            diagnostics.add({Severity::note, file, {}, "picture written"});
    }
    std::string numbered() const {
        std::string name = options.screenshots;
        const std::size_t at = name.find("%d");
        return at == std::string::npos ? name + "-{}.png" : name.replace(at, 2, "{}");
    }

    void handle(const WindowEvent& event) {
        switch (event.kind) {
            case Kind::close:
                closed = true;
                return;
            case Kind::exposed:
                lost = true;
                return;
            case Kind::resized:
                picture->setSize(event.width, event.height);
                return;
            case Kind::dropped:
                dropped.push_back(event.text);
                return;
            case Kind::pointer:
            case Kind::left:
                return point(event);
            case Kind::wheel: {
                const double steps[] = {event.across, event.downwards};
                return send(Root::wheel.index, Value(Array<double>(std::span<const double>(steps))));
            }
            case Kind::key:
            case Kind::text:
                if (event.kind == Kind::key && isOwnKey(event)) return;
                for (const KeyInput& key : keys.take(event)) send(Root::key.index, Value(key.toValue()));
                if (const std::string text = keys.takeText(); !text.empty())
                    send(Root::text.index, Value(String(text)));
                return;
            case Kind::woken:
            case Kind::other:
            case Kind::none:
                return;
        }
    }

    // ---- what people see ---------------------------------------------------------------------------------------
    void present() {
        if (auto next = picture->take()) {
            shown = std::move(next);
            lost = true;
            const Clock::time_point now = Clock::now();
            const double interval = std::chrono::duration<double>(now - std::exchange(presentedAt, now)).count();
            if (interval < kLongestInterval && statistics.presented > 0) {
                intervals.push_back(interval);
                if (intervals.size() > kIntervalsKept) intervals.pop_front();
            }
            ++statistics.presented;
        }
        if (!shown || !std::exchange(lost, false)) return;
        if (!window->present(shown->pixels.data(), shown->width, shown->height)) tell("the display takes no pictures");
    }

    Result<> write(const std::string& file) const {
        RenderSettings settings = options.picture.settings;
        settings.width = window->width(), settings.height = window->height();
        const auto whole = picture->picture(settings);
        if (!whole) return std::unexpected(whole.error());
        return rtsg::writePicture(*whole, file, options.picture.toneMap);
    }
};

SceneWindow::SceneWindow(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
SceneWindow::~SceneWindow() = default;

Result<std::unique_ptr<SceneWindow>> SceneWindow::open(SharedWorld& world, SceneWindowOptions options) {
    auto impl = std::make_unique<Impl>(world, std::move(options));
    WindowSettings settings;
    settings.title = impl->options.title;
    settings.fullscreen = impl->options.fullscreen;
    settings.width = impl->options.picture.settings.width, settings.height = impl->options.picture.settings.height;
    auto window = openWindow(settings);
    if (!window) return std::unexpected(window.error());
    impl->window = std::move(*window);
    LivePictureOptions pictures = impl->options.picture;
    pictures.settings.width = impl->window->width(), pictures.settings.height = impl->window->height();
    pictures.wake = [w = impl->window.get()] { w->wake(); };
    impl->picture = std::make_unique<LivePicture>(world, std::move(pictures));
    if (auto ok = impl->picture->show(); !ok) return std::unexpected(ok.error());
    return std::unique_ptr<SceneWindow>(new SceneWindow(std::move(impl)));
}

bool SceneWindow::turn(std::chrono::milliseconds atMost) {
    Impl& s = *impl_;
    if (auto ok = s.picture->show(s.eye); !ok) {
        s.failure = ok.error().text;
        return false;
    }
    const Clock::time_point end = Clock::now() + atMost;
    s.present();
    const std::uint64_t before = s.statistics.events;
    while (!s.closed) {
        const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - Clock::now()).count();
        const WindowEvent event = s.window->next(static_cast<int>(std::max<std::int64_t>(0, left)));
        if (event.kind == Kind::none) break;
        s.handle(event);
        s.present();
        if (s.statistics.events == before && s.dropped.empty() && s.skip == 0) continue;
        // What was done is the scene's turn, once all that has come is read.
        for (WindowEvent more = s.window->next(0); more.kind != Kind::none && !s.closed; more = s.window->next(0))
            s.handle(more);
        break;
    }
    return !s.closed;
}

std::string SceneWindow::failure() const {
    return impl_->failure;
}
bool SceneWindow::isPaused() const {
    return impl_->paused;
}
double SceneWindow::takeSkip() {
    return std::exchange(impl_->skip, 0);
}
std::vector<std::string> SceneWindow::takeDropped() {
    return std::exchange(impl_->dropped, {});
}
void SceneWindow::lookFrom(const std::optional<Camera>& eye) {
    impl_->eye = eye;
}
void SceneWindow::setTitle(const std::string& title) {
    impl_->window->setTitle(title);
}
Result<> SceneWindow::writePicture(const std::string& file) {
    return impl_->write(file);
}
bool SceneWindow::isSettled() const {
    return impl_->picture->isDone() && impl_->shown && !impl_->lost;
}

SceneWindowStatistics SceneWindow::statistics() const {
    SceneWindowStatistics statistics = impl_->statistics;
    statistics.intervals.assign(impl_->intervals.begin(), impl_->intervals.end());
    statistics.pictures = impl_->picture->statistics();
    if (impl_->shown) {
        statistics.sequence = impl_->shown->sequence;
        statistics.whole = impl_->shown->whole;
        statistics.samples = impl_->shown->samples;
    }
    return statistics;
}

Diagnostics SceneWindow::takeDiagnostics() {
    return std::exchange(impl_->diagnostics, Diagnostics());
}

}  // namespace rtsg
