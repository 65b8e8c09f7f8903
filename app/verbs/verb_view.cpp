// rtsg view: opens a window onto a scene, to look, walk, point, click and hear.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include <rtsg/audio/live_sound.h>
#include <rtsg/core/terminal.h>
#include <rtsg/core/x3d.h>
#include <rtsg/haptics/haptic_renderer.h>
#include <rtsg/session/output_maker.h>
#include <rtsg/session/view_recorder.h>
#include <rtsg/session/view_source.h>
#include <rtsg/window/scene_window.h>

#include "cli.h"
#include "extensions.h"
#include "hand.h"
#include "output_arguments.h"
#include "say.h"
#include "start_time.h"

namespace rtsg::app {

namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr double kFramesPerSecond = 60;
constexpr milliseconds kLongestWait{500};  // Ctrl-C is noticed then, and a file that was edited sooner
constexpr double kStatusEvery = 0.1;       // seconds

using Kind = ViewSourceOptions::Kind;

/// By what the name says.
Kind kindOf(const std::string& name) {
    const bool isEndpoint = name.contains("://") && !name.starts_with("file:") && !isWebAddress(name);
    return isEndpoint ? Kind::served : isLogOrNamedSo(name) ? Kind::log : Kind::scene;
}

struct ViewSourceArguments {
    std::string name, key, author, patience;  // empty: the window stays when the server is gone
    std::vector<std::string> set;
    bool reload = false;
    ResourceArguments resources;
    StartTime start;
    NetworkArguments network;

    /// Throws UsageError.
    ViewSourceOptions options(const SessionContext& context) const {
        ViewSourceOptions options;
        options.kind = kindOf(name);
        options.name = name, options.key = key, options.author = author;
        options.endsWithServer = !patience.empty();
        if (options.kind == Kind::served && options.endsWithServer) options.patience = parseSeconds(patience);
        options.set = set, options.reload = reload;
        ResourceArguments opened = resources;
        opened.inBackground = options.kind == Kind::scene;  // a window does not stand still while something comes
        options.resources = options.kind == Kind::scene ? opened.ofFile(name) : opened.ofReplica();
        if (options.kind == Kind::scene) options.start = start.options();
        options.addresses = network.dis;
        options.context = context;
        return options;
    }
};

/// What a session says goes to the terminal, and into the window.
class WindowNotices final : public Notices {
  public:
    void report(const Diagnostic& diagnostic) override {
        terminal_.report(diagnostic);
        keep(diagnostic);
    }
    void report(const Diagnostics& diagnostics, std::string_view known) override {
        terminal_.report(diagnostics, known);
        for (const Diagnostic& one : diagnostics.all())
            if (one.text != known) keep(one);
    }
    void note(std::string_view text) override {
        terminal_.note(text);
        keep({Severity::note, {}, {}, std::string(text)});
    }
    std::function<void(std::uint64_t, std::uint64_t)> progress(const std::string& work) override {
        return terminal_.progress(work);
    }
    bool interrupted() const override { return terminal_.interrupted(); }
    void leftOut() override { terminal_.leftOut(); }
    void damaged(const std::string& file, std::size_t errors) override { terminal_.damaged(file, errors); }

    /// What has been said since the last call.
    std::vector<Diagnostic> take() {
        const std::scoped_lock lock(mutex_);
        return std::exchange(said_, {});
    }

  private:
    void keep(const Diagnostic& diagnostic) {
        const std::scoped_lock lock(mutex_);
        if (said_.size() < kMaxSaid) said_.push_back(diagnostic);
    }
    static constexpr std::size_t kMaxSaid = 500;

