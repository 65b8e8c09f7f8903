// AcousticTracer: from a source, a listener and an AcousticGeometry to an Echogram with confidence intervals.
//
// Every path is counted once, by exactly one of these estimators, so the expectation does not depend on the options:
//   mirror reflections only, up to the image order and down to the image share (and direct sound), through walls or
//   not:                 image sources, exact; of what is mirrored twice or more the mean over the ball, at some places
//   straight, but round one edge or two, or a round body:   the uniform theory of diffraction
//   the last reflection is diffuse, or some mirrors after it lead to a known image of the listener:
//                                                           next-event estimation to the listener or its image, points
//   all others (more mirrors, or ways to images that are not known):   track length in a ball around the listener
// The ball yields the mean over what of it is seen from the listener. Rays end by Russian roulette, never by a
// threshold. Places on walls: see response/places.h. Energy that leaves the geometry is counted as escaped. Below its
// Schroeder frequency rays are no model of a room: phase is not kept. Several listeners share the rays of a source:
// each result is right, but chance does not move them independently. Threading: const; batches run in parallel,
// results are the same for any number of threads.
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
    /// The geometry must outlive the tracer and stay unchanged during trace().
    explicit AcousticTracer(const AcousticGeometry& geometry) : geometry_(&geometry) {}

    /// Positions in metres, world frame, less than 1000 km apart (else the result is empty). The source is a point of
    /// unit power that radiates alike in all directions.
    TraceResult trace(const glm::dvec3& source, const glm::dvec3& listener, const TraceOptions& options) const;
    /// A result for each listener, all from the same rays. Their expectations are those of a trace for each; intervals
    /// may be wider, as not every listener is looked for from every wall (see rays/batch_tracer.h). Echograms are as
    /// long as that of the farthest.
    std::vector<TraceResult> trace(const glm::dvec3& source, std::span<const glm::dvec3> listeners,
                                   const TraceOptions& options) const;
    /// More rays for a result that `trace` gave for the same arguments: the batches grow by `rays` in all.
    void refine(TraceResult& result, const glm::dvec3& source, const glm::dvec3& listener, const TraceOptions& options,
                std::uint64_t rays) const;
    void refine(std::span<TraceResult> results, const glm::dvec3& source, std::span<const glm::dvec3> listeners,
                const TraceOptions& options, std::uint64_t rays) const;
    /// Traces more rays until largestError() of the figures is at most `error` or there are `maxRays`, and returns that
    /// error. `goOn` is asked in between and may end it earlier.
    double refineTo(TraceResult& result, const glm::dvec3& source, const glm::dvec3& listener,
                    const TraceOptions& options, double error, std::uint64_t maxRays,
                    const std::function<bool()>& goOn = {}) const;
    /// The same until it is true of every listener.
    double refineTo(std::span<TraceResult> results, const glm::dvec3& source, std::span<const glm::dvec3> listeners,
                    const TraceOptions& options, double error, std::uint64_t maxRays,
                    const std::function<bool()>& goOn = {}) const;

  private:
    const AcousticGeometry* geometry_;
};

}  // namespace rtsg
