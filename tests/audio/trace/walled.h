// Walls of one mesh, and what comes round their edges.
#pragma once

#include <cmath>
#include <complex>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <rtsg/audio/impulse_response.h>
#include "edges/diffraction_wedge.h"
#include "geometry/world_geometry.h"
#include "rays/acoustic_tracer.h"

namespace rtsg::test {

/// Walls of one mesh, in the world at once.
struct Walled {
    /// One copy for each transform. `solid`: faces have one side.
    Walled(const std::vector<glm::dvec3>& corners, const std::vector<std::uint32_t>& triangles, double absorption = 0,
           const std::vector<WorldFromLocal>& transforms = {WorldFromLocal(1.0)}, bool solid = true)
        : walls(world, {allBands(absorption), allBands(0), allBands(0)}) {
        auto mesh = std::make_shared<Mesh>();
        mesh->solid = solid;
        for (const glm::dvec3& p : corners) mesh->positions.push_back(Vec3f(p));
        const std::vector<int> numbers(triangles.begin(), triangles.end());
        mesh->triangles = Array<int>(std::span<const int>(numbers));
        mesh->triangleCount = static_cast<std::uint32_t>(triangles.size() / 3);
        for (const Vec3f& p : mesh->positions) mesh->bounds.extend(p);
        InstanceDelta delta;
        delta.geometries.push_back({NodeId{1}, mesh});
        for (const WorldFromLocal& m : transforms) {
            Instance instance;
            instance.id = {static_cast<std::uint32_t>(delta.added.size()), 0};
            instance.shape = NodeId{2};
            instance.geometry = NodeId{1};
            instance.worldFromLocal = m;
            delta.added.push_back(instance);
        }
        world.apply(delta);
        walls.apply(delta);
        geometry.follow(walls.freeze(), world);
    }

    std::vector<Arrival> arrivals(const glm::dvec3& source, const glm::dvec3& listener, int diffraction = 2) const {
        return traced(source, listener, diffraction).arrivals;
    }
    /// With almost no rays; `diffraction`: its order.
    TraceResult traced(const glm::dvec3& source, const glm::dvec3& listener, int diffraction = 2) const {
        TraceOptions options;
        options.rays = 2;
        options.imageOrder = 1;
        options.maxSeconds = .5;
        options.air.absorbs = false;
        options.diffractionOrder = diffraction;
        return AcousticTracer(geometry).trace(source, listener, options);
    }
    int edges() const {
        int count = 0;
        geometry.visitEdges([&](const WallEdge&) { ++count; });
        return count;
    }

    RayWorld world;
    Walls walls;
    WorldGeometry geometry;
};

/// The sound with its impulses: a channel's level at a tone relative to that of the source in the open, dB.
inline double heardAt(const TraceResult& traced, double hz, double distance, const ImpulseResponseOptions& options = {},
                      std::size_t channel = 0) {
    const ImpulseResponse response = makeImpulseResponse(traced.echogram(), options);
    std::complex<double> sum;
    for (std::size_t i = 0; i < response.frames(); ++i)
        sum += std::polar(static_cast<double>(response.channels[channel][i]),
                          -2 * M_PI * hz * static_cast<double>(i) / options.sampleRate);
    return 20 * std::log10(std::abs(sum) * distance);
}

inline glm::dvec3 about(double radius, double degrees, double z) {
    return {radius * std::cos(degrees * M_PI / 180), radius * std::sin(degrees * M_PI / 180), z};
}
inline Bands total(const std::vector<Arrival>& arrivals) {
    Bands sum{};
    for (const Arrival& arrival : arrivals)
        for (std::size_t b = 0; b < kBandCount; ++b) sum[b] += arrival.energy[b];
    return sum;
}

}  // namespace rtsg::test