    const SessionContext& terminal_ = programContext();
    std::mutex mutex_;
    std::vector<Diagnostic> said_;
};

struct ViewArguments {
    ViewSourceArguments source;
    PictureArguments picture;
    std::string duration, screenshot, device, touch, renderer = "light";
    double fps = 30;
    bool fullscreen = false, mute = false, overlay = false, noBar = false, force = false, json = false;
};

/// Throws UsageError.
RenderSettings pictureSettings(const ViewArguments& options) {
    PictureArguments pictures = options.picture;
    if (pictures.integrator == "hybrid")
        throw UsageError("--integrator", "hybrid is for rtsg render; here there are: whitted, path, raster");
    if (options.renderer == "ogre") {
        if (pictures.integrator == "path") throw UsageError("--integrator", "path is for --renderer light");
        pictures.integrator = "raster";
    }
    return pictures.parse(true).settings;
}

double percentile(std::vector<double> values, double fraction) {
    if (values.empty()) return 0;
    const auto at = static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size() - 1));
    std::ranges::nth_element(values, values.begin() + at);
    return values[static_cast<std::size_t>(at)];
}

class Viewing {
  public:
    explicit Viewing(const ViewArguments& options)
        : options_(options),
          settings_(pictureSettings(options)),
          duration_(options.duration.empty() ? 1e18 : parseSeconds(options.duration)),
          shown_(options.source) {}

    int run() {
        if (!options_.screenshot.empty() && !options_.force && std::filesystem::exists(options_.screenshot))
            return printError(fmt::format("{}: there is a file already; --force replaces it", options_.screenshot)),
                   kBad;
        auto source = refusingUsage(openViewSource(shown_.options(context_)));
        if (!source) return printError(source.error()), kBad;
        source_ = std::move(*source);
        for (;;) {
            if (auto ok = open(); !ok) return printError(ok.error()), kBad;
            lookFirst();
            listen();
            if (auto ok = touch(); !ok) return printError(ok.error()), kBad;
            loop();
            if (!next_) return finish();
            close();
            (void)source_->finish();
            source_ = std::move(next_);
        }
    }

  private:
    Result<> open() {
        SceneWindowOptions options;
        options.title = fmt::format("{} - rtsg", shown_.name);
        options.fullscreen = options_.fullscreen;
        options.picture.settings = settings_;
        options.picture.toneMap = options_.picture.toneMap();
        options.picture.budget = 1 / options_.fps;
        options.picture.resources = source_->resources();
        options.picture.prepare = [](Renderer& renderer) { return extensions().registerWith(renderer); };
        if (options.picture.settings.integrator == Integrator::path) options.picture.maxSamples = 1 << 14;
        options.overlay = overlay_, options.bar = bar_;
        if (kindOf(shown_.name) != Kind::served && !isWebAddress(shown_.name))
            options.folder = std::filesystem::path(shown_.name).parent_path().string();
        options.look = [this](NodeId viewpoint) { return source_->look(viewpoint); };
        options.change = [this](NodeId node, FieldIndex field, Value value) {
            return source_->change(node, field, std::move(value));
        };
        options.send = [this](FieldIndex field, Value value) { return source_->send(field, std::move(value)); };
        auto window = SceneWindow::open(source_->world(), std::move(options));
        if (!window) return std::unexpected(window.error());
        window_ = std::move(*window);
        source_->wakeBy([w = window_.get()] { w->wake(); });
        return {};
    }
    /// Ends the files that were written of this scene. A file that was dropped while the next scene was read comes
    /// after it.
    void close() {
        (void)window_->poll(std::chrono::milliseconds(0));
        if (const std::vector<std::string> dropped = window_->takeDropped(); !dropped.empty())
            wanted_ = named(dropped.back());
        if (auto ok = recorder_.finish(); !ok) printError(ok.error());
        sound_.reset();
        touch_.reset();
        source_->wakeBy({});
        overlay_ = window_->showsOverlay(), bar_ = window_->showsBar();
        settings_.integrator = window_->integrator();
        window_.reset();
    }
    /// The viewpoint that an Anchor names in the file that it leads to.
    void lookFirst() {
        const std::string name = std::exchange(firstView_, {});
        if (name.empty()) return;
        const NodeId view = source_->scene().findName(name);
        const Result<> done =
            view ? source_->look(view) : Result<>(fail("there is no viewpoint " + name, {}, shown_.name));
        if (!done) context_.report(done.error());
    }

