// Sound from the shared world: following it, making sound frame by frame, measuring rooms.
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <thread>
#include <utility>

#include <fmt/format.h>

#include <rtsg/audio/material_table.h>
#include <rtsg/audio/sound_renderer.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/parallel_for.h>

#include "audio_events.h"
#include "engine/acoustic_engine.h"
#include "position_figures.h"
#include "response/interaural.h"
#include "response/listening_positions.h"
#include "response/sealed_result.h"
#include "room_materials.h"
#include "scene/source_pattern.h"
#include "sealed_text.h"
#include "unheard_text.h"

namespace rtsg {
namespace {

/// The most escaped rays of a batch that say where they went.
constexpr int kExits = 64;

using Clock = std::chrono::steady_clock;

double secondsSince(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}

double meanOf(const Bands& bands) {
    double sum = 0;
    for (const double value : bands) sum += value / kBandCount;
    return sum;
}

/// 2000 sqrt(T / V), with the volume that the listener sees; NaN in the open.
double schroederFrequency(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                          double reverberationTime) {
    const Surroundings around = surroundings(geometry, offSolids(geometry, listener, source), 1, 2048);
    return around.closed ? 2000 * std::sqrt(reverberationTime / around.volume)
                         : std::numeric_limits<double>::quiet_NaN();
}

/// The box of a room whose walls all lie on six planes along the axes, two for each.
std::optional<RoomBox> boxOf(const AcousticGeometry& geometry) {
    if (geometry.planes().size() != 6) return std::nullopt;
    RoomBox box;
    std::array<int, 3> found{};
    for (const ReflectingPlane& plane : geometry.planes())
        for (int axis = 0; axis < 3; ++axis) {
            if (std::abs(plane.normal[axis]) < 1 - 1e-9) continue;
            const double at = plane.offset / plane.normal[axis];
            const int before = found[static_cast<std::size_t>(axis)]++;
            box.low[axis] = before ? std::min(box.low[axis], at) : at;
            box.high[axis] = before ? std::max(box.high[axis], at) : at;
        }
    if (found != std::array{2, 2, 2}) return std::nullopt;
    return box;
}

}  // namespace

struct SoundRenderer::Impl {
    Impl(SharedWorld& world, const ListenOptions& o) : options(o), rays(world.rays()) {}

    ListenOptions options;
    const RayWorld& rays;
    std::string refused;                         // why it could not be attached
    std::unique_ptr<AcousticRenderer> renderer;  // null if it could not be made
    ListenReport report;
    std::thread::id scenesThread;  // that last told of changes
    std::size_t blockAt = 0;       // of report.sound.samples
    long long dropped = 0;         // frames before them
    double start = 0;
    std::size_t reportedSealed = 0, reportedLeaks = 0;
    bool hadSounds = false;
    double measured = 0;                   // share of a survey
    std::unique_ptr<EarCorrelation> ears;  // once figures were asked for
    /// Traces with the source's directivity; nothing for listeners to which it radiates as to all others. Cones are the
    /// same for all listeners, so they share rays; ellipsoids depend on the listener's distance.
    std::vector<std::optional<TraceResult>> traceDirected(const AcousticTracer& tracer, const SoundEmitter& emitter,
                                                          std::span<const glm::dvec3> listeners,
                                                          TraceOptions tracing) const {
        const bool levels = options.render.levels == AcousticOptions::Levels::x3d;
        const std::size_t together = emitter.sound->law == SoundNode::Law::ellipsoids ? 1 : listeners.size();
        const glm::dvec3 position = emitter.position();
        std::vector<std::optional<TraceResult>> directed(listeners.size());
        tracing.exits = 0;
        tracing.lateral = false;
        for (std::size_t first = 0; first < listeners.size(); first += together) {
            tracing.pattern = patternOf(emitter, position, listeners[first], levels);
            if (!tracing.pattern || !tracing.goOn()) continue;
            const auto some = listeners.subspan(first, together);
            std::vector<TraceResult> traces = tracer.trace(position, some, tracing);
            const bool silent = std::ranges::all_of(traces, &TraceResult::silent);
            if (options.error > 0 && !silent)
                tracer.refineTo(traces, position, some, tracing, options.error, options.maxRays, tracing.goOn);
            std::ranges::move(traces, directed.begin() + static_cast<std::ptrdiff_t>(first));
        }
        return directed;
    }

