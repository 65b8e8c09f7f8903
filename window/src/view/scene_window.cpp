// Ties a window to a scene: pictures go one way, what people do goes the other.
#include <rtsg/window/scene_window.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <deque>
#include <filesystem>
#include <set>

#include <fmt/format.h>

#include <rtsg/core/device_input.h>
#include <rtsg/core/module.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/world_queries.h>

#include "file_list.h"
#include "key_input.h"
#include "key_list.h"
#include "overlay_maker.h"
#include "pointed.h"
#include "window_module.h"

namespace rtsg {

namespace {

using Clock = std::chrono::steady_clock;
using Kind = WindowEvent::Kind;
using Root = x3d::RtsgScene;

constexpr std::size_t kIntervalsKept = 1000;
constexpr double kSkip = 5;                  // seconds
constexpr double kLongestInterval = .5;      // seconds: longer ones are rests
constexpr double kStickSteps = 4;            // of the wheel a second: NavigationInfo's speed
constexpr double kStickRotation = M_PI / 2;  // radians a second
constexpr double kStickLongest = .1;         // seconds that a stick counts for at once
constexpr auto kStickEvery = std::chrono::milliseconds(16);
constexpr auto kOverlayEvery = std::chrono::milliseconds(100);
constexpr std::size_t kFrameTimes = 120;
constexpr std::size_t kMaxMessages = 500;
constexpr auto kNoteShown = std::chrono::seconds(6);         // warnings and errors stay until they are forgotten
constexpr auto kPointEvery = std::chrono::milliseconds(50);  // looks for what the pointer is over
constexpr auto kDiagnosticsEvery = std::chrono::milliseconds(250);
constexpr double kClick = .01;  // of the picture: a press that is moved no more is a click

using Asked = SceneWindowRequest::Kind;

const char* nameOf(Integrator integrator) {
    return integrator == Integrator::path ? "path" : integrator == Integrator::raster ? "OGRE" : "whitted";
}
Integrator integratorOf(const std::string& name) {
    return name == "path" ? Integrator::path : name == "OGRE" ? Integrator::raster : Integrator::whitted;
}

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
    Impl(SharedWorld& w, SceneWindowOptions o) : world(w), options(std::move(o)), maker(w) {}

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
    double showing = 0;  // seconds that it takes to show a picture, a moving mean
    std::vector<std::string> dropped;
    Diagnostics diagnostics;
    std::set<std::string> reported;
    std::string failure;
    std::vector<SceneWindowRequest> requests;
    bool closed = false, paused = false, lost = false, wasMoving = false, isSeen = true;
    std::atomic<bool> called{false};
    int screenshots = 0;
    WindowEvent sticks;  // as they are
    Clock::time_point steered{};

    std::optional<Vec3d> probe;  // world
    bool probeTouches = false;
    std::vector<std::uint8_t> marked;     // the picture with the probe
    bool overlay = false, stale = false;  // it is shown; it must be made anew
    OverlayMaker maker;
    std::shared_ptr<const OverlayContent> content;
    Clock::time_point created{};
    SceneWindowStatus status;
    std::shared_ptr<const std::vector<OverlayContent::Mark>> marks;
    std::optional<WorldQueries> queries;
    std::uint32_t buttons = 0;  // of the pointer, as it was last

    // The bar, and what else is there for everybody.
    bool bar = false, listsMessages = false, listsKeys = false, listsFiles = false;
    SceneWindowChoices choices;
    std::deque<Diagnostic> messages;
    std::size_t messageCount = 0;
    Clock::time_point saidAt{};  // the newest message
    FileList folder;
    std::optional<PointerInput> over;  // where the pointer is, if what is there is still to be found
    Clock::time_point pointedAtTime{}, diagnosedAt{};
    Pointed pointed, pressedOn;
    PointerInput pressedAt;

    void report(const std::string& what) {
        if (reported.insert(what).second) diagnostics.warning({}, what);
    }
    void send(FieldIndex field, Value value) {
        ++statistics.events;
        const Result<> sent = options.send ? options.send(field, std::move(value))
                                           : world.scene().sendEvent(world.scene().root(), field, std::move(value));
        if (!sent) report(sent.error().text);
    }