    /// Without a device there are pictures all the same.
    void listen() {
        if (options_.mute || !hasSound()) return;
        LiveOptions live;
        live.render = SoundArguments().parse().render;
        live.render.resources = source_->resources();
        live.device = options_.device;
        auto sound = LiveSound::start(source_->world(), live);
        if (!sound) return context_.note("note: no sound: " + sound.error().text);
        sound_ = std::move(*sound);
        sound_->setVolume(volume_);
    }
    /// Lets the hand that --touch names feel the shown scene.
    Result<> touch() {
        if (options_.touch.empty()) return {};
        if (kindOf(shown_.name) != Kind::scene) return fail("--touch is for a scene's file", {}, shown_.name);
        auto hand = openHand("--touch", options_.touch);
        if (!hand) return std::unexpected(hand.error());
        touch_ = std::make_unique<HapticRenderer>(source_->world());
        return allOf(programContext(),
                     {[&] { return touch_->attachToScene(source_->scene()); }, [&] { return touch_->renderFrame(); },
                      [&] { return touch_->start(std::move(hand->device)); }});
    }
    /// Sends what the hand touches, and shows it.
    void feel() {
        touch_->sendEvents();
        const HapticTick tick = touch_->latest();
        window_->showProbe(tick.known ? std::optional(tick.proxy) : std::nullopt, tick.touching);
    }
    bool hasSound() {
        bool found = false;
        source_->scene().forEachNode([&](const Node& node) {
            found = found || node.type().isA("X3DSoundNode") || node.type().isA("X3DSoundDestinationNode");
        });
        return found;
    }

    void loop() {
        const double begun = clock();
        double due = 0;
        std::uint64_t events = 0;
        time_ = reported_ = 0;
        for (;;) {
            const double t = clock() - begun;
            if (interrupted() || clock() >= duration_) return;
            answer();
            if (opensNext()) return;
            const bool acts = std::exchange(events, window_->statistics().events) != window_->statistics().events;
            time_ = t;
            if (!source_->advance(t, acts || std::exchange(hasAsked_, false))) return;
            ++frames_;
            if (sound_ && source_->takesEvents()) sound_->sendEvents();
            if (touch_) feel();
            say();
            const auto [width, height] = window_->size();
            window_->lookFrom(source_->eye(static_cast<double>(width) / height));
            choose();
            report();
            // The next frame is due a sixtieth after the last one, or when something happens.
            due = std::max(due + 1 / kFramesPerSecond, t);
            const double rests = touch_ ? due : std::max(source_->restsUntil(), due);
            const double wait = std::min(rests - t, duration_ - clock());
            const auto maximum =
                std::chrono::ceil<milliseconds>(std::chrono::duration<double>(std::clamp(wait, 0., 1.)));
            if (!window_->poll(std::min(maximum, shown_.reload ? RunningScene::kLookEvery : kLongestWait))) return;
            recorder_.show(*window_, clock());
        }
    }

    /// Answers the requests of the user.
    void answer() {
        using Asked = SceneWindowRequest::Kind;
        for (const SceneWindowRequest& request : window_->takeRequests()) {
            Result<> done;
            switch (request.kind) {
                case Asked::log:
                    recorder_.toggleLog(source_->scene());
                    break;
                case Asked::film:
                    recorder_.toggleFilm(*window_, clock());
                    break;
                case Asked::pause:
                    done = source_->pause(request.on);
                    if (!done) window_->setPaused(false);
                    break;
                case Asked::step:
                    done = source_->answer(request);
                    if (done) window_->setPaused(true);
                    break;
                case Asked::open:
                    wanted_ = named(request.field);
                    break;
                case Asked::back:
                    goBack();
                    break;
                case Asked::anchor:
                    follow(request.node);
                    break;
                case Asked::volume:
                    volume_ = request.number;
                    if (sound_) sound_->setVolume(volume_);
                    break;
                default:
                    done = source_->answer(request);
                    hasAsked_ = true;
            }
            if (!done) context_.note("note: " + done.error().text);
        }
    }

