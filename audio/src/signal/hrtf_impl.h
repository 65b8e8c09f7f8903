// The interface behind an Hrtf: responses by direction, measured or computed.
//
// Threading: const members from any number of threads.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include <rtsg/audio/hrtf.h>

#include "sphere_ear.h"

namespace rtsg {

struct Hrtf::Impl {
    Impl() = default;
    Impl(const Impl&) = delete;
    Impl& operator=(const Impl&) = delete;
    virtual ~Impl() = default;
    /// Responses for a direction, left and then right in `length` samples of `room` each or elsewhere, and by how many
    /// samples they come late.
    virtual std::array<double, 2> raw(const glm::dvec3& direction, float* room, const float*& responses) const = 0;
    /// The delay in samples at an ear relative to the middle of the sphere that models delays.
    double sphereDelay(const glm::dvec3& direction, int ear) const {
        return sphereEarDelay(direction.x, ear, sphereSeconds, 1) * rate;
    }

    int rate = 48000;
    std::size_t length = 0;  // of a response
    double lead = 0;         // samples until sound from ahead begins in them
    std::size_t early = 0;
    double sphereSeconds = 0;  // in which sound passes its radius
    double lineDelay = 0;      // samples; of a direction from which an ear hears as the middle of the sphere does
};

/// How many spheres the calling thread has computed so far.
std::uint64_t spheresComputedHere();

}  // namespace rtsg