    // ---- what people do ----------------------------------------------------------------------------------------
    void point(const WindowEvent& event) {
        PointerInput input;
        input.kind = event.kind == Kind::left ? PointerInput::Kind::absent : PointerInput::Kind::picture;
        input.x = event.x, input.y = event.y;
        input.aspect = static_cast<double>(window->width()) / window->height();
        input.buttons = event.buttons;
        const std::uint32_t pressed = event.buttons & ~buttons, released = buttons & ~event.buttons;
        buttons = event.buttons;
        if (overlay && (pressed & PointerInput::kPrimary) != 0) pick(input);
        over = input;
        if (input.kind == PointerInput::Kind::absent || ((pressed | released) & PointerInput::kPrimary) != 0)
            findPointed();
        if ((pressed & PointerInput::kPrimary) != 0) pressedOn = pointed, pressedAt = input;
        if ((released & PointerInput::kPrimary) != 0) click(input);
        send(Root::pointer.index, Value(input.toValue()));
    }
    /// An Anchor follows a click on it; where it leads out of the scene is the application's to know.
    void click(const PointerInput& at) {
        const bool isStill = std::hypot(at.x - pressedAt.x, at.y - pressedAt.y) < kClick;
        if (isStill && pointed.anchor && pointed.anchor == pressedOn.anchor)
            ask({Asked::anchor, 0, false, pointed.anchor, {}});
    }
    /// Finds out what the pointer is over, and shows it by its shape and a tip.
    void findPointed() {
        if (!over) return;
        const Clock::time_point now = Clock::now();
        pointedAtTime = now;
        const PointerInput at = *std::exchange(over, std::nullopt);
        Pointed next;
        if (at.kind == PointerInput::Kind::picture)
            if (const auto hit = hitAt(at)) next = pointedAt(world.scene(), hit->path);
        if (next == pointed) return;
        if (next.reacts != pointed.reacts) window->setHand(next.reacts);
        stale = stale || next.description != pointed.description;
        pointed = std::move(next);
    }
    /// The same at most so often while the pointer moves; nobody points at anything while a button is down.
    void followPointer() {
        if (over && buttons == 0 && Clock::now() >= pointedAtTime + kPointEvery) findPointed();
    }

    std::optional<PointerHit> hitAt(const PointerInput& at) {
        if (!queries) queries.emplace(world, options.picture.resources);
        std::optional<PointerHit> hit;
        if (eye) {
            const Camera::WorldRay ray = eye->shaped(at.aspect).ray(at.x, at.y);
            hit = queries->firstHit(ray.origin, ray.direction);
        } else if (const auto seen = queries->throughPicture(at.x, at.y, std::nullopt)) {
            hit = seen->hit;
        } else {
            const Bearing bearing = bearingThrough(world.scene(), at.x, at.y, at.aspect);
            hit = queries->firstHit(bearing.origin, bearing.direction);
        }
        return hit;
    }
    /// Selects the node at a place of the picture in the overlay.
    void pick(const PointerInput& at) {
        const auto hit = hitAt(at);
        maker.pickOnPath(hit ? hit->path : std::vector<NodeId>());
        forgetHistory();
        stale = true;
    }
    /// It was of the node that was picked before.
    void forgetHistory() {
        status.history.clear();
        if (status.showsHistory) ask({SceneWindowRequest::Kind::history, 0, false, maker.picked(), {}});
    }

    /// Sticks that are not in the middle move the viewer on.
    void steer() {
        const Clock::time_point now = Clock::now();
        const double seconds = std::chrono::duration<double>(now - std::exchange(steered, now)).count();
        if (!isSteered()) return;
        const double count = std::min(seconds, kStickLongest), steps = kStickSteps * count,
                     poll = kStickRotation * count;
        const double moves[] = {sticks.leftX * steps, sticks.leftY * steps, sticks.rightX * poll,
                                -sticks.rightY * poll};
        send(Root::wheel.index, Value(Array<double>(std::span<const double>(moves))));
    }
    bool isSteered() const {
        return sticks.leftX != 0 || sticks.leftY != 0 || sticks.rightX != 0 || sticks.rightY != 0;
    }
    void padButton(const WindowEvent& event) {
        using Button = WindowEvent::PadButton;
        const bool isNext = event.padButton == Button::rightShoulder;
        if (isNext || event.padButton == Button::leftShoulder) {
            KeyInput key;
            key.down = event.down;
            key.action = isNext ? ActionKey::pageDown : ActionKey::pageUp;
            send(Root::key.index, Value(key.toValue()));
        }
        if (event.down && event.padButton == Button::start) togglePause();
        if (event.down && event.padButton == Button::back) showOverlay(!overlay);
    }