    const EarCorrelation& earsOf(double speedOfSound) {
        if (!ears) {
            constexpr int kRate = 48000;
            const auto& head = options.render.hrtf;
            ears = std::make_unique<EarCorrelation>(head ? *head : *Hrtf::sphere(kRate, kHeadRadius, speedOfSound));
        }
        return *ears;
    }

    /// Drops the sound before ListenOptions::from.
    void drop() {
        if (!options.from) return;
        SoundBuffer& sound = report.sound;
        const auto all = std::llround((*options.from - start) * options.render.sampleRate);
        const auto frames = std::min(all - dropped, static_cast<long long>(sound.frames()));
        if (frames <= 0) return;
        sound.samples.erase(sound.samples.begin(), sound.samples.begin() + frames * sound.channels);
        dropped += frames;
        blockAt = 0;
    }

    /// Reports the findings since the last call.
    void addDiagnostics(const Scene& scene, Diagnostics& diagnostics) {
        const std::span<const SealedSource> sealed = renderer->engine().sealed();
        const std::span<const SoundLeak> leaks = renderer->engine().leaks();
        reportSealed(scene, sealed.subspan(std::exchange(reportedSealed, sealed.size())), start,
                     options.render.document, diagnostics);
        reportLeaks(scene, leaks.subspan(std::exchange(reportedLeaks, leaks.size())), options.render.document,
                    diagnostics);
    }
};

SoundRenderer::SoundRenderer(SharedWorld& world, const ListenOptions& options)
    : WorldRenderer(world), impl_(std::make_unique<Impl>(world, options)) {
    Impl& s = *impl_;
    AcousticRenderer::Options render = options.render;
    render.trace.seed = options.trace.seed;
    render.trace.air = options.trace.air;
    render.startTime = s.start = world.scene().now();
    auto renderer = AcousticRenderer::create(s.rays, render);
    if (!renderer) {
        s.refused = renderer.error().text;
        return;
    }
    s.renderer = std::move(*renderer);
    if (auto ok = attachToScene(world.scene()); !ok) s.refused = ok.error().text;
}

SoundRenderer::~SoundRenderer() {
    SoundRenderer::detachFromScene();
}

std::string SoundRenderer::failure() const {
    return impl_->refused.empty() ? WorldRenderer::failure() : impl_->refused;
}

Result<> SoundRenderer::follow(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) {
    impl_->scenesThread = std::this_thread::get_id();
    const Result<> applied = impl_->renderer->apply(scene, changes, delta);
    impl_->hadSounds = impl_->hadSounds || !impl_->renderer->scene().emitters().empty();
    return applied;
}

std::shared_ptr<const void> SoundRenderer::freezeTables() {
    return impl_->renderer->tables().latest();
}

Result<> SoundRenderer::renderFrame(const WorldState& state) {
    Impl& s = *impl_;
    if (!s.refused.empty()) return fail("listening failed: " + s.refused);
    if (ownsNodes() && std::this_thread::get_id() != s.scenesThread)
        return fail("sound renderer: nodes that it voices itself are voiced on the scene's thread only");
    const auto tables = std::static_pointer_cast<const AcousticState>(begin(state));
    if (!tables || !state.rays) return fail("sound renderer: this state was made without it");
    const auto start = Clock::now();
    SoundBuffer& sound = s.report.sound;
    s.blockAt = sound.samples.size();
    if (!s.options.sound) return {};
    if (auto rendered = s.renderer->engine().render(*tables, *state.rays, state.time, sound); !rendered)
        return rendered;
    s.drop();
    s.report.seconds += secondsSince(start);
    return renderOwnNodes(kVoice);
}

Result<> SoundRenderer::renderFrame() {
    Impl& s = *impl_;
    if (!s.refused.empty()) return fail("listening failed: " + s.refused);
    const auto start = Clock::now();
    if (auto ok = begin(); !ok) return ok;
    presentsNow();
    SoundBuffer& sound = s.report.sound;
    s.blockAt = sound.samples.size();
    if (!s.options.sound) return {};
    if (auto rendered = s.renderer->render(world().scene().now(), sound); !rendered) return rendered;
    s.drop();
    s.report.seconds += secondsSince(start);
    return renderOwnNodes(kVoice);
}

void SoundRenderer::sendEvents() {
    if (impl_->renderer) sendAudioEvents(world().scene(), impl_->renderer->engine().analyse());
}

std::span<float> SoundRenderer::block() {
    return std::span(impl_->report.sound.samples).subspan(impl_->blockAt);
}
double SoundRenderer::blockStart() const {
    const std::size_t before = impl_->blockAt / static_cast<std::size_t>(std::max(1, channels()));
    return impl_->start + static_cast<double>(before + static_cast<std::size_t>(impl_->dropped)) / sampleRate();
}
int SoundRenderer::channels() const {
    return impl_->renderer ? impl_->renderer->engine().channels() : 0;
}
int SoundRenderer::sampleRate() const {
    return impl_->options.render.sampleRate;
}
const AcousticRenderer& SoundRenderer::renderer() const {
    return *impl_->renderer;
}
OpenedGeometry SoundRenderer::room(const glm::dvec3& source) {
    return impl_->renderer->geometryFor(source);
}

Result<std::vector<ListenReport::Source>> SoundRenderer::measureAt(const SoundEmitter& emitter,
                                                                   std::span<const glm::dvec3> listeners) {
    Impl& s = *impl_;
    std::vector<ListenReport::Source> heard;
    const SoundScene& sounds = s.renderer->scene();
    if (!sounds.sound(emitter).enabled || !sounds.sound(emitter).reflected) return heard;
    const glm::dvec3 position = sounds.position(emitter);
    const OpenedGeometry room = s.renderer->geometryFor(position);
    const AcousticTracer tracer(room);
    TraceOptions tracing = s.options.trace;
    tracing.air = s.renderer->air();
    tracing.exits = kExits;
    tracing.lateral = true;
    // The progress function is called on this thread, which traces along with the others.
    std::atomic<bool> cancelled = false;
    const auto goOn = [&, self = std::this_thread::get_id()] {
        if (!cancelled && s.options.progress && std::this_thread::get_id() == self && !s.options.progress(s.measured))
            cancelled = true;
        return !cancelled;
    };
    tracing.goOn = goOn;
    std::vector<TraceResult> traces = tracer.trace(position, listeners, tracing);
    if (cancelled) return fail("cancelled");
    std::vector<std::optional<Seal>> seals;
    bool allSealed = true;
    for (std::size_t i = 0; i < listeners.size(); ++i) {
        seals.push_back(sealOf(traces[i], room, position, listeners[i]));
        allSealed = allSealed && seals.back();
    }
    if (s.options.error > 0 && !allSealed)
        tracer.refineTo(traces, position, listeners, tracing, s.options.error, s.options.maxRays, goOn);
    std::vector<std::optional<TraceResult>> directed(listeners.size());
    if (s.options.impulseResponses && !cancelled) directed = s.traceDirected(tracer, emitter, listeners, tracing);
    if (cancelled) return fail("cancelled");
    RoomOpenings openings;
    if (!traces.empty()) openings = room.openings(position, traces.front().exits, traces.front().escaped);
    nameShapes(world().scene(), openings);
    s.renderer->engine().note(emitter, openings);
    for (std::size_t i = 0; i < listeners.size(); ++i) {
        ListenReport::Source& source = heard.emplace_back();
        source.source = emitter.name;
        source.position = position;
        source.trace = std::move(traces[i]);
        source.directed = std::move(directed[i]);
        setFigures(source, s.earsOf(tracing.air.speedOfSound), s.options.speech);
        source.openings = openings;
        source.schroederHz = schroederFrequency(room, position, listeners[i], source.metrics.value.t20[kBand1k]);
        s.renderer->engine().note(emitter, listeners[i], world().scene().now(), std::move(seals[i]));
    }
    return heard;
}

Result<> SoundRenderer::measure() {
    const auto start = Clock::now();
    Impl& s = *impl_;
    if (!s.refused.empty()) return fail("listening failed: " + s.refused);
    if (auto ok = begin(); !ok) return ok;
    const SoundScene& sounds = s.renderer->scene();
    s.report.listener = sounds.listener();
    s.report.air = s.renderer->air();
    s.report.speech = s.options.speech;
    s.report.responses = s.options.responses;
    s.report.seed = s.options.trace.seed;
    s.report.hrtf = s.options.render.hrtf;
    s.report.ambisonicOrder = std::max(1, s.options.render.ambisonicOrder);
    for (const SoundEmitter& emitter : sounds.emitters()) {
        auto sources = measureAt(emitter, std::span(&sounds.listener().position, 1));
        if (!sources) return std::unexpected(sources.error());
        for (ListenReport::Source& source : *sources) {
            s.report.rays += source.trace.rays;
            s.report.sources.push_back(std::move(source));
        }
    }
    s.report.escaped = 0;
    for (const ListenReport::Source& source : s.report.sources)
        s.report.escaped += meanOf(source.trace.escaped) / static_cast<double>(s.report.sources.size());
    s.report.seconds += secondsSince(start);
    return {};
}

Result<RoomReport> SoundRenderer::survey(std::vector<ListeningPosition> positions) {
    if (!impl_->refused.empty()) return fail("listening failed: " + impl_->refused);
    if (auto ok = begin(); !ok) return std::unexpected(ok.error());
    if (positions.empty()) positions = impl_->renderer->scene().positions();
    auto report = surveyAt(positions, Keeps::echograms);
    if (report) describeRoom(*report);
    return report;
}

void SoundRenderer::describeRoom(RoomReport& report) {
    Impl& s = *impl_;
    if (report.pairs.empty()) return;
    const glm::dvec3 source = report.pairs.front().sourceAt, listener = report.pairs.front().listenerAt;
    const OpenedGeometry room = s.renderer->geometryFor(source);
    report.room = measureRoom(room, offSolids(room, source, listener));
    const auto& materials = room.materials();
    report.sabine = sabineTimes(report.room, materials, report.air);
    report.eyring = eyringTimes(report.room, materials, report.air);
    report.materials = materialsOf(world().scene(), report.room, materials,
                                   [&](std::uint32_t at) { return s.renderer->tables().nodeOfMaterial(at); });
    AcousticBox box = report.room.box;
    for (const RoomReport::Pair& pair : report.pairs) box.extend(pair.sourceAt), box.extend(pair.listenerAt);
    report.plan = planOf(s.renderer->tables().latest()->walls, listener.y, box);
}

Result<RoomMap> SoundRenderer::map(double height, double step) {
    Impl& s = *impl_;
    if (!s.refused.empty()) return fail("listening failed: " + s.refused);
    if (auto ok = begin(); !ok) return std::unexpected(ok.error());
    const SoundScene& sounds = s.renderer->scene();
    const auto source = std::ranges::find_if(sounds.emitters(), [&](const SoundEmitter& emitter) {
        return sounds.sound(emitter).enabled && sounds.sound(emitter).reflected;
    });
    if (source == sounds.emitters().end()) return fail("there is no source of sound to measure the room with");
    RoomMap map;
    {
        const glm::dvec3 from = sounds.position(*source);
        const OpenedGeometry room = s.renderer->geometryFor(from);
        const RoomSize size = measureRoom(room, offSolids(room, from, sounds.listener().position));
        auto grid = gridIn(room, size, height, step);
        if (!grid) return std::unexpected(grid.error());
        map.grid = std::move(*grid);
    }
    std::vector<ListeningPosition> positions;
    for (const std::size_t point : map.grid.inside) positions.push_back({{}, map.grid.position(point)});
    auto report = surveyAt(positions, Keeps::figures);
    if (!report) return std::unexpected(report.error());
    map.report = std::move(*report);
    describeRoom(map.report);
    return map;
}

Result<RoomReport> SoundRenderer::surveyAt(const std::vector<ListeningPosition>& positions, Keeps keeps) {
    // More would need much memory, and save little time.
    constexpr std::size_t kTogether = 16;
    const auto start = Clock::now();
    Impl& s = *impl_;
    const SoundScene& sounds = s.renderer->scene();
    std::vector<glm::dvec3> listeners;
    for (const ListeningPosition& listener : positions) listeners.push_back(listener.position);
    const ListenerPose& pose = sounds.listener();
    const glm::dmat3 axes(pose.right, pose.up, pose.back);
    const bool levels = s.options.render.levels == AcousticOptions::Levels::x3d;
    RoomReport report;
    report.title = "Room acoustics";
    report.air = s.renderer->air();
    report.speech = s.options.speech;
    const std::size_t all = sounds.emitters().size() * positions.size();
    std::size_t done = 0;
    for (const SoundEmitter& emitter : sounds.emitters())
        for (std::size_t first = 0; first < positions.size(); first += kTogether) {
            s.measured = static_cast<double>(done) / static_cast<double>(all);
            if (s.options.progress && !s.options.progress(s.measured)) return fail("cancelled");
            const auto some =
                std::span<const glm::dvec3>(listeners).subspan(first, std::min(kTogether, positions.size() - first));
            done += some.size();
            auto sources = measureAt(emitter, some);
            if (!sources) return std::unexpected(sources.error());
            std::uint64_t rays = 0;
            for (std::size_t i = 0; i < sources->size(); ++i) {
                const ListenReport::Source& source = (*sources)[i];
                const ListeningPosition& listener = positions[first + i];
                rays = std::max(rays, source.trace.rays);
                RoomReport::Pair& pair = report.pairs.emplace_back();
                pair.source = source.source, pair.sourceAt = source.position;
                pair.listener = listener.name, pair.listenerAt = listener.position;
                pair.metrics = source.metrics;
                pair.speech = source.speech;
                pair.schroederHz = source.schroederHz;
                pair.escaped = source.trace.escaped;
                pair.bandsTraced = source.trace.bandsTraced;
                if (sounds.sound(emitter).directional(levels)) pair.sourceAim = emitter.aim();
                pair.listenerAxes = listener.axes.value_or(axes);
                pair.headRadius = listener.axes ? listener.headRadius : pose.headRadius();
                if (keeps == Keeps::figures) continue;
                pair.echogram = source.trace.echogram();
                if (source.directed) pair.directed = source.directed->echogram();
            }
            report.rays += rays;
            if (first == 0 && !sources->empty()) report.losses.push_back({emitter.name, sources->front().openings});
        }
    if (report.pairs.empty()) return fail("there is no source of sound to measure the room with");
    report.seconds = secondsSince(start);
    s.addDiagnostics(world().scene(), report.diagnostics);
    return report;
}

RoomResponses SoundRenderer::responses(const RoomReport& report, int sampleRate, double seconds) {
    Impl& s = *impl_;
    RoomResponses room;
    room.title = report.title;
    room.scene = s.options.render.document;
    room.channels = s.options.responses;
    room.ambisonicOrder = std::max(1, s.options.render.ambisonicOrder);
    room.sampleRate = sampleRate;
    room.air = report.air;
    if (!report.pairs.empty()) room.box = boxOf(s.renderer->geometryFor(report.pairs.front().sourceAt));
    for (const RoomReport::Pair& pair : report.pairs)
        room.pairs.push_back({pair.source,
                              pair.listener,
                              pair.sourceAt,
                              pair.listenerAt,
                              pair.sourceAim,
                              pair.listenerAxes,
                              {},
                              pair.headRadius});
    parallelFor(room.pairs.size(), [&](std::size_t i) {
        ImpulseResponseOptions options;
        options.channels = room.channels;
        options.ambisonicOrder = room.ambisonicOrder;
        const auto& head = s.options.render.hrtf;
        if (head && head->sampleRate() == sampleRate) options.hrtf = head;
        options.sampleRate = sampleRate;
        options.listenerRight = room.pairs[i].listenerAxes[0];
        options.listenerUp = room.pairs[i].listenerAxes[1];
        options.listenerBack = room.pairs[i].listenerAxes[2];
        options.speedOfSound = room.air.speedOfSound;
        options.headRadius = room.pairs[i].headRadius;
        options.seed = noiseSeed(s.options.trace.seed, room.pairs[i].sourceAt, room.pairs[i].listenerAt);
        options.seconds = seconds;
        room.pairs[i].response =
            makeImpulseResponse(report.pairs[i].directed.value_or(report.pairs[i].echogram), options);
    });
    return room;
}

ListenReport SoundRenderer::finish() {
    Impl& s = *impl_;
    if (s.options.limited) s.report.gain = normalise(s.report.sound);
    s.blockAt = 0;
    if (!s.renderer) return std::exchange(s.report, ListenReport());
    s.report.heard = s.renderer->engine().heard();
    s.report.streams = s.renderer->engine().streams();
    for (StreamedSound& stream : s.report.streams)
        stream.sound.samples.resize(s.report.sound.frames() * static_cast<std::size_t>(stream.sound.channels));
    s.report.diagnostics.append(s.renderer->diagnostics());
    s.addDiagnostics(world().scene(), s.report.diagnostics);
    if (s.hadSounds)
        reportUnheard(world().scene(), s.renderer->engine().unheard(), s.report.diagnostics);
    else
        reportNoSounds(world().scene(), s.report.diagnostics);
    if (const auto& materials = s.options.render.materials)
        for (const std::string& name : s.renderer->scene().unusedMaterials())
            s.report.diagnostics.warningAt(
                materials->rows().at(name).location,
                fmt::format("nothing in the scene is made of '{}': no AcousticProperties, Appearance or Material has "
                            "that DEF name, or it as \"acousticMaterial\" in its metadata",
                            name));
    return std::exchange(s.report, ListenReport());
}

}  // namespace rtsg
