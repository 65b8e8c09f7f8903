#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>

#include <fmt/format.h>

#include <rtsg/audio/listen.h>
#include <rtsg/renderers/tessellate.h>

namespace rtsg {
namespace {

using Clock = std::chrono::steady_clock;

double secondsSince(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}

Flattener::Options flattening() {
    Flattener::Options options;
    options.meshes = [](const Scene& scene, NodeId geometry) {
        auto mesh = tessellate(scene, geometry);
        return mesh ? *mesh : nullptr;
    };
    return options;
}

/// The speed-up graph as one more follower of the flattened scene.
class WorldFollower final : public InstanceSubscriber {
  public:
    explicit WorldFollower(RayWorld& world) : world_(world) {}
    Result<> apply(const Scene&, const ChangeSet&, const InstanceDelta& delta) override {
        world_.apply(delta);
        return {};
    }

  private:
    RayWorld& world_;
};

/// The largest half width in just noticeable differences; infinity while one is missing.
double worstError(const MetricsEstimate& m) {
    double worst = 0;
    const auto take = [&](double ci, double noticeable) {
        // A figure that does not exist has no error either: a room too dead for T20, say.
        if (std::isfinite(noticeable) && noticeable > 0)
            worst = std::max(worst, std::isfinite(ci) ? ci / noticeable : 1e9);
    };
    for (std::size_t b = 1; b < 7; ++b) {
        take(m.ci95.t20[b], 0.05 * m.value.t20[b]);
        take(m.ci95.t30[b], 0.05 * m.value.t30[b]);
        take(m.ci95.c80[b], std::isfinite(m.value.c80[b]) ? 1.0 : NAN);
        take(m.ci95.d50[b], std::isfinite(m.value.d50[b]) ? 0.05 : NAN);
        take(m.ci95.g[b], std::isfinite(m.value.g[b]) ? 1.0 : NAN);
    }
    return worst;
}

std::string jsonNumber(double value) {
    return std::isfinite(value) ? fmt::format("{:.7g}", value) : "null";
}

std::string jsonArray(const Bands& values) {
    std::string text = "[";
    for (std::size_t b = 0; b < kBandCount; ++b) text += (b ? "," : "") + jsonNumber(values[b]);
    return text + "]";
}

std::string jsonString(std::string_view text) {
    std::string result = "\"";
    for (const char c : text) {
        if (c == '"' || c == '\\') {
            result += '\\';
            result += c;
        } else if (static_cast<unsigned char>(c) < 0x20) {
            result += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
        } else {
            result += c;
        }
    }
    return result + "\"";
}

std::string jsonFigures(const RoomMetrics& m) {
    return fmt::format(
        "\"EDT_s\":{},\"T20_s\":{},\"T30_s\":{},\"C50_db\":{},\"C80_db\":{},\"D50\":{},\"Ts_s\":{},\"G_db\":{}",
        jsonArray(m.edt), jsonArray(m.t20), jsonArray(m.t30), jsonArray(m.c50), jsonArray(m.c80), jsonArray(m.d50),
        jsonArray(m.ts), jsonArray(m.g));
}

double meanOf(const Bands& bands) {
    double sum = 0;
    for (const double value : bands) sum += value / kBandCount;
    return sum;
}

/// 2000 sqrt(T / V), with the volume that the listener sees; NaN in the open.
double schroederFrequency(const AcousticGeometry& geometry, const glm::dvec3& listener, double reverberationTime) {
    constexpr int kDirections = 2048;
    constexpr double kGolden = 2.39996322972865332;
    double volume = 0;
    for (int i = 0; i < kDirections; ++i) {
        const double z = 1 - (2 * i + 1) / double{kDirections}, r = std::sqrt(1 - z * z);
        AcousticHit hit;
        if (!geometry.closest(listener, {r * std::cos(i * kGolden), r * std::sin(i * kGolden), z}, 1e6, kNoPlane, hit))
            return std::numeric_limits<double>::quiet_NaN();
        volume += 4 * std::numbers::pi / 3 * hit.distance * hit.distance * hit.distance / kDirections;
    }
    return 2000 * std::sqrt(reverberationTime / volume);
}

}  // namespace

std::string ListenReport::toJson() const {
    std::string text = "{\"sources\":[";
    for (std::size_t i = 0; i < sources.size(); ++i) {
        const Source& s = sources[i];
        std::uint32_t highest = 0;
        for (const Arrival& arrival : s.trace.arrivals) highest = std::max(highest, arrival.order);
        text += fmt::format(
            "{}{{\"source\":{},\"position\":[{},{},{}],\"bands_hz\":{},{},\"ci95\":{{{}}},\"schroeder_hz\":{},\"image_"
            "order\":{},"
            "\"images\":{},"
            "\"rays\":{},\"absorbed\":{},\"escaped\":{},\"truncated\":{}}}",
            i ? "," : "", jsonString(s.source), jsonNumber(s.position.x), jsonNumber(s.position.y),
            jsonNumber(s.position.z), jsonArray(kBandHz), jsonFigures(s.metrics.value), jsonFigures(s.metrics.ci95),
            jsonNumber(s.schroederHz), highest, s.trace.arrivals.size(), s.trace.rays, jsonArray(s.trace.absorbed),
            jsonArray(s.trace.escaped), jsonArray(s.trace.truncated));
    }
    text += fmt::format("],\"rays\":{},\"seconds\":{},\"escaped\":{},\"gain\":{}}}", rays, jsonNumber(seconds),
                        jsonNumber(escaped), jsonNumber(static_cast<double>(gain)));
    return text;
}

SoundBuffer ListenReport::impulseResponses(int sampleRate) const {
    std::vector<ImpulseResponse> responses;
    std::size_t frames = 1;
    for (const Source& source : sources) {
        ImpulseResponseOptions options;
        options.sampleRate = sampleRate;
        responses.push_back(makeImpulseResponse(source.trace.echogram(), options));
        frames = std::max(frames, responses.back().frames());
    }
    SoundBuffer result{sampleRate, static_cast<int>(std::max<std::size_t>(1, responses.size())), {}};
    result.samples.resize(frames * static_cast<std::size_t>(result.channels));
    for (std::size_t k = 0; k < responses.size(); ++k)
        for (std::size_t i = 0; i < responses[k].frames(); ++i)
            result.samples[i * responses.size() + k] = responses[k].channels[0][i];
    return result;
}

struct ListenSession::Impl {
    explicit Impl(const ListenOptions& o) : options(o), follower(world), flattened(flattening()) {}