    void ask(SceneWindowRequest request) {
        // In a drag along the time line only the last place counts.
        if (request.kind == SceneWindowRequest::Kind::seek && !requests.empty() && requests.back().kind == request.kind)
            requests.pop_back();
        requests.push_back(std::move(request));
    }
    void ask(SceneWindowRequest::Kind kind, double number = 0) { ask({kind, number, false, {}, {}}); }
    void togglePause() {
        paused = !paused;
        ask({SceneWindowRequest::Kind::pause, 0, paused, {}, {}});
        stale = true;
    }

    // ---- what the bar offers -----------------------------------------------------------------------------------
    void chooseNext() {
        const std::string& now = choices.navigation;
        ask({Asked::navigation, 0, false, {}, now == "EXAMINE" ? "WALK" : now == "WALK" ? "FLY" : "EXAMINE"});
    }
    void setWalls(bool on) { ask({Asked::walls, 0, on, {}, {}}); }
    void setGround(bool on) { ask({Asked::ground, 0, on, {}, {}}); }
    /// Pictures by another integrator from now on; if that cannot be, all stays as it was.
    void choosePictures(Integrator integrator) {
        if (integrator == options.picture.settings.integrator) return;
        LivePictureOptions next = options.picture;
        next.settings.integrator = integrator;
        constexpr int kSamples = 64, kSamplesByPath = 1 << 14;
        next.maxSamples = integrator == Integrator::path ? kSamplesByPath : kSamples;
        if (auto ok = startPictures(next); !ok)
            return report("no pictures by " + std::string(nameOf(integrator)) + ": " + ok.error().text);
        options.picture = std::move(next);
        stale = true;
    }
    Result<> startPictures(LivePictureOptions next) {
        next.settings.width = window->width(), next.settings.height = window->height();
        next.wake = [w = window.get()] { w->wake(); };
        auto begun = std::make_unique<LivePicture>(world, std::move(next));
        if (auto ok = begun->show(eye); !ok) return ok;
        picture = std::move(begun);
        return {};
    }
    std::string messageText() const {
        std::string all;
        for (const Diagnostic& message : messages) all += lineOf(message) + "\n";
        return all;
    }
    static std::string lineOf(const Diagnostic& message) {
        return message.severity == Severity::note && message.file.empty() ? message.text : message.format();
    }
    void takePictureDiagnostics() {
        const Clock::time_point now = Clock::now();
        if (now < diagnosedAt + kDiagnosticsEvery) return;
        diagnosedAt = now;
        diagnostics.append(picture->takeDiagnostics());
    }
    bool hasOverlay() const {
        return overlay || bar || listsKeys || listsFiles || showsMessages() || !pointed.description.empty();
    }
    bool showsMessages() const {
        if (messages.empty()) return false;
        return listsMessages || messages.back().severity != Severity::note || Clock::now() < saidAt + kNoteShown;
    }

    /// What is chosen by keys, as in the bar.
    void choose(int functionKey) {
        if (functionKey == 1) showOverlay(!overlay);
        if (functionKey == 2) bar = !bar;
        if (functionKey == 3) listsMessages = !listsMessages;
        if (functionKey == 6) chooseNext();
        if (functionKey == 7) setWalls(!choices.walls);
        if (functionKey == 8) setGround(!choices.ground);
        if (functionKey == 9) ask(Asked::viewAll);
        if (functionKey == 11) window->toggleFullscreen();
        stale = true;
    }
    static bool isOwnFunction(int functionKey) {
        return (functionKey >= 1 && functionKey <= 3) || (functionKey >= 6 && functionKey <= 9) || functionKey == 11;
    }

    /// False: there is none.
    bool closeLists() {
        const bool isAny = listsKeys || listsFiles || listsMessages;
        listsKeys = listsFiles = listsMessages = false;
        stale = stale || isAny;
        return isAny;
    }