    /// What the bar shows.
    void choose() {
        SceneWindowChoices choices;
        source_->describe(choices);
        if (sound_) choices.volume = volume_;
        choices.canGoBack = !history_.empty();
        choices.writesLog = recorder_.writesLog(), choices.writesFilm = recorder_.writesFilm();
        window_->setChoices(std::move(choices));
    }

    // ---- other scenes --------------------------------------------------------------------------------------------
    /// The same options with another scene.
    ViewSourceArguments named(const std::string& name) const {
        ViewSourceArguments next = shown_;
        next.name = name;
        next.set.clear();
        next.reload = options_.source.reload && kindOf(name) == Kind::scene;
        return next;
    }
    void goBack() {
        if (history_.empty()) return context_.note("note: there was no scene before");
        wanted_ = history_.back();
        returns_ = true;
    }
    /// 9.4.1: the first of an Anchor's urls that leads somewhere.
    void follow(NodeId id) {
        using A = x3d::Anchor;
        const Scene& scene = source_->scene();
        const Node* anchor = scene.find(id);
        if (!anchor || !anchor->is(A::type)) return;
        const Array<String> urls = anchor->get(A::url);
        for (const String& url : urls) {
            if (url.view().starts_with('#')) return lookFrom(*anchor, url.str().substr(1));
            auto opened = source_->resources().open(scene, *anchor, A::url.index, url.view());
            if (!opened) {
                context_.report({Severity::warning, {}, {}, "the Anchor leads nowhere: " + opened.error().text});
                continue;
            }
            if (opened->path().empty()) continue;
            wanted_ = named(opened->path().string());
            firstView_ = opened->fragment();
            return;
        }
    }
    /// A viewpoint of this scene; one that runs here has bound it already.
    void lookFrom(const Node& anchor, const std::string& name) {
        if (kindOf(shown_.name) == Kind::scene) return;
        const NodeId view = source_->scene().findName(name, anchor.scope());
        const Result<> done = view ? source_->look(view) : Result<>(fail("there is no viewpoint " + name));
        if (!done) context_.note("note: " + done.error().text);
    }

    /// The title, and the overlay's figures.
    void report() {
        std::string status = source_->status();
        if (const std::string writes = recorder_.status(); !writes.empty())
            status += (status.empty() ? "" : ", ") + writes;
        // Nobody would find it else.
        knowsOverlay_ = knowsOverlay_ || window_->showsOverlay();
        if (!knowsOverlay_) status += status.empty() ? "F1 shows more" : ", F1 shows more";
        if (status != status_)
            window_->setTitle(fmt::format("{} - {}{}rtsg", shown_.name, status, status.empty() ? "" : " - "));
        status_ = status;
        if (!window_->showsOverlay() || (reported_ > 0 && time_ - reported_ < kStatusEvery)) return;
        reported_ = time_;
        SceneWindowStatus all;
        source_->describe(all);
        if (sound_) reportSound(all);
        if (const std::string writes = recorder_.status(); !writes.empty())
            all.lines.push_back({"writing", writes, false, {}});
        window_->setStatus(std::move(all));
    }
    void reportSound(SceneWindowStatus& all) const {
        constexpr double kSilent = 1e-5;
        const LiveReport heard = sound_->report();
        const std::string level =
            heard.level > kSilent ? fmt::format("{:.0f} dB", 20 * std::log10(heard.level)) : "silent";
        const bool fails = !heard.failure.empty();
        all.lines.push_back({"sound",
                             fails ? heard.failure : fmt::format("{}, {} underruns", level, heard.underruns),
                             fails || heard.underruns > 0,
                             {}});
    }

