// Runs two threads that each take the newest state of a world when they are ready.
#include "outputs/live_outputs.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include <fmt/format.h>

#include <rtsg/renderers/denoise.h>

namespace rtsg {

namespace {

using std::chrono::milliseconds;

constexpr milliseconds kNoNews{1000};  // between looks at a world whose scene rests

}  // namespace

LiveOutputs::LiveOutputs(WorldOnDemand& world, const OutputOptions& arguments)
    : WorldOutputs(world, arguments),
      world_(world.get()),
      preview_(1 / arguments_.toneMap.exposure),
      soundAt_(scene_.now()),
      time_(scene_.now()),
      starts_{scene_.now()},
      stateNow_(scene_.sequence()),
      firstState_(stateNow_) {}

Result<std::unique_ptr<LiveOutputs>> LiveOutputs::attach(WorldOnDemand& world, const OutputOptions& arguments,
                                                         const Resources& resources) {
    if (auto ok = check(world, arguments, resources); !ok) return std::unexpected(ok.error());
    std::unique_ptr<LiveOutputs> outputs(new LiveOutputs(world, arguments));
    if (auto ok = outputs->start(resources); !ok) return std::unexpected(ok.error());
    return outputs;
}

Result<> LiveOutputs::start(const Resources& resources) {
    if (!arguments_.render.empty()) {
        ImageOptions image = arguments_.image;
        if (arguments_.denoise) {
            image.settings.layers = kLayersOfDenoising;
            image.settings.samplesPerPixel = (image.settings.samplesPerPixel + 1) / 2;  // of each half
        }
        image.refine = true;
        const auto here = attachLight(resources, image);
        if (!here) return std::unexpected(here.error());
        picturesHere_ = *here;
    }
    if (!arguments_.listen.empty()) {
        const auto options = hearing(resources, true);
        if (!options) return std::unexpected(options.error());
        if (arguments_.onDevice()) {
            auto device = LiveSound::start(world_, {.render = options->render, .device = arguments_.device});
            if (!device) return std::unexpected(device.error());
            device_ = std::move(*device);
        } else {
            const auto here = attachSound(*options);
            if (!here) return std::unexpected(here.error());
            soundHere_ = *here;
        }
    }
    const auto run = [this](Worker& worker, auto present) { worker.run([this, present] { follow(present); }); };
    if (light_ && !picturesHere_)
        run(drawing_, [this](const WorldState& state, bool last) { return takePicture(state, last); });
    if (sound_ && !soundHere_) run(hearing_, [this](const WorldState& state, bool) { return hear(state); });
    return {};
}

LiveOutputs::~LiveOutputs() {
    report(abandoned_);
}

void LiveOutputs::fail(const Result<>& why) {
    const std::lock_guard lock(mutex_);
    if (problem_) problem_ = why;
    failed_ = true;
}

/// A thread that an exception has ended.
void LiveOutputs::noteThrown() {
    for (const Worker* worker : {&drawing_, &hearing_})
        if (auto ok = worker->failure("pictures and sound ended"); !ok) fail(ok);
}

void LiveOutputs::follow(const std::function<Result<>(const WorldState&, bool)>& present) {
    std::uint64_t moment = 0;
    while (!abandoned_) {
        const bool ending = ending_;
        const auto state = world_.latest(milliseconds(20));
        if (!state) continue;  // if there will never be one, frame() reports it
        const bool last = ending && (*state)->moment >= lastMoment_;
        if ((*state)->moment == moment && !last) {
            std::unique_lock lock(mutex_);
            const auto maximum = ending ? milliseconds(1) : kNoNews;
            const std::uint64_t known = newsReported_;
            ++resting_;
            news_.wait_for(lock, maximum,
                           [&] { return abandoned_ || (!ending && ((*state)->sequence != stateNow_ || ending_)); });
            if (known == newsReported_) --resting_;
            continue;
        }
        moment = (*state)->moment;
        if (auto ok = present(**state, last); !ok) return fail(ok);
        if (last) return;
    }
}

void LiveOutputs::report(std::atomic<bool>& whatIsTrue) {
    {
        const std::lock_guard lock(mutex_);
        whatIsTrue = true;
    }
    news_.notify_all();
}

bool LiveOutputs::rests() const {
    const std::lock_guard lock(mutex_);
    return resting_ == running();
}

/// On the scene's thread: notes that time has gone on or back.
void LiveOutputs::noteTime() {
    const std::lock_guard lock(mutex_);
    elapsed_ = time_.at(scene_.now());
    if (time_.start() != starts_.back()) {
        starts_.push_back(time_.start());
        statesBefore_ += stateNow_ - firstState_ + 1;
        firstState_ = scene_.sequence();
    }
    if (std::exchange(stateNow_, scene_.sequence()) == scene_.sequence()) return;
    ++newsReported_, resting_ = 0;
    news_.notify_all();
}

/// The state's time in seconds from the start. The state may be from before the scene's time went back, and cannot be
/// later than the scene. `stretch` is the number of times that time had gone back at the state before.
double LiveOutputs::elapsedAt(const WorldState& state, std::size_t& stretch) const {
    const std::lock_guard lock(mutex_);
    for (std::size_t i = starts_.size() - 1; i > stretch; --i)
        if (state.time - starts_[i] <= elapsed_ + kRounding) stretch = i;
    return state.time - starts_[stretch];
}

/// The last k with k / F not after this time.
double LiveOutputs::dueAt(double elapsed) const {
    return std::floor(elapsed * arguments_.picturesPerSecond + kRounding);
}
/// The last due picture among those that are asked for.
double LiveOutputs::lastDueAt(double elapsed) const {
    return std::min(dueAt(elapsed), std::ceil(arguments_.seconds * arguments_.picturesPerSecond - kRounding) - 1);
}

/// On the scene's thread, where node renderers draw and voice.
Result<> LiveOutputs::presentHere(bool last) {
    if (!picturesHere_ && !soundHere_) return {};
    const auto state = world_.present();
    if (!state) return std::unexpected(state.error());
    if (picturesHere_)
        if (auto ok = takePicture(**state, last); !ok) return ok;
    return soundHere_ ? hear(**state) : Result<>();
}

Result<> LiveOutputs::takePicture(const WorldState& state, bool last) {
    // The first one is made however late it is, so that the user gets a picture or an error.
    const bool none = report_.pictureStates.empty();
    const double elapsed = elapsedAt(state, stretchPictured_), k = lastDueAt(elapsed);
    if (arguments_.animated() ? k < nextPicture_ || (k != dueAt(elapsed) && !none) : !last) return {};
    auto picture = arguments_.denoise ? preview(state) : draw(state);
    if (!picture) return std::unexpected(picture.error());
    if (light_->stats().cancelled) return last && !arguments_.animated() ? notWritten(arguments_.render) : Result<>();
    const double skipped = arguments_.animated() ? k - nextPicture_ : 0;
    nextPicture_ = k + 1;
    live_.picturesSkipped += static_cast<std::uint64_t>(skipped);
    if (auto ok = files_.add(std::move(*picture), static_cast<std::uint64_t>(skipped)); !ok) return ok;
    ++live_.statesPictured;
    report_.pictureStates.push_back(light_->presented());
    report_.kept += light_->stats().kept;
    report_.pictureSamples.push_back(light_->stats().samples);
    report_.pictureTimes.push_back(std::round(elapsed * 1e6) / 1e6);
    return {};
}

Result<Picture> LiveOutputs::draw(const WorldState& state) {
    if (auto ok = light_->renderFrame(state); !ok) return std::unexpected(ok.error());
    return std::exchange(light_->frame(), Picture());
}

/// Renders two pictures with half the samples each, so that the filter of one can be judged by the other. While the
/// state stays the same, each later picture contains the earlier ones, so only the new samples are computed.
Result<Picture> LiveOutputs::preview(const WorldState& state) {
    for (int half = 0; half < 2; ++half) {
        auto picture = draw(state);
        if (!picture) return picture;
        const RenderStats& stats = light_->stats();
        if (stats.cancelled) {
            preview_.clear();
            return picture;
        }
        if (stats.kept < 1) preview_.clear();
        const int before = preview_.samples(), more = static_cast<int>(std::lround(stats.samples)) - before;
        if (more <= 0) break;  // it is as good as it gets
        Picture news = *picture;
        const float fraction = static_cast<float>(before) / static_cast<float>(more);
        for (std::size_t i = 0; before > 0 && i < news.pixels.size(); ++i)
            news.pixels[i] += fraction * (news.pixels[i] - refined_.pixels[i]);
        if (auto ok = preview_.add(std::move(news), more); !ok) return std::unexpected(ok.error());
        refined_ = std::move(*picture);
    }
    return preview_.best([this] { return !abandoned_; });
}

Result<> LiveOutputs::hear(const WorldState& state) {
    const std::size_t before = stretchHeard_;
    const double elapsed = elapsedAt(state, stretchHeard_);
    // Time elapsed, and not the scene's time, tells: a log that is played again has the same states at the same times.
    const bool again = !heard_.empty() && heard_.back() == std::pair(elapsed, state.sequence);
    if (again || soundWritten_ >= arguments_.seconds) return {};
    if (stretchHeard_ != before && elapsed > soundWritten_) {
        // Also makes the time between the last state heard and the moment when the scene went back. Otherwise the sound
        // would be too short.
        WorldState late = state;
        late.time = soundAt_ + (elapsed - soundWritten_);
        if (auto ok = hearTo(late); !ok) return ok;
    }
    if (auto ok = hearTo(state); !ok) return ok;
    ++live_.statesHeard;
    heard_.emplace_back(elapsed, sound_->presented());
    return {};
}

Result<> LiveOutputs::hearTo(const WorldState& state) {
    if (auto ok = sound_->renderFrame(state); !ok) return ok;
    soundWritten_ += std::max(0.0, state.time - std::exchange(soundAt_, state.time));
    return {};
}

Result<> LiveOutputs::frame() {
    if (auto ok = world_.update(); !ok) {
        fail(ok);
        report(abandoned_);
    }
    noteTime();
    noteThrown();
    if (!failed_ && !ending_)
        if (auto ok = presentHere(false); !ok) fail(ok);
    if (device_) {
        if (arguments_.takesEvents) device_->sendEvents();
        if (const std::string why = device_->report().failure; !why.empty()) fail(rtsg::fail(why));
    }
    if (!failed_) return {};
    const std::lock_guard lock(mutex_);
    return problem_;
}

Result<> LiveOutputs::finish() {
    if (arguments_.isCutShort()) report(abandoned_);
    if (!failed_ && !abandoned_)
        if (auto ok = presentHere(true); !ok) fail(ok);
    if (running() > 0) {
        const auto last = world_.present();
        if (!last) fail(std::unexpected(last.error()));
        lastMoment_ = last ? (*last)->moment : 0;
    }
    finishDespiteInterruption();
    report(ending_);
    const auto progress = running() > 0 ? arguments_.context.progress("completing pictures and sound") : nullptr;
    while (running() > 0) {
        (void)frame();  // whoever asks gets the last state
        if (progress) progress(0, 1);
        std::this_thread::sleep_for(milliseconds(1));
    }
    if (progress) progress(1, 1);
    noteThrown();
    if (device_) {
        live_.device = device_->stop();
        arguments_.context.report(live_.device->diagnostics);
        if (const std::string& why = live_.device->failure; !why.empty()) fail(rtsg::fail(why));
    }
    noteTime();
    live_.states = statesBefore_ + stateNow_ - firstState_ + 1;
    return write();
}

Result<> LiveOutputs::write() {
    if (arguments_.isCutShort())
        return allOf(arguments_.context, {[&] { return problem_; }, [&] { return leaveUnwritten(); }});
    const double missing = arguments_.animated() ? lastDueAt(elapsed_) + 1 - nextPicture_ : 0;
    const auto skipped = light_ ? static_cast<std::uint64_t>(std::max(0.0, missing)) : 0;
    live_.picturesSkipped += skipped;
    return allOf(arguments_.context, {[&] { return problem_; }, [&] { return finishSound(); },
                                      [&] { return finishPictures(skipped); }, [&] { return finishScene(); }});
}

/// The state of which the sound at this time was made. The last one if several states have that time.
std::uint64_t LiveOutputs::heardAt(double elapsed) const {
    auto heard = std::ranges::lower_bound(heard_, elapsed, {}, &std::pair<double, std::uint64_t>::first);
    if (heard == heard_.end()) return 0;
    while (std::next(heard) != heard_.end() && std::next(heard)->first == heard->first) ++heard;
    return heard->second;
}

OutputReport LiveOutputs::report() const {
    OutputReport report = report_;
    for (const double t : report.pictureTimes) report.soundStates.push_back(heardAt(t - kRounding));
    if (sound_ && std::isfinite(arguments_.seconds)) report.addMissingSound(report.soundSeconds, arguments_.seconds);
    report.world = world_.counts();
    if (arguments_.tessellation.any()) report.cuts = world_.flattener().cuts();
    report.live = live_;
    return report;
}

}  // namespace rtsg
