// AcousticTracer: traces sound from a source to a listener; the result is an Echogram with confidence intervals.
//
// Every path is counted once, by exactly one of these estimators, so that the expectation does not depend on options:
// - only specular reflections (or none), up to the image order and down to the image share, also through walls: image
// sources, exact; images of second or higher order count as the mean over places in the ball
// - straight, but round one or two edges or a round body: the uniform theory of diffraction
// - the last reflection is diffuse, or mirrors after it lead to a known image of the listener: next-event estimation
// - all others (more mirrors, or paths to images that are not known): track length in a ball around the listener
// The ball gives the mean over the part of it that is seen from the listener. Rays end by Russian roulette, never by a
// threshold. Points on walls: see response/listening_positions.h. Energy that leaves the geometry counts as escaped.
// Below the Schroeder frequency rays are no model of a room: they have no phase. Listeners share the rays of a source:
// each result is unbiased, but their random errors are correlated. Threading: const; the results are the same for any
// number of threads.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/trace_result.h>

namespace rtsg {

class AcousticTracer {
  public:
    /// The geometry must outlive the tracer and must not change during trace().
    explicit AcousticTracer(const AcousticGeometry& geometry) : geometry_(&geometry) {}

    /// Positions in metres, world frame, less than 1000 km apart (else the result is empty). The source is a point of
    /// unit power that radiates alike in all directions.
    TraceResult trace(const glm::dvec3& source, const glm::dvec3& listener, const TraceOptions& options) const;
    /// One result for each listener, all from the same rays. Expectations are the same as those of separate traces.
    /// Intervals may be wider, because not every listener is tested from every wall (see rays/batch_tracer.h). All
    /// echograms are as long as that of the farthest listener.
    std::vector<TraceResult> trace(const glm::dvec3& source, std::span<const glm::dvec3> listeners,
                                   const TraceOptions& options) const;
    /// Adds rays to a result that `trace` gave for the same arguments: the batches grow by `rays` in all.
    void refine(TraceResult& result, const glm::dvec3& source, const glm::dvec3& listener, const TraceOptions& options,
                std::uint64_t rays) const;
    void refine(std::span<TraceResult> results, const glm::dvec3& source, std::span<const glm::dvec3> listeners,
                const TraceOptions& options, std::uint64_t rays) const;
    /// Adds rays until largestError() of the figures is at most `error` or there are `maxRays`, and returns that error.
    /// Calls `goOn` in between; false ends it early.
    double refineTo(TraceResult& result, const glm::dvec3& source, const glm::dvec3& listener,
                    const TraceOptions& options, double error, std::uint64_t maxRays,
                    const std::function<bool()>& goOn = {}) const;
    /// The same, until it holds for every listener.
    double refineTo(std::span<TraceResult> results, const glm::dvec3& source, std::span<const glm::dvec3> listeners,
                    const TraceOptions& options, double error, std::uint64_t maxRays,
                    const std::function<bool()>& goOn = {}) const;

  private:
    const AcousticGeometry* geometry_;
};

}  // namespace rtsg