    double clock() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

    /// Opens what was dropped on the window, chosen or linked. If that fails, the window goes on with the present
    /// scene.
    bool opensNext() {
        if (const std::vector<std::string> dropped = window_->takeDropped(); !dropped.empty())
            wanted_ = named(dropped.back());
        if (!wanted_) return false;
        const ViewSourceArguments next = *std::exchange(wanted_, std::nullopt);
        const bool returns = std::exchange(returns_, false);
        ViewSourceOptions options = next.options(context_);
        // Who asks for it again wants to see what can be read of it.
        options.onlyWhole = !returns && refused_ != next.name;
        auto source = openViewSource(options);
        if (!source) {
            refused_ = next.name;
            firstView_.clear();
            context_.report(source.error());
            context_.note(
                fmt::format("note: {} goes on; open {} again to see what can be read of it", shown_.name, next.name));
            return false;
        }
        refused_.clear();
        returns ? history_.pop_back() : history_.push_back(shown_);
        next_ = std::move(*source);
        shown_ = next;
        return true;
    }

    void say() {
        context_.report(window_->takeDiagnostics());
        for (const Diagnostic& one : notices_.take()) window_->showMessage(one);
    }

    int finish() {
        Result<> result = window_->failure().empty() ? Result<>() : Result<>(fail(window_->failure()));
        if (result && !options_.screenshot.empty()) result = window_->writePicture(options_.screenshot);
        const SceneWindowStatistics statistics = window_->statistics();
        const LiveReport heard = sound_ ? sound_->stop() : LiveReport();
        say();
        const std::uint64_t state = source_->scene().sequence();
        const std::string hash = source_->scene().hash().hex();
        Result<> written = recorder_.finish();
        const HapticReport felt = touch_ ? touch_->stop() : HapticReport();
        touch_.reset();
        sound_.reset();
        source_->wakeBy({});
        window_.reset();
        result = allOf(programContext(),
                       {[&] { return result; }, [&] { return written; }, [&] { return source_->finish(); }});
        if (!result) printError(result.error());
        const double p50 = percentile(statistics.intervals, .5), p95 = percentile(statistics.intervals, .95);
        if (options_.json)
            fmt::print(
                "{{\"t\":{:.3f},\"frames\":{},\"pictures\":{},\"whole\":{},\"samples\":{},\"events\":{},"
                "\"interval_ms\":{{\"p50\":{:.1f},\"p95\":{:.1f}}},\"sequence\":{},\"hash\":\"{}\",\"sound_s\":{:.3f},"
                "\"underruns\":{},\"ticks\":{},\"contacts\":{}}}\n",
                time_, frames_, statistics.presented, statistics.whole, statistics.samples, statistics.events,
                1e3 * p50, 1e3 * p95, state, hash, heard.seconds, heard.underruns, felt.ticks, felt.contacts);
        else
            fmt::print("{:.1f} s, {} pictures, {:.0f} ms from one to the next while something moves (95 %: {:.0f})\n",
                       time_, statistics.presented, 1e3 * p50, 1e3 * p95);
        return result ? kDone : kBad;
    }

    const ViewArguments& options_;
    WindowNotices notices_;
    const SessionContext context_{&notices_, programContext().plugins};
    RenderSettings settings_;
    const double duration_;
    const Clock::time_point start_ = Clock::now();
    ViewSourceArguments shown_;
    std::unique_ptr<ViewSource> source_, next_;
    std::unique_ptr<SceneWindow> window_;
    std::unique_ptr<LiveSound> sound_;
    std::unique_ptr<HapticRenderer> touch_;
    ViewRecorder recorder_{context_};
    bool overlay_ = options_.overlay, bar_ = !options_.noBar, knowsOverlay_ = false, hasAsked_ = false;
    double volume_ = 1;
    std::vector<ViewSourceArguments> history_;  // what was shown before
    std::optional<ViewSourceArguments> wanted_;
    bool returns_ = false;  // to what was shown before
    std::string firstView_, refused_;
    std::string status_;
    double time_ = 0, reported_ = 0;
    std::uint64_t frames_ = 0;
};

}  // namespace

