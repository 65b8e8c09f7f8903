// The one loop in which scene files run.
#include <rtsg/session/running_scene.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <thread>

#include <fmt/format.h>

#include <rtsg/audio/sound_file.h>
#include <rtsg/core/web_address.h>
#include <rtsg/renderers/text_measure.h>
#include <rtsg/renderers/world_queries.h>
#include <rtsg/scripts/run_scripts.h>
#include <rtsg/session/load_scene.h>
#include <rtsg/session/moments.h>
#include <rtsg/sync/scene_file.h>

#include "run/followed_file.h"
#include "run/injections.h"

namespace rtsg {

std::uint64_t Pace::frames() const {
    return static_cast<std::uint64_t>(std::ceil(seconds * framesPerSecond - 1e-9)) + 1;
}

double Pace::timeOf(std::uint64_t frame) const {
    return std::min(seconds, static_cast<double>(frame) / framesPerSecond);
}

RunningScene::RunningScene(std::string file, Resources resources, SceneStart start, SessionContext context)
    : file_(std::move(file)),
      resources_(std::move(resources)),
      context_(context),
      clip_(std::move(start.clip)),
      start_(start.time),
      startWasGiven_(start.isGiven),
      inlineDiagnostics_(file_),
      world_(scene_, resources_, context_) {
    reportFailuresAtTheEnd(scene_);
}

RunningScene::~RunningScene() {
    const std::size_t reported = scene_.diagnostics().all().size();
    ScriptOptions none;
    none.enabled = false;
    scene_.setScriptOptions(none);
    const auto& all = scene_.diagnostics().all();
    Diagnostics last;
    for (std::size_t i = reported; i < all.size(); ++i) last.add(all[i]);
    context_.report(last);
}

Result<> RunningScene::followEdits() {
    if (file_ == "-") return fail(kUsageCode, "--reload: standard input is read once");
    if (isWebAddress(file_)) return fail(kUsageCode, "--reload: edits of a file on the network cannot be noticed");
    if (isSceneFile(file_))
        return fail(kUsageCode, "--reload: documents can be followed, and " + file_ + " is a state");
    followsEdits_ = true;
    return {};
}

bool RunningScene::isEdited() {
    return followed_ && followed_->isEdited();
}

bool RunningScene::load() {
    setClock(scene_, start_);
    Diagnostics diagnostics(file_);
    const auto before = followsEdits_ ? FollowedFile::lookAt(file_) : std::nullopt;
    const bool isUsable = loadScene(scene_, file_, diagnostics, resources_, context_, clip_);
    errors_ = diagnostics.errors();
    if (!isUsable) return false;
    if (followsEdits_) followed_ = std::make_unique<FollowedFile>(scene_, file_, before, resources_, clip_, context_);
    // A scene file or a log begins with a state at its own time, from which the scene cannot go back.
    if (startWasGiven_ && scene_.now() > start_) {
        context_.report(
            {Severity::error,
             {},
             {},
             fmt::format("{}: --at: it begins with a state of a later time, {}", file_, dateText(scene_.now()))});
        return false;
    }
    start_ = std::max(start_, scene_.now());
    followInlines();
    return true;
}

Result<ResumedSession> RunningScene::resume(const std::string& log) {
    ResumeOptions options;
    options.progress = context_.progress("reading " + log);
    runScripts(scene_);
    context_.extensions().registerWith(scene_);
    auto session = resumeSession(log, scene_, options);
    if (!session) return session;
    if (WebFetcher* fetcher = webFetcher(resources_)) keepFetchedFiles(scene_, *fetcher);
    scene_.setScriptResources(std::make_shared<const Resources>(resources_));
    start_ = session->start;
    time_ = session->end - session->start;
    followInlines();
    return session;
}

void RunningScene::followInlines() {
    BuildOptions build;
    build.resources = resources_;
    if (file_ != "-") build.file = file_;
    build.mediaLength = [maximum = resources_.policy().maximumSamples](const Resource& file) {
        return mediaSeconds(file, maximum);
    };
    if (WebFetcher* fetcher = webFetcher(resources_)) {
        fetched_ = std::make_unique<FetchedFiles>(*fetcher, embedsFetched_);
        fetched_->publish(scene_);
    }
    inlines_ = std::make_unique<InlineLoader>(scene_, inlineDiagnostics_, build);
    inlines_->measureTexts(measureText, InlineLoader::Texts::heard);
    // Whoever joins finds what the scene names at its beginning.
    constexpr auto kLook = std::chrono::milliseconds(10);
    const WebFetcher* const fetcher = webFetcher(resources_);
    while (fetcher && fetcher->settings().inBackground && inlines_->fetchAhead() && !context_.interrupted())
        std::this_thread::sleep_for(kLook);
    if (fetched_) fetched_->publish(scene_);
    queries_ = std::make_unique<WorldQueries>([this]() -> SharedWorld& { return world().get(); }, resources_);
    scene_.setSpaceQueries(queries_.get());
    scene_.setNavigation(true);
    physics_ = std::make_unique<RigidBodyPhysics>(scene_);
    network_ = std::make_unique<DisNetwork>(scene_, DisOptions{.allowed = allowedAddresses_});
    subscribers_ = attachSubscribers(scene_, context_);
}

void RunningScene::measureAllTexts() {
    inlines_->measureTexts(measureText);
}

Result<> RunningScene::inject(const std::vector<std::string>& events, double end) {
    auto parsed = Injections::parse(scene_, events);
    if (!parsed) return std::unexpected(parsed.error());
    if (auto ok = parsed->checkWithin(end); !ok) return ok;
    injections_ = std::make_unique<Injections>(std::move(*parsed));
    return {};
}

/// Networks must be polled for what arrives.
double RunningScene::restsUntil() const {
    if (network_->counts().addresses > 0 || inlines_->awaits()) return -std::numeric_limits<double>::infinity();
    return scene_.restsUntil() - start_;
}

std::shared_ptr<const ChangeSet> RunningScene::frame(double t) {
    time_ = t;
    if (isEdited()) followed_->follow();
    if (before_) before_(t);
    if (injections_) injections_->sendUntil(t, start_, context_);
    network_->receive(start_ + t);
    auto set = scene_.newFrame(start_ + t);
    const std::size_t loaded = inlines_->update(), fetched = fetched_ ? fetched_->publish(scene_) : 0;
    if (loaded + fetched > 0) scene_.seal();  // so that a picture of this frame shows them
    network_->send();
    return set;
}

void RunningScene::runTo(double seconds) {
    const Pace pace{seconds};
    const Progress progress = context_.progress("running " + file_);
    const std::uint64_t frames = pace.frames();
    for (std::uint64_t k = 0; k < frames; ++k) {
        if (const double t = pace.timeOf(k); t >= time_) frame(t);
        if (progress) progress(k + 1, frames);
    }
}

std::uint64_t RunningScene::run(const Pace& pace, const std::string& label,
                                const std::function<bool(std::uint64_t, const ChangeSet&)>& after) {
    const std::uint64_t frames = pace.frames();
    auto start = std::chrono::steady_clock::now();
    const Progress progress = context_.progress(label);
    std::uint64_t done = 0;
    for (bool goOn = true; goOn && done < frames; ++done) {
        const double t = pace.timeOf(done);
        if (pace.realtime) std::this_thread::sleep_until(start + std::chrono::duration<double>(t));
        goOn = after(done, *frame(t));
        if (done == 0)
            start = std::chrono::steady_clock::now();  // attaching outputs to the first frame does not count as time
        if (progress) progress(done + 1, frames);
    }
    if (progress) progress(1, 1);
    return done;
}

namespace {

/// Those that have not been reported, which are counted as reported from now on.
Diagnostics newOf(const Diagnostics& all, std::size_t& reported) {
    if (reported == 0) return reported = all.all().size(), all;
    Diagnostics news(all.file());
    for (; reported < all.all().size(); ++reported) news.add(all.all()[reported]);
    return news;
}

}  // namespace

void RunningScene::reportNews() {
    if (inlineDiagnostics_.all().size() > reportedOfInlines_)
        context_.report(newOf(inlineDiagnostics_, reportedOfInlines_));
    if (scene_.diagnostics().all().size() > reportedOfScene_)
        context_.report(newOf(scene_.diagnostics(), reportedOfScene_));
}

void RunningScene::reportDiagnostics(std::string_view known) {
    context_.report(newOf(inlineDiagnostics_, reportedOfInlines_));
    context_.damaged(file_, errors_ + inlineDiagnostics_.errors());
    if (followed_ && followed_->isBehind()) context_.leftOut();
    context_.report(newOf(scene_.diagnostics(), reportedOfScene_), known);
}

}  // namespace rtsg
