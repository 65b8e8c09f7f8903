// Wavefront: a tile's paths in scenes whose surfaces are nearly all plain and whose only lights are emitting triangles
// and the sky. Paths run in stages, each of which waits until it has eight or sixteen lanes of a kind.
//
// The estimator and its random numbers are those of path.cpp, which handles all surfaces that are not plain. Pictures
// differ from those of path.cpp by roundings and by the order of sums. Threading: one of a tile. Source: Laine, Karras
// & Aila 2013 (wavefronts).
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "lane_queue.h"
#include "surface/plain_surfaces.h"

namespace rtsg::trace {

/// Whether this is the way for the paths of a scene's picture.
bool goesInWavefronts(const TraceScene& scene, const Camera& camera);

class Wavefront {
  public:
    /// Treats the lanes of an intersected packet that are not plain; `onward` gets the rays that follow.
    using Others =
        std::function<void(RayPacket16& rays, std::uint32_t lanes, PathTask* tasks, std::vector<PathTask>& onward)>;
    /// `roulette`, `bouncesFindSky`: as path.cpp has them.
    Wavefront(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
              std::span<TileResult> groups, float roulette, bool bouncesFindSky, Others others);
    ~Wavefront();
    Wavefront(const Wavefront&) = delete;
    Wavefront& operator=(const Wavefront&) = delete;

    void run();

  private:
    struct Hits;  // eight of a kind
    void start(std::size_t group, int block, int sample);
    void drain();
    void traceAll();
    void traceLarge(std::size_t row, std::uint32_t lanes);
    void trace(const LaneQueue& from, std::size_t row, std::uint32_t lanes);
    /// The nearest distance of hits, for rays that leave a surface or the eye.
    float nearest() const;
    float farthest() const;
    void sort(const LaneQueue& from, std::size_t row, RayPacket16& rays, std::uint32_t hits, const PacketHits16& met,
              const std::int32_t* kinds, const PacketHits16* faces);
    static std::uint32_t lanesOfOthers(const LaneQueue& from, std::size_t row);
    void miss(const LaneQueue& from, std::size_t row, const RayPacket16& rays, std::uint32_t lanes);
    void shine(const LaneQueue& from, std::size_t row, const RayPacket16& rays, const PacketHits16& hits,
               std::uint32_t lanes);
    static void keep(LaneQueue& to, const LaneQueue& from, std::size_t row, const RayPacket16& rays,
                     const PacketHits16& hits, std::uint32_t lanes);
    void handOver(const LaneQueue& from, std::size_t row, RayPacket16& rays, std::uint32_t lanes);
    void push(const PathTask& task);
    void shadeMatte(LaneQueue& from);
    void shadeGlossy();
    template <class Shown>
    void lookForLight(const Hits& hits, const PlainSurfaces::Surfaces& s, const Shown& shown);
    void follow(const Hits& hits, const PlainSurfaces::Surfaces& s, const struct Scattered8& on);
    void askLarge();
    void askWhetherFree(LaneQueue& asked);
    void askWhatIsFirst();
    void addLight(const LaneQueue& from, std::size_t row, std::uint32_t lanes);
    void add(const simd::V8& light, simd::F8 alpha, const std::uint32_t* pixels, std::uint32_t lanes);
    Vec4f& sumOf(std::uint32_t pixel) const {
        return groups_[(pixel & 0xFFFFu) / kTilePixels].sum[pixel % kTilePixels];
    }

    const TraceScene& scene_;
    const Camera& camera_;
    const RenderSettings& settings_;
    const PlainSurfaces& plain_;
    const int x0_, y0_;
    std::span<TileResult> groups_;
    const float roulette_;
    const bool bouncesFindSky_;
    const std::uint32_t callsOfLights_;  // of random numbers, at each surface before those of the way on
    const Others others_;
    LaneQueue now_, next_, open_;                 // rays; of now_ those that large triangles leave open
    std::vector<PathTask> nowOther_, nextOther_;  // of those that bring more along, all of it
    std::vector<PathTask> onward_;
    bool primary_ = true;                    // all of now_
    LaneQueue matte_, glossy_;               // hits
    LaneQueue flat_;                         // of those of LargeHits::faces that are kFlat
    LaneQueue asked_, askedOpen_, blocked_;  // rays towards emitters; those of them that large triangles leave open,
                                             // and those that have something in their way
};

}  // namespace rtsg::trace