Verb addView(Command& program) {
    auto options = std::make_shared<ViewArguments>();
    Command* command = program.addVerb("view", "Look at a scene in a window: walk, point, click, hear");
    command
        ->addOption("SCENE", options->source.name,
                    "scene file, or -; ENDPOINT that rtsg serve named, or nats://HOST:PORT/NAME; or a log")
        ->required();
    command->addOption("--for", options->duration, "close the window after this time; without it, Escape does");
    command->addOption("--screenshot", options->screenshot, "write a picture of the last state at the end");
    command->addOption("--set", options->source.set,
                       "inject an event: DEF.field=VALUE@TIME, VALUE as in ClassicVRML; or pointer=, key=, text=, "
                       "wheel=, head=");
    command
        ->addOption("--renderer", options->renderer,
                    "light: by rays; ogre: by a graphics card, without shadows and mirrors; needs a display")
        ->preset()
        ->oneOf({"light", "ogre"});
    command
        ->addOption("--fps", options->fps,
                    "pictures a second while something moves; their pixels are as many as this rate allows")
        ->preset()
        ->range(1, 240);
    command->addOption("--name", options->source.author,
                       "for an endpoint: author of pointer and key events at the origin");
    command->addOption("--key", options->source.key, "for an endpoint: file with the keys of this peer");
    command->addOption("--wait", options->source.patience,
                       "for an endpoint: end when the server has left, or been silent for this long; without it the "
                       "window stays, and looks for the server");
    command->addFlag("--fullscreen", options->fullscreen, "full screen; F11 switches it");
    command->addFlag("--no-bar", options->noBar, "no bar at the top at first; F2 shows it");
    command->addFlag("--overlay", options->overlay, "show statistics, nodes and a log's time line; F1 switches it");
    command->addFlag("--reload,--watch", options->source.reload, "follow the scene's file whenever it has been edited");
    command->addOption("--touch", options->touch, "a hand that feels the scene: sim:FILE.csv, udp:PORT or spnav");
    command->addFlag("--mute", options->mute, "no sound");
    command->addOption("--device", options->device, "sound device; default: the default one");
    options->picture.addTo(*command);
    options->source.start.addTo(*command);
    options->source.resources.addTo(*command);
    options->source.network.addTo(*command);
    command->addFlag("--force", options->force, "replace a file that is there");
    command->addFlag("--json", options->json, "the summary as JSON");
    command->footer(
        "Example: rtsg view hall.x3dv\n"
        "Example: rtsg view hall.x3dv --for 2s --screenshot hall.png --size 640x360\n"
        "Example: rtsg view tcp://127.0.0.1:5570 --name Ann\n"
        "Example: rtsg view hall.rlog\n"
        "Arrow keys and the dragged pointer walk or go round, as the scene's NavigationInfo says; PGUP and PGDN go "
        "from "
        "viewpoint to viewpoint. The bar at the top has what one needs first, and ? lists the keys. Escape closes, F1 "
        "shows figures and nodes, F11 fills the screen, Ctrl+S writes a "
        "picture, Ctrl+L a log, Ctrl+F a film, Ctrl+Space pauses; in a log Ctrl+LEFT and Ctrl+RIGHT go 5 s back and "
        "ahead. In a served scene and in a log the viewer is your own, "
        "and "
        "HOME goes back to the scene's.");
    return {command, [options] { return Viewing(*options).run(); }};
}

}  // namespace rtsg::app