    /// True: the key was for the window itself.
    bool isOwnKey(const WindowEvent& event) {
        const bool isSave = event.control && event.character == U's';
        const bool isPause = event.control && event.key == WindowEvent::Key::space;
        const bool isBack = event.control && event.key == WindowEvent::Key::left;
        const bool isAhead = event.control && event.key == WindowEvent::Key::right;
        const bool isLog = event.control && event.character == U'l', isFilm = event.control && event.character == U'f';
        const bool isClose = event.key == WindowEvent::Key::escape;
        const bool isOpen = event.control && event.character == U'o';
        const bool isReturn = event.control && event.key == WindowEvent::Key::backspace;
        const bool isFunction = isOwnFunction(event.functionKey);
        if (!isClose && !isFunction && !isSave && !isLog && !isFilm && !isPause && !isBack && !isAhead && !isOpen &&
            !isReturn)
            return false;
        if (event.down && (isBack || isAhead)) ask(SceneWindowRequest::Kind::skip, isBack ? -kSkip : kSkip);
        if (!event.down || event.repeats) return true;
        if (isClose) closed = !closeLists();
        if (isFunction) choose(event.functionKey);
        if (isOpen) listsFiles = !listsFiles, stale = true;
        if (isReturn) ask(Asked::back);
        if (isPause) togglePause();
        if (isLog) ask(SceneWindowRequest::Kind::log);
        if (isFilm) ask(SceneWindowRequest::Kind::film);
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
                stale = true;
                return;
            case Kind::seen:
                picture->setSeen(event.down);
                isSeen = event.down;
                lost = true;
                return;
            case Kind::dropped:
                dropped.push_back(event.text);
                return;
            case Kind::pointer:
            case Kind::left:
                // Only what changes is drawn: a tip goes along, and a press elsewhere closes a menu.
                lost = lost || overlay || !pointed.description.empty() || (bar && event.buttons != buttons);
                return point(event);
            case Kind::sticks:
                sticks = event;
                steered = Clock::now();
                return;
            case Kind::button:
                return padButton(event);
            case Kind::overlay:
                lost = true;
                forgetPointed();
                for (const OverlayAction& action : window->takeActions()) act(action);
                return;
            case Kind::wheel: {
                const double steps[] = {event.across, event.downwards};
                return send(Root::wheel.index, Value(Array<double>(std::span<const double>(steps))));
            }
            case Kind::key:
            case Kind::text:
                if (event.kind == Kind::key && isOwnKey(event)) return;
                // A sensor that has the keys has this one, too (21.2).
                if (event.kind == Kind::text && event.text == "?" &&
                    !world.scene().find(world.scene().node(world.scene().root()).get(Root::_keyFocus)))
                    listsKeys = !listsKeys, stale = true;
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

    /// The pointer has gone to the overlay.
    void forgetPointed() {
        over.reset();
        if (std::exchange(pointed, {}).reacts) window->setHand(false);
    }

    // ---- the overlay -------------------------------------------------------------------------------------------
    void showOverlay(bool on) {
        if (on && !makeOverlay())
            return report("there is no overlay: Dear ImGui was not there when this was built, or RTSG_OVERLAY was off");
        overlay = on;
        stale = lost = true;
    }
    /// False: it was not there when this was built.
    bool makeOverlay() {
        if (content) return true;
        content = std::make_shared<const OverlayContent>();
        if (window->setOverlay(content)) return true;
        return content.reset(), false;
    }
    void act(const OverlayAction& action) {
        using Done = OverlayAction::Kind;
        const NodeId node{action.node};
        stale = true;
        switch (action.kind) {
            case Done::viewpoint:
                return look(node);
            case Done::open:
                return maker.toggle(node);
            case Done::pick:
                maker.pick(node);
                return forgetHistory();
            case Done::hide:
                return hide(node);
            case Done::history:
                return ask({Asked::history, 0, false, node, action.name});
            case Done::pause:
                return togglePause();
            case Done::seek:
                return ask(Asked::seek, action.number);
            case Done::step:
                return ask(Asked::step, action.number);
            case Done::rate:
                return ask(Asked::rate, action.number);
            default:
                return actInBar(action);
        }
    }
    void actInBar(const OverlayAction& action) {
        using Done = OverlayAction::Kind;
        switch (action.kind) {
            case Done::navigation:
                return ask({Asked::navigation, 0, false, {}, action.name});
            case Done::walls:
                return setWalls(!choices.walls);
            case Done::ground:
                return setGround(!choices.ground);
            case Done::speed:
                return ask(Asked::speed, action.number);
            case Done::viewAll:
                return ask(Asked::viewAll);
            case Done::straighten:
                return ask(Asked::straighten);
            case Done::pictures:
                return choosePictures(integratorOf(action.name));
            case Done::volume:
                return ask(Asked::volume, action.number);
            case Done::screenshot:
                return takeScreenshot();
            case Done::log:
                return ask(Asked::log);
            case Done::film:
                return ask(Asked::film);
            case Done::back:
                return ask(Asked::back);
            case Done::file:
                listsFiles = false;
                return ask({Asked::open, 0, false, {}, folder.path(action.name)});
            case Done::folder:
                return folder.enter(action.name);
            default:
                return actInPanels(action.kind);
        }
    }
    void actInPanels(OverlayAction::Kind kind) {
        using Done = OverlayAction::Kind;
        if (kind == Done::files) listsFiles = !listsFiles;
        if (kind == Done::keys) listsKeys = !listsKeys;
        if (kind == Done::hideBar) bar = false;
        if (kind == Done::messages) listsMessages = !listsMessages;
        if (kind == Done::details) showOverlay(!overlay);
        if (kind == Done::copy) window->setClipboard(messageText());
        if (kind == Done::forget) messages.clear(), messageCount = 0, listsMessages = false;
    }
    void heard(const Result<>& done) {
        ++statistics.events;
        if (!done) report(done.error().text);
    }
    void look(NodeId viewpoint) {
        Scene& scene = world.scene();
        if (options.look) return heard(options.look(viewpoint));
        if (const Node* node = scene.find(viewpoint))
            heard(scene.sendEvent(viewpoint, node->type().findExact("set_bind"), Value(true)));
    }
    void hide(NodeId id) {
        Scene& scene = world.scene();
        const Node* node = scene.find(id);
        const FieldIndex field = node ? node->type().findExact("visible") : kNoField;
        if (field == kNoField) return;
        const Value now(!node->get(Field<bool>{field}));
        heard(options.change ? options.change(id, field, now) : scene.sendEvent(id, field, now));
    }

    /// Makes the overlay anew if it may have changed; equal content is not drawn again.
    void refreshOverlay() {
        const Clock::time_point now = Clock::now();
        const bool isWanted = hasOverlay();
        if (!isWanted && content) {
            content.reset();
            (void)window->setOverlay(nullptr);
            lost = true;
        }
        if (!isWanted || (!std::exchange(stale, false) && now < created + kOverlayEvery)) return;
        created = now;
        auto next = std::make_shared<OverlayContent>();
        addBar(*next);
        if (overlay) addDetails(*next);
        if (content && *content == *next) return;
        content = std::move(next);
        (void)window->setOverlay(content);
        lost = true;
    }
    void addBar(OverlayContent& to) {
        using Level = OverlayContent::Message::Level;
        if (bar)
            to.bar = OverlayContent::Bar{choices.navigation, nameOf(options.picture.settings.integrator),
                                         choices.walls,      choices.ground,
                                         choices.speed,      choices.volume,
                                         choices.canGoBack,  choices.writesLog,
                                         choices.writesFilm};
        if (bar || overlay) maker.fillViewpoints(to);
        for (const Diagnostic& message : showsMessages() ? messages : std::deque<Diagnostic>())
            to.messages.push_back({static_cast<Level>(message.severity), lineOf(message)});
        to.messageCount = messageCount;
        to.listsMessages = listsMessages;
        if (listsKeys) to.keys = keyList();
        if (listsFiles) to.files = folder.read();
        to.tip = pointed.description;
    }
    void addDetails(OverlayContent& to) {
        OverlayContent* const next = &to;
        next->hasDetails = true;
        maker.fill(*next);
        addFigures(*next);
        for (const SceneWindowStatus::Line& line : status.lines)
            next->lines.push_back({line.name, line.value, line.isWrong, line.time});
        for (const SceneWindowStatus::Line& line : status.history)
            next->history.push_back({line.name, line.value, line.isWrong, line.time});
        if (status.timeline)
            next->timeline =
                OverlayContent::Timeline{status.timeline->time, status.timeline->length, status.timeline->rate, marks};
        next->isPaused = paused;
        next->hasHistory = status.showsHistory;
    }
    void addFigures(OverlayContent& to) const {
        const auto add = [&](const char* name, std::string value) {
            to.lines.push_back({name, std::move(value), false, {}});
        };
        to.budget = static_cast<float>(1e3 * options.picture.budget);
        const std::size_t first = intervals.size() > kFrameTimes ? intervals.size() - kFrameTimes : 0;
        double sum = 0;
        for (std::size_t i = first; i < intervals.size(); ++i) {
            to.frameTimes.push_back(static_cast<float>(1e3 * intervals[i]));
            sum += intervals[i];
        }
        if (sum > 0)
            add("in motion", fmt::format("{:.0f} pictures/s", static_cast<double>(intervals.size() - first) / sum));
        if (shown) {
            add("resolution",
                fmt::format("{} x {}{}", shown->width, shown->height,
                            shown->whole ? ", whole" : fmt::format(" of {} x {}", window->width(), window->height())));
            add("samples", fmt::format("{} a pixel, {:.0f} ms", shown->samples, 1e3 * shown->seconds));
            if (shown->noise > 0) add("noise", fmt::format("{:.1f} % of the light", 100 * shown->noise));
            if (shown->denoised > 0) add("denoised", fmt::format("{:.0f} % of the pixels", 100 * shown->denoised));
            if (shown->kept > 0) add("kept", fmt::format("{:.0f} % of the pixels", 100 * shown->kept));
            add("drawn by", picture->renderer());
            const std::uint64_t newest = world.scene().sequence();
            add("state", newest == shown->sequence ? fmt::format("{}", newest)
                                                   : fmt::format("{}, shown {}", newest, shown->sequence));
        }
        add("triangles", fmt::format("{}", maker.triangles()));
        add("nodes", fmt::format("{}", world.scene().nodeCount()));
        if (paused) add("time", "stopped");
    }

    // ---- what people see ---------------------------------------------------------------------------------------
    /// The picture with a disc and a dark rim where the probe is.
    const std::uint8_t* withProbe() {
        marked = shown->pixels;
        const Vec2d point = shown->camera.project(*probe);
        if (!std::isfinite(point.x) || !std::isfinite(point.y)) return marked.data();
        const double radius = std::max(2.5, shown->height / 90.0), x = point.x * shown->width,
                     y = point.y * shown->height;
        const int left = std::max(0, static_cast<int>(x - radius - 1)),
                  right = std::min(shown->width - 1, static_cast<int>(x + radius + 1));
        for (int row = std::max(0, static_cast<int>(y - radius - 1)),
                 last = std::min(shown->height - 1, static_cast<int>(y + radius + 1));
             row <= last; ++row)
            for (int column = left; column <= right; ++column) {
                const double away = std::hypot(column + .5 - x, row + .5 - y);
                if (away > radius) continue;
                const bool isRim = away > .7 * radius;
                std::uint8_t* const pixel =
                    &marked[4 * (static_cast<std::size_t>(row) * static_cast<std::size_t>(shown->width) +
                                 static_cast<std::size_t>(column))];
                pixel[0] = isRim ? 0 : probeTouches ? 32 : 255, pixel[1] = isRim ? 0 : probeTouches ? 128 : 224;
                pixel[2] = isRim ? 0 : probeTouches ? 255 : 160;
            }
        return marked.data();
    }
    void present() {
        if (auto next = picture->take()) {
            shown = std::move(next);
            lost = true;
            const Clock::time_point now = Clock::now();
            const double interval = std::chrono::duration<double>(now - std::exchange(presentedAt, now)).count();
            const bool moves = shown->isMoving && std::exchange(wasMoving, shown->isMoving);
            wasMoving = shown->isMoving;
            if (interval < kLongestInterval && moves) {
                intervals.push_back(interval);
                if (intervals.size() > kIntervalsKept) intervals.pop_front();
            }
            ++statistics.presented;
        }
        if (!shown || !isSeen || !std::exchange(lost, false)) return;
        const std::uint8_t* pixels = shown->pixels.data();
        if (probe) pixels = withProbe();
        const Clock::time_point start = Clock::now();
        if (!window->present(pixels, shown->width, shown->height)) report("the display takes no pictures");
        constexpr double kNew = .2;  // in the mean
        showing += kNew * (std::chrono::duration<double>(Clock::now() - start).count() - showing);
        picture->setShowing(showing);
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
    if (auto ok = impl->startPictures(impl->options.picture); !ok) return std::unexpected(ok.error());
    impl->folder.setFolder(impl->options.folder);
    impl->bar = impl->stale = impl->options.bar && impl->makeOverlay();
    if (impl->options.overlay) impl->showOverlay(true);
    return std::unique_ptr<SceneWindow>(new SceneWindow(std::move(impl)));
}

bool SceneWindow::poll(std::chrono::milliseconds atMost) {
    Impl& s = *impl_;
    if (auto ok = s.picture->show(s.eye); !ok) {
        s.failure = ok.error().text;
        return false;
    }
    const std::uint64_t before = s.statistics.events;
    s.steer();
    s.takePictureDiagnostics();
    s.followPointer();
    if (s.isSteered()) atMost = std::min(atMost, kStickEvery);
    if (s.over && s.buttons == 0) atMost = std::min(atMost, kPointEvery);
    const Clock::time_point end = Clock::now() + atMost;
    s.refreshOverlay();
    s.present();
    while (!s.closed) {
        const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - Clock::now()).count();
        const WindowEvent event = s.window->next(static_cast<int>(std::max<std::int64_t>(0, left)));
        if (event.kind == Kind::none) break;
        s.handle(event);
        s.refreshOverlay();
        s.present();
        const bool isSteered = event.kind == Kind::sticks;
        if (s.statistics.events == before && s.dropped.empty() && s.requests.empty() && !isSteered && !s.called)
            continue;
        // Read all waiting events before the scene's turn.
        for (WindowEvent more = s.window->next(0); more.kind != Kind::none && !s.closed; more = s.window->next(0))
            s.handle(more);
        break;
    }
    s.called = false;
    return !s.closed;
}

std::string SceneWindow::failure() const {
    return impl_->failure;
}
bool SceneWindow::isPaused() const {
    return impl_->paused;
}
void SceneWindow::setPaused(bool on) {
    impl_->stale = impl_->stale || impl_->paused != on;
    impl_->paused = on;
}
std::vector<SceneWindowRequest> SceneWindow::takeRequests() {
    return std::exchange(impl_->requests, {});
}
void SceneWindow::wake() {
    if (!impl_->called.exchange(true)) impl_->window->wake();
}
void SceneWindow::showProbe(const std::optional<Vec3d>& position, bool touches) {
    Impl& s = *impl_;
    s.lost = s.lost || position != s.probe || touches != s.probeTouches;
    s.probe = position;
    s.probeTouches = touches;
}
void SceneWindow::setChoices(SceneWindowChoices choices) {
    Impl& s = *impl_;
    s.stale = s.stale || choices != s.choices;
    s.choices = std::move(choices);
}
bool SceneWindow::showsBar() const {
    return impl_->bar;
}
Integrator SceneWindow::integrator() const {
    return impl_->options.picture.settings.integrator;
}
void SceneWindow::showMessage(const Diagnostic& message) {
    Impl& s = *impl_;
    s.messages.push_back(message);
    ++s.messageCount;
    s.saidAt = Clock::now();
    if (s.messages.size() > kMaxMessages) s.messages.pop_front();
    s.stale = true;
}
std::vector<Diagnostic> SceneWindow::messages() const {
    return {impl_->messages.begin(), impl_->messages.end()};
}
bool SceneWindow::showsOverlay() const {
    return impl_->overlay;
}
std::shared_ptr<const LivePictureShown> SceneWindow::shown() const {
    return impl_->shown;
}
std::pair<int, int> SceneWindow::size() const {
    return {impl_->window->width(), impl_->window->height()};
}
void SceneWindow::setStatus(SceneWindowStatus status) {
    Impl& s = *impl_;
    if (status.timeline &&
        (!s.marks || !s.status.timeline || s.status.timeline->marksVersion != status.timeline->marksVersion)) {
        auto marks = std::make_shared<std::vector<OverlayContent::Mark>>();
        for (const SceneWindowMark& mark : status.timeline->marks)
            marks->push_back({mark.time, mark.text, mark.isDamage});
        s.marks = std::move(marks);
    }
    s.status = std::move(status);
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