    ListenOptions options;
    RayWorld world;
    WorldFollower follower;
    FlattenedScene flattened;
    std::unique_ptr<AcousticRenderer> renderer;
    Scene* scene = nullptr;
    ListenReport report;
    Attachment attachment;  // last: detached first
};

ListenSession::ListenSession(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ListenSession::~ListenSession() = default;

const AcousticRenderer& ListenSession::renderer() const {
    return *impl_->renderer;
}
OpenedGeometry ListenSession::room(const glm::dvec3& source) {
    return impl_->renderer->geometryFor(source);
}
const RayWorld& ListenSession::world() const {
    return impl_->world;
}

Result<std::unique_ptr<ListenSession>> ListenSession::attach(Scene& scene, const ListenOptions& options) {
    auto impl = std::make_unique<Impl>(options);
    AcousticRenderer::Options render = options.render;
    render.trace.seed = options.trace.seed;
    render.trace.air = options.trace.air;
    render.startTime = scene.now();
    auto renderer = AcousticRenderer::create(impl->world, render);
    if (!renderer) return std::unexpected(renderer.error());
    impl->renderer = std::move(*renderer);
    impl->scene = &scene;
    impl->flattened.add(impl->follower);
    impl->flattened.add(*impl->renderer);
    impl->attachment = scene.bus().attach(impl->flattened, Delivery::polled);
    return std::unique_ptr<ListenSession>(new ListenSession(std::move(impl)));
}

Result<> ListenSession::advance(double t) {
    const auto start = Clock::now();
    impl_->attachment.poll();
    if (!impl_->attachment.attached()) return fail("listening failed: " + impl_->attachment.failure());
    if (impl_->options.sound)
        if (auto rendered = impl_->renderer->render(t, impl_->report.sound); !rendered) return rendered;
    impl_->report.seconds += secondsSince(start);
    return {};
}

Result<> ListenSession::measure() {
    const auto start = Clock::now();
    Impl& s = *impl_;
    s.attachment.poll();
    if (!s.attachment.attached()) return fail("listening failed: " + s.attachment.failure());
    const SoundScene& sounds = s.renderer->scene();
    const glm::dvec3 listener = sounds.listener().position;
    for (const SoundEmitter& emitter : sounds.emitters()) {
        if (!sounds.sound(emitter).enabled) continue;
        ListenReport::Source source;
        source.source = emitter.name;
        source.position = sounds.position(emitter);
        const OpenedGeometry room = s.renderer->geometryFor(source.position);
        const AcousticTracer tracer(room);
        source.trace = tracer.trace(source.position, listener, s.options.trace);
        source.metrics = source.trace.metrics();
        while (s.options.error > 0 && source.trace.rays < s.options.maxRays &&
               worstError(source.metrics) > s.options.error) {
            // Errors fall with the root of the rays; never more than four times as many on a guess.
            const double ratio = std::min(2.0, worstError(source.metrics) / s.options.error);
            const auto more =
                static_cast<std::uint64_t>(static_cast<double>(source.trace.rays) * std::max(0.2, ratio * ratio - 1));
            tracer.refine(source.trace, source.position, listener, s.options.trace,
                          std::min(more, s.options.maxRays - source.trace.rays));
            source.metrics = source.trace.metrics();
            if (s.options.progress && !s.options.progress(0)) return fail("cancelled");
        }
        source.schroederHz = schroederFrequency(room, listener, source.metrics.value.t20[4]);
        s.report.rays += source.trace.rays;
        s.report.sources.push_back(std::move(source));
    }
    s.report.escaped = 0;
    for (const ListenReport::Source& source : s.report.sources)
        s.report.escaped += meanOf(source.trace.escaped) / static_cast<double>(s.report.sources.size());
    s.report.seconds += secondsSince(start);
    return {};
}

ListenReport ListenSession::finish() {
    Impl& s = *impl_;
    s.report.gain = normalise(s.report.sound);
    s.report.diagnostics.append(s.renderer->diagnostics());
    s.report.diagnostics.append(s.flattened.flattener().diagnostics());
    if (s.renderer->scene().emitters().empty()) s.report.diagnostics.warning({}, "the scene has no sounds");
    return std::move(s.report);
}

Result<ListenReport> listen(Scene& scene, const ListenOptions& options) {
    if (!(options.seconds >= 0 && options.seconds <= 24 * 3600)) return fail("the duration must be 0 to 24 hours");
    if (!(options.framesPerSecond > 0 && options.framesPerSecond <= 1000))
        return fail("the frame rate must be up to 1000");
    auto session = ListenSession::attach(scene, options);
    if (!session) return std::unexpected(session.error());
    const double start = scene.now();
    scene.newFrame(start);
    if (options.metrics)
        if (auto measured = (*session)->measure(); !measured) return std::unexpected(measured.error());
    if (options.sound) {
        const auto frames = static_cast<std::uint64_t>(std::ceil(options.seconds * options.framesPerSecond - 1e-9));
        for (std::uint64_t frame = 1; frame <= frames; ++frame) {
            const double t = start + std::min(options.seconds, static_cast<double>(frame) / options.framesPerSecond);
            scene.newFrame(t);
            if (auto done = (*session)->advance(t); !done) return std::unexpected(done.error());
            if (options.progress && !options.progress(static_cast<double>(frame) / static_cast<double>(frames)))
                return fail("cancelled");
        }
    }
    return (*session)->finish();
}

}  // namespace rtsg
