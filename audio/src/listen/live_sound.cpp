// Renders the newest state of a world into a sound device, block by block, on a thread of its own.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <mutex>
#include <optional>
#include <span>
#include <utility>
#include <variant>

#include <fmt/format.h>

#include <rtsg/audio/live_sound.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/worker.h>

#include "audio_events.h"
#include "engine/acoustic_engine.h"
#include "scene/acoustic_tables.h"
#include "sealed_text.h"
#include "sound_io/sound_device.h"
#include "sound_io/thread_priority.h"

namespace rtsg {
namespace {

using Clock = std::chrono::steady_clock;

/// Farther apart than this the clocks of scene and device are set anew; seconds.
constexpr double kApart = 0.1;
/// The share of a core above which sound loses its priority, so that others have something of a single core.
constexpr double kHurried = 0.8;
constexpr double kLevelSeconds = 0.2;

}  // namespace

struct LiveSound::Impl {
    Impl(SharedWorld& w, const LiveOptions& o, std::unique_ptr<AcousticEngine> e, SoundDevice d)
        : world(w),
          options(o),
          tables(w.rays(), o.render.defaultMaterial, o.render.resources, false, o.render.materials),
          engine(std::move(e)),
          device(std::move(d)) {
        reported.device = device.name();
    }
    ~Impl() { end(); }

    void end() {
        worker.stop();
        if (std::exchange(added, false)) world.remove(tables);
    }

    void run() {
        const ThreadPriority soon(ThreadPriority::Kind::soon);
        const double blockSeconds = static_cast<double>(options.render.blockSize) / options.render.sampleRate;
        Clock::duration working{};
        const auto begin = Clock::now();
        bool hurried = true;
        std::string failure;
        const auto wait =
            std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(0.2 * blockSeconds));
        while (!worker.stops() && failure.empty()) {
            if (device.free() == 0) {
                worker.pause(wait);
                continue;
            }
            const auto start = Clock::now();
            if (auto played = playBlock(); !played) failure = played.error().text;
            const auto now = Clock::now();
            working += now - start;
            if (hurried && now - begin > std::chrono::seconds(1) &&
                std::chrono::duration<double>(working) > kHurried * (now - begin)) {
                ThreadPriority::set(ThreadPriority::Kind::usual);
                hurried = false;
            }
            const bool look = wanted.exchange(false);
            AudioFindings seen = look ? engine->analyse() : AudioFindings();
            const std::lock_guard lock(mutex);
            if (look) found = std::move(seen);
            reported.blocks = blocks;
            reported.clipped = clipped;
            reported.seconds = static_cast<double>(blocks) * blockSeconds;
            reported.underruns = device.underruns();
            reported.latencySeconds = std::max(reported.latencySeconds, device.latencySeconds());
            reported.busy =
                std::chrono::duration<double>(working).count() / std::chrono::duration<double>(now - begin).count();
            reported.level = std::sqrt(meanSquare);
            reported.heard = engine->heard();
            reported.failure = failure;
        }
    }

    Result<> playBlock() {
        // The newest there is; the scene is asked for one that is newer, and not waited for.
        if (auto newest = world.latest(std::chrono::nanoseconds(0))) {
            const auto sounds = (*newest)->of(number);
            if (sounds && (*newest)->rays) state = *newest;
        }
        out.assign(2 * options.render.blockSize, 0.0f);
        if (state) {
            const double until = engine->liveEnd();
            if (!ahead || std::abs(state->time + *ahead - until) > kApart) ahead = until - state->time;
            sound.samples.clear();
            const auto sounds = std::static_pointer_cast<const AcousticState>(state->of(number));
            if (auto done = engine->renderLive(sounds, state->rays, state->time + *ahead, sound); !done) return done;
            std::copy_n(sound.samples.begin(), std::min(sound.samples.size(), out.size()), out.begin());
            applyVolume();
            clip(out);
        }
        ++blocks;
        return device.write(out);
    }

    /// It goes to a new volume within a block, so that nothing clicks.
    void applyVolume() {
        const float next = volume, step = (next - applied) / static_cast<float>(out.size());
        if (next == 1 && applied == 1) return;
        for (float& sample : out) sample *= applied += step;
        applied = next;
    }
    void clip(std::span<float> samples) {
        double sum = 0;
        for (float& sample : samples) {
            if (std::abs(sample) > 1) ++clipped;
            loudest = std::max(loudest, std::abs(sample));
            sample = std::clamp(sample, -1.0f, 1.0f);
            sum += double{sample} * double{sample};
        }
        if (samples.empty()) return;
        const double seconds = static_cast<double>(options.render.blockSize) / options.render.sampleRate;
        const double fraction = std::min(1.0, seconds / kLevelSeconds);
        meanSquare += fraction * (sum / static_cast<double>(samples.size()) - meanSquare);
    }

