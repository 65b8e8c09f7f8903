// Traces a room for one emitter and makes a response of it; in place or on a thread of its own.
#include "trace_worker.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <utility>

#include <rtsg/renderers/parallel_for.h>

#include "images/followed_edges.h"
#include "response/reach.h"
#include "response/sealed_result.h"
#include "sound_io/thread_priority.h"

namespace rtsg {
namespace {

using Clock = std::chrono::steady_clock;
/// The longest rest between two responses.
constexpr Clock::duration kLongestRest = std::chrono::seconds(1);
/// The share of a core that sound and tracing take together, and the bounds of the share of time that tracing takes.
constexpr double kBoth = 0.8, kMaxFraction = 0.5, kMinFraction = 0.2;

}  // namespace

double tracingFraction(double load) {
    return std::clamp(kBoth - load, kMinFraction, kMaxFraction);
}

std::chrono::steady_clock::duration restAfter(std::chrono::steady_clock::duration work, double fraction) {
    const std::chrono::duration<double> rest = work * (1 / fraction - 1);
    return rest < kLongestRest ? std::chrono::duration_cast<Clock::duration>(rest) : kLongestRest;
}

namespace {

/// The response for how the listener's head is turned.
void makeChannels(const TraceJob& job, TracedResponse& result) {
    const bool whole = !result.images || result.images->empty();
    const ImpulseResponse ir =
        makeImpulseResponse(whole ? *result.traced : without(*result.traced, *result.images), job.response);
    for (const std::vector<float>& channel : ir.channels)
        result.channels.push_back(Convolver::prepare(job.block, channel));
    result.frames = ir.frames();
}

/// The images that are left out of the response, to be rendered for themselves.
std::shared_ptr<const std::vector<FollowedImage>> followedBy(const TraceJob& job, const Echogram& traced) {
    if (job.followed == 0) return nullptr;
    std::vector<FollowedImage> images = followedImages(traced, job.source, job.listener, job.response.speedOfSound,
                                                       job.response.sampleRate, job.block, job.followed);
    addFollowedEdges(traced, job.source, job.listener, job.tracing, job.response.sampleRate, job.block,
                     job.followedEdges, images);
    return std::make_shared<const std::vector<FollowedImage>>(std::move(images));
}

/// The bin that begins with the first arrival.
std::ptrdiff_t onsetOf(const Echogram& echogram) {
    if (echogram.arrivals.empty()) return 0;
    return std::llround((echogram.arrivals.front().seconds - echogram.late.start) * echogram.late.binsPerSecond);
}

/// Energy of the bands of speech and music from a bin on.
double energyFrom(const EnergyHistogram& late, std::ptrdiff_t bin) {
    double sum = 0;
    for (std::ptrdiff_t k = std::max<std::ptrdiff_t>(0, bin); k < std::ssize(late.bins); ++k)
        for (std::size_t b = 2; b < 8; ++b) sum += late.bins[static_cast<std::size_t>(k)][b];
    return sum;
}

/// Whether late energy is as loud as before, for all of it and for the part later than 100 ms after the onset.
bool isAlike(const Echogram& fresh, const Echogram& kept) {
    // More than random errors with an eighth of the rays; and the metres that a source moves between traces.
    constexpr double kAlike = 1.6;
    constexpr std::ptrdiff_t kNearly = 8;
    const std::ptrdiff_t a = onsetOf(fresh), b = onsetOf(kept);
    if (std::abs(a - b) > kNearly || fresh.late.binsPerSecond != kept.late.binsPerSecond) return false;
    const auto later = static_cast<std::ptrdiff_t>(0.1 * fresh.late.binsPerSecond);
    for (const std::ptrdiff_t after : {std::ptrdiff_t{0}, later}) {
        const double is = energyFrom(fresh.late, a + after), was = energyFrom(kept.late, b + after);
        if (!(is > 0 && was > 0 && is < kAlike * was && was < kAlike * is)) return false;
    }
    return true;
}

/// The mean that goes on, from onset to onset, with one part of `parts` new.
EnergyHistogram goneOn(const Echogram& fresh, const Echogram& kept, std::uint64_t parts) {
    const double fraction = 1.0 / static_cast<double>(parts);
    const std::ptrdiff_t later = onsetOf(fresh) - onsetOf(kept), first = std::max<std::ptrdiff_t>(0, later);
    EnergyHistogram moved{fresh.late.binsPerSecond, {}, fresh.late.start};
    moved.bins.resize(static_cast<std::size_t>(first), Bands{});
    for (std::ptrdiff_t k = first - later; k < std::ssize(kept.late.bins); ++k)
        moved.bins.push_back(kept.late.bins[static_cast<std::size_t>(k)]);
    EnergyHistogram mean{fresh.late.binsPerSecond, {}, fresh.late.start};
    mean.accumulate(moved, 1 - fraction);
    mean.accumulate(fresh.late, fraction);
    return mean;
}

/// The rays of a job, or an eighth of them together with the kept result; `parts` is the number of eighths in the
/// result.
TraceResult traceFor(const TraceJob& job, const AcousticTracer& tracer, Echogram& echogram, std::uint64_t& parts) {
    TraceOptions options = job.tracing;
    const bool part = job.kept.traced || job.quick;
    if (part) options.rays = (options.rays + kTraceParts - 1) / kTraceParts;
    TraceResult traced = tracer.trace(job.source, job.listener, options);
    echogram = traced.echogram();
    parts = part ? 1 : kTraceParts;
    if (!job.kept.traced) return traced;
    if (traced.imageOrder == job.kept.imageOrder && traced.imageFraction == job.kept.imageFraction &&
        isAlike(echogram, *job.kept.traced)) {
        parts = std::min(job.kept.parts + 1, kTraceParts);
        echogram.late = goneOn(echogram, *job.kept.traced, parts);
    } else if (job.tracing.rays > traced.rays) {
        tracer.refine(traced, job.source, job.listener, options, job.tracing.rays - traced.rays);
        echogram = traced.echogram();
        parts = kTraceParts;
    }
    return traced;
}

}  // namespace

TracedResponse traceResponse(const TraceJob& job, const WorldGeometry& geometry) {
    if (job.traced) {
        TracedResponse turned;
        turned.emitter = job.emitter;
        turned.traced = job.traced;
        turned.setsOff = !job.images && job.followed > 0;
        turned.images = turned.setsOff ? followedBy(job, *job.traced) : job.images;
        turned.turned = true;
        makeChannels(job, turned);
        return turned;
    }
    const OpenedGeometry room(geometry, job.body);
    const ReachRecorder recorder(room, job.longest);
    const AcousticTracer tracer(recorder);
    Echogram echogram;
    std::uint64_t parts = 0;
    TraceResult traced = traceFor(job, tracer, echogram, parts);
    TracedResponse result;
    result.emitter = job.emitter;
    result.seal = sealOf(traced, room, job.source, job.listener);
    if (!traced.exits.empty()) result.openings = room.openings(job.source, traced.exits, traced.escaped);
    result.traced = std::make_shared<const Echogram>(std::move(echogram));
    result.kept = {result.traced, traced.imageOrder, traced.imageFraction, parts};
    result.images = followedBy(job, *result.traced);
    makeChannels(job, result);
    result.reached = recorder.reached();
    // The receiver's ball shrinks near a wall, so changes near the listener count as well.
    result.reached.extend(job.listener - traced.receiverRadius / 0.4);
    result.reached.extend(job.listener + traced.receiverRadius / 0.4);
    result.rays = traced.rays;
    result.imageCount = traced.arrivals.size();
    return result;
}

bool TraceWorker::idle() const {
    const std::lock_guard lock(mutex_);
    return worker_.idle() && !done_;
}

void TraceWorker::submit(TraceJob job) {
    worker_.start([this, job = std::move(job)] { run(job); });
}

std::optional<TracedResponse> TraceWorker::take() {
    const std::lock_guard lock(mutex_);
    return std::exchange(done_, std::nullopt);
}

void TraceWorker::run(const TraceJob& job) {
    const ThreadPriority usual(ThreadPriority::Kind::usual);  // whoever started it
    // If many sources move there is always something to trace, so some of the time is left to others.
    if (!worker_.pause(restsUntil_ - Clock::now())) return;
    const auto began = Clock::now();
    TracedResponse response;
    // One core is the sound's own.
    withThreads(std::max(1u, availableThreads() - 1), [&] {
        geometry_.follow(job.state->walls, *job.rays);
        response = traceResponse(job, geometry_);
    });
    const auto ended = Clock::now();
    restsUntil_ = ended + restAfter(ended - began, job.fraction);
    const std::lock_guard lock(mutex_);
    done_ = std::move(response);
}

}  // namespace rtsg
