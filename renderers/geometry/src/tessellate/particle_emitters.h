// ParticleEmitter: the initial position and velocity of a particle.
//
// Invariant: uniform by direction, length, area or volume; a function of the given random numbers. Threading: const
// members re-entrant. Source: ISO/IEC 19775-1 V4.0 40.3.1, 40.4.2 to 40.4.8. The standard leaves open how a face is
// chosen and what `internal` FALSE means; here a face is chosen by its area, and FALSE means the volume's surface.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include <rtsg/core/emission.h>
#include <rtsg/renderers/mesh.h>

namespace rtsg {
class Node;
class Scene;
}  // namespace rtsg

namespace rtsg::detail {

/// Uniform among the directions whose cosine with `axis` is `least` at least; all directions if it has no length.
Vec3d directionInCone(const Vec3d& axis, double minimum, KeyedNumbers& numbers);

class ParticleEmitter {
  public:
    ParticleEmitter(const Scene& scene, const Node& emitter,
                    const std::function<std::shared_ptr<const Mesh>(NodeId)>& meshOf, Mesh& problems);
    /// False: it has no line, surface or volume.
    bool canEmit() const { return kind_ != Kind::nothing; }
    /// The number of tests of points against triangles for one particle, on average.
    double tests() const;
    void emit(const EmissionSpan& span, KeyedNumbers& numbers, Vec3d& position, Vec3d& velocity) const;

  private:
    enum class Kind { nothing, point, cone, explosion, polyline, surface, volume, skin };
    struct Segment {
        Vec3d from, to;
        double until;  // the length of all up to its end
    };
    void readPolyline(const Scene& scene, const Node& emitter, Mesh& problems);
    void readVolume(const Scene& scene, const Node& emitter, Mesh& problems);
    void measure();
    Vec3d onPolyline(KeyedNumbers& numbers) const;
    Vec3d onSurface(KeyedNumbers& numbers, Vec3d* normal) const;
    Vec3d inVolume(KeyedNumbers& numbers) const;
    bool isInside(const Vec3d& point) const;

    Kind kind_ = Kind::nothing;
    std::vector<Segment> segments_;
    std::shared_ptr<const Mesh> mesh_;
    std::vector<double> areas_;  // of all triangles up to each
};

}  // namespace rtsg::detail