    SharedWorld& world;
    LiveOptions options;
    AcousticTables tables;
    std::uint64_t number = 0;  // of the tables
    std::vector<float> out;    // of a block, for the device
    SoundBuffer sound;         // and as it was made
    bool added = false;
    std::unique_ptr<AcousticEngine> engine;
    SoundDevice device;
    std::shared_ptr<const WorldState> state;
    std::optional<double> ahead;  // of the scene's places, s
    std::uint64_t blocks = 0, clipped = 0;
    std::atomic<float> volume = 1;
    float applied = 1;  // in the last block
    float loudest = 0;
    double meanSquare = 0;
    std::atomic<bool> wanted = true;  // what nodes find
    mutable std::mutex mutex;
    LiveReport reported;
    std::optional<AudioFindings> found;
    Worker worker{"rtsg sound"};  // last: its job uses the others
};

LiveSound::LiveSound(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
LiveSound::~LiveSound() = default;

Result<std::unique_ptr<LiveSound>> LiveSound::start(SharedWorld& world, const LiveOptions& options) {
    LiveOptions live = options;
    live.render.ambisonicOrder = 0;
    live.render.background = true;
    live.render.startTime = world.scene().now();
    auto engine = AcousticEngine::create(live.render);
    if (!engine) return std::unexpected(engine.error());
    auto device = [&] {
        const ThreadPriority soon(ThreadPriority::Kind::soonWithThreads);  // OpenAL's
        return SoundDevice::open({.name = live.device,
                                  .sampleRate = live.render.sampleRate,
                                  .blockSize = live.render.blockSize,
                                  .blocks = live.blocks});
    }();
    if (!device) return std::unexpected(device.error());
    auto impl = std::make_unique<Impl>(world, live, std::move(*engine), std::move(*device));
    impl->number = world.add(impl->tables);
    impl->added = true;
    // The device's first block has this state, so that the first look at walls and sources is over before it plays,
    // whenever the scene goes on. If readers hold too many states, it begins with the next one.
    if (auto present = world.present(); present && (*present)->of(impl->number) && (*present)->rays)
        impl->state = std::move(*present);
    impl->engine->prepare(*impl->tables.latest());
    impl->worker.run([s = impl.get()] { s->run(); });
    return std::unique_ptr<LiveSound>(new LiveSound(std::move(impl)));
}

void LiveSound::sendEvents() {
    std::optional<AudioFindings> found;
    {
        const std::lock_guard lock(impl_->mutex);
        found.swap(impl_->found);
    }
    if (!found) return;
    impl_->wanted = true;
    sendAudioEvents(impl_->world.scene(), *found);
}

void LiveSound::setVolume(double volume) {
    impl_->volume = static_cast<float>(std::clamp(volume, 0.0, 1.0));
}

LiveReport LiveSound::report() const {
    const std::lock_guard lock(impl_->mutex);
    LiveReport report = impl_->reported;
    if (const auto ok = impl_->worker.failure("sound ended"); !ok) report.failure = ok.error().text;
    return report;
}

namespace {

/// Tells of inputs that came too late, too fast or not at all.
void reportOn(const ClipLibrary::GivenSounds& sounds, std::string_view what, Diagnostics& diagnostics) {
    for (const auto& [id, given] : sounds) {
        const auto* input = std::get_if<std::shared_ptr<SoundInput>>(&given);
        if (!input) continue;
        const SoundInput& heard = **input;
        const std::string name = fmt::format("{} '{}'", what, id);
        if (const std::string why = heard.problem(); !why.empty())
            diagnostics.warning({}, fmt::format("{} ended: {}", name, why));
        if (heard.gaps() > 0)
            diagnostics.warning({}, fmt::format("{} was too late {} times: gaps were heard", name, heard.gaps()));
        if (heard.dropped() > 0)
            diagnostics.warning({},
                                fmt::format("{} was ahead: {} samples of it were not heard", name, heard.dropped()));
    }
}

}  // namespace

LiveReport LiveSound::stop() {
    impl_->end();
    LiveReport report = this->report();
    if (report.clipped > 0)
        report.diagnostics.warning(
            {}, fmt::format("{} samples were beyond full scale, by up to {:.1f} dB, and were clipped", report.clipped,
                            20 * std::log10(impl_->loudest)));
    reportOn(impl_->options.render.given.microphones, "microphone", report.diagnostics);
    reportOn(impl_->options.render.given.streams, "stream", report.diagnostics);
    report.diagnostics.append(impl_->tables.scene().diagnostics());
    report.diagnostics.append(impl_->engine->diagnostics());
    reportSealed(impl_->world.scene(), impl_->engine->sealed(), impl_->options.render.startTime,
                 impl_->options.render.document, report.diagnostics);
    reportLeaks(impl_->world.scene(), impl_->engine->leaks(), impl_->options.render.document, report.diagnostics);
    return report;
}

}  // namespace rtsg
