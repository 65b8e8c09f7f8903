// Traces responses away from the thread that renders sound: the input is handed over as a whole, and the result is
// ready for convolution.
//
// Threading: traceResponse() is a pure function over a const geometry. TraceWorker has a thread of its own, with a
// geometry of its own that follows the states it is handed; submit() and take() from one other thread.
#pragma once

#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/echogram.h>
#include <rtsg/audio/impulse_response.h>
#include <rtsg/core/worker.h>

#include "geometry/world_geometry.h"
#include "images/followed_images.h"
#include "rays/acoustic_tracer.h"
#include "scene/acoustic_tables.h"
#include "signal/convolver.h"

namespace rtsg {

/// A trace whose late energy goes on as a mean takes one part in so many of the rays: so many in a row have all of
/// them.
constexpr std::uint64_t kTraceParts = 8;

/// The last trace of an emitter, as far as its energy goes on to count.
struct KeptEnergy {
    std::shared_ptr<const Echogram> traced;  // null: nothing does
    // The order of the images among its arrivals: their energy is not in the late part.
    int imageOrder = 0;
    double imageFraction = 0;
    std::uint64_t parts = 0;  // eighths of the rays of a trace that it is the mean of, 8 at most
};

struct TraceJob {
    InstanceId emitter;
    glm::dvec3 source{0}, listener{0};
    std::vector<std::uint32_t> body;  // slots that are not there
    TraceOptions tracing;
    /// Late energy is the mean of this and of an eighth of the rays, unless they tell of another room.
    KeptEnergy kept;
    bool quick = false;  // others wait for their first response: an eighth of the rays has to do for now
    double longest = 0;  // metres that sound goes within a response
    ImpulseResponseOptions response;
    std::size_t block = 256;
    /// At most this many images are left out of the response, to be rendered separately.
    std::size_t followed = 0;
    std::size_t followedEdges = 0;  // and so many waves by way of edges
    /// The earlier trace, if only the listener's head has turned since: then nothing is traced.
    std::shared_ptr<const Echogram> traced;
    std::shared_ptr<const std::vector<FollowedImage>> images;  // that were left out then; null: to be chosen
    // The members below are for the worker alone.
    std::shared_ptr<const AcousticState> state;
    std::shared_ptr<const RayView> rays;
    double fraction = 0.5;  // of the time for which it traces; the rest is for others
};

/// The share of the time that tracing may take beside sound that takes `load` of a core: half of it, less where both
/// would come to more than a core takes without haste, and always some.
double tracingFraction(double load);
/// How long to rest after such work, so that it comes to the share; never long.
std::chrono::steady_clock::duration restAfter(std::chrono::steady_clock::duration work, double fraction);

struct TracedResponse {
    InstanceId emitter;
    std::vector<Convolver::Response> channels;
    std::size_t frames = 0;
    std::shared_ptr<const Echogram> traced;
    KeptEnergy kept;  // for the next one
    std::shared_ptr<const std::vector<FollowedImage>> images;
    bool setsOff = false;  // the job's images are chosen, as its source begins to move
    bool turned = false;   // it is the job's: all below says nothing
    AcousticBox reached;   // by its paths
    std::uint64_t rays = 0;
    std::size_t imageCount = 0;
    std::optional<Seal> seal;  // nothing arrived, and why
    RoomOpenings openings;     // if job.tracing asked for exits
};

TracedResponse traceResponse(const TraceJob& job, const WorldGeometry& geometry);

class TraceWorker {
  public:
    bool idle() const;
    /// Precondition: idle().
    void submit(TraceJob job);
    /// The response that was finished since the last call.
    std::optional<TracedResponse> take();
    /// What a trace has ended by, such as too little memory.
    Result<> failure() const { return worker_.failure("tracing sound ended"); }

  private:
    void run(const TraceJob& job);

    mutable std::mutex mutex_;
    std::optional<TracedResponse> done_;
    // For the thread alone.
    WorldGeometry geometry_;
    std::chrono::steady_clock::time_point restsUntil_{};
    Worker worker_{"rtsg trace"};  // last: its jobs use the others
};

}  // namespace rtsg
