// Trail: records where the rays of a picture went, so that the next picture traces only tiles that may have changed.
//
// A tile stores boxes around the starts, hits and misses of its rays. Two states of the world differ in boxes around
// the changed instances, and in the balls and cones of changed lights. A tile is unchanged, bit for bit, if none of its
// rays can have come into such a box, and such a light shines on none of its surfaces. If something without bounds
// differs (the sun, the sky, a fog), or if rays take paths that are not recorded (paths, volumes, generated cubes),
// only a picture of exactly the same state is kept. Invariant: a picture with a trail equals the one without, unless it
// is to be refined. Threading: one picture at a time; its tiles on any threads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <rtsg/renderers/picture.h>

#include "tables/light_tables.h"

namespace rtsg::trace {

struct SurfacePacket;

/// The region that a light may reach, in ray space: a ball, or a cone of it.
struct LightReach {
    Vec3f apex{0}, direction{0, 0, -1};
    float radius = 0, halfAngle = 0;  // metres, radians; a half angle from pi / 2 on: the ball
    bool meets(const Bounds& surfaces) const;
};

/// Boxes (ray space) around all that a tile's rays have touched, or could have.
struct TileReach {
    Bounds eyes, first, later;  // the starts of primary rays, their hits, and the hits of all later rays
    Bounds lost, lostLater;     // directions of primary and of later rays that meet nothing
    /// After a packet was traced; bits by lane.
    void note(const RayPacket16& rays, std::uint32_t active, std::uint32_t hits, const SurfacePacket& surfaces,
              bool primary);
    /// Whether a ray of the tile, but for those to lights, may have come into a box.
    bool meets(const Bounds& box) const;
    bool isLitBy(const LightReach& light) const { return light.meets(first) || light.meets(later); }
};

/// In what two states differ.
struct Differences {
    struct Box {
        Bounds around;  // an instance, ray space
        bool castsShadow = true;
    };
    bool everywhere = false;
    std::vector<Box> boxes;          // before and now
    std::vector<LightReach> lights;  // that are other than they were, before and now
    bool none() const { return !everywhere && boxes.empty() && lights.empty(); }
};
Differences differences(const LightState& before, const RayView& worldBefore, const LightState& now,
                        const RayView& world);

/// Whether tiles are as they were. The differences must outlive it, and not be everywhere. Threading: const.
class Untouched {
  public:
    /// `lights`: of both pictures, but for the differences.
    Untouched(const Differences& differences, const std::vector<TraceLight>& lights);
    bool operator()(const TileReach& reach) const;
    /// Few enough to ask every tile about: some are taken together.
    const std::vector<Differences::Box>& boxes() const { return boxes_; }

  private:
    struct ShadowLight {
        TraceLight light;
        LightReach reach;
    };
    const Differences& differences_;
    std::vector<ShadowLight> lights_;
    std::vector<Differences::Box> boxes_;
    Bounds all_;
};

/// The numbers that a tile adds to RenderStats.
struct TileStats {
    double samples = 0, unreached = 0;  // sums over pixels; of `noise` the squares
    double noise = 0, mean = 0;
    double missing = 0, missingMaximum = 0;
};

class Trail {
  public:
    /// One of the pictures that the last one was laid together of: of each layer of a LayerSet one.
    struct Part {
        Camera camera;
        Picture picture;
        RenderStats stats;
        std::vector<TileReach> reaches;  // by tile; empty: not written down
        std::vector<TileStats> tiles;
    };

    /// Whether pictures of the same state go on adding samples, where they are of the kind that may.
    void refine(bool on) { refines_ = on; }
    bool refines() const;

    /// To be called before and after a picture of these; `complete` is false for one that was cancelled. A kept picture
    /// holds these states.
    void begin(std::shared_ptr<const LightState> light, std::shared_ptr<const WorldVersion> world,
               const RenderSettings& settings);
    void end(bool complete);

    /// The next part of this picture, in the order of drawing: the last picture's part there, to be replaced.
    Part& next(const Camera& camera);
    /// Whether the last picture shows the same in that part.
    bool isSame() const { return usable_ && differences_.none(); }
    /// The differences in that part, if tiles can be kept; null if they cannot.
    const Differences* kept() const { return usable_ && !differences_.everywhere ? &differences_ : nullptr; }

  private:
    std::shared_ptr<const LightState> light_;
    std::shared_ptr<const WorldVersion> world_;
    RenderSettings settings_;
    Differences differences_;
    std::vector<std::unique_ptr<Part>> parts_;
    std::size_t drawn_ = 0;
    bool refines_ = false;
    bool known_ = false;   // there is a last picture, with the same settings
    bool usable_ = false;  // and of the present part too, with the same camera
};

}  // namespace rtsg::trace
