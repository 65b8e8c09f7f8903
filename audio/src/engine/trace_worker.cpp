// Traces a room for one emitter and makes a response of it; in place or on a thread of its own.
#include "trace_worker.h"

#include <algorithm>
#include <chrono>
#include <limits>
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
/// Of a core, for sound and tracing; of the time, for tracing.
constexpr double kBoth = 0.8, kMostShare = 0.5, kLeastShare = 0.2;

}  // namespace

double tracingShare(double load) {
    return std::clamp(kBoth - load, kLeastShare, kMostShare);
}

std::chrono::steady_clock::duration restAfter(std::chrono::steady_clock::duration work, double share) {
    const std::chrono::duration<double> rest = work * (1 / share - 1);
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

/// What is left out of the response, to be rendered for itself.
std::shared_ptr<const std::vector<FollowedImage>> followedBy(const TraceJob& job, const Echogram& traced) {
    if (job.followed == 0) return nullptr;
    std::vector<FollowedImage> images = followedImages(traced, job.source, job.listener, job.response.speedOfSound,
                                                       job.response.sampleRate, job.block, job.followed);
    addFollowedEdges(traced, job.source, job.listener, job.tracing, job.response.sampleRate, job.block,
                     job.followedEdges, images);
    return std::make_shared<const std::vector<FollowedImage>>(std::move(images));
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
    TraceResult traced = tracer.trace(job.source, job.listener, job.tracing);
    TracedResponse result;
    result.emitter = job.emitter;
    result.error = std::numeric_limits<double>::quiet_NaN();
    result.seal = sealOf(traced, room, job.source, job.listener);
    if (job.error > 0 && !result.seal)
        result.error = tracer.refineTo(traced, job.source, job.listener, job.tracing, job.error, job.maxRays);
    if (!traced.exits.empty()) result.openings = room.openings(job.source, traced.exits, traced.escaped);
    result.traced = std::make_shared<const Echogram>(traced.echogram());
    result.images = followedBy(job, *result.traced);
    makeChannels(job, result);
    result.reached = recorder.reached();
    // The receiver's ball shrinks before a wall: what comes near the listener counts as well.
    result.reached.extend(job.listener - traced.receiverRadius / 0.4);
    result.reached.extend(job.listener + traced.receiverRadius / 0.4);
    result.rays = traced.rays;
    result.imageCount = traced.arrivals.size();
    return result;
}

TraceWorker::TraceWorker() : thread_([this] { run(); }) {}

TraceWorker::~TraceWorker() {
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
    }
    wake_.notify_one();
    thread_.join();
}

bool TraceWorker::idle() const {
    const std::lock_guard lock(mutex_);
    return !busy_ && !done_;
}

void TraceWorker::submit(TraceJob job) {
    {
        const std::lock_guard lock(mutex_);
        job_ = std::move(job);
        busy_ = true;
    }
    wake_.notify_one();
}

std::optional<TracedResponse> TraceWorker::take() {
    const std::lock_guard lock(mutex_);
    return std::exchange(done_, std::nullopt);
}

void TraceWorker::run() {
    const ThreadPriority usual(ThreadPriority::Kind::usual);  // whoever started it
    // One core is the sound's own.
    const unsigned threads = std::max(1u, availableThreads() - 1);
    WorldGeometry geometry;
    Clock::duration rest{0};
    for (;;) {
        std::optional<TraceJob> job;
        {
            std::unique_lock lock(mutex_);
            // Where many sources move there is always something to trace: some of the time is for others.
            wake_.wait_for(lock, rest, [&] { return stop_; });
            wake_.wait(lock, [&] { return stop_ || job_; });
            if (stop_) return;
            job = std::exchange(job_, std::nullopt);
        }
        const auto began = Clock::now();
        TracedResponse response;
        withThreads(threads, [&] {
            geometry.follow(job->state->walls, *job->rays);
            response = traceResponse(*job, geometry);
        });
        rest = restAfter(Clock::now() - began, job->share);
        const std::lock_guard lock(mutex_);
        done_ = std::move(response);
        busy_ = false;
    }
}

}  // namespace rtsg
