// Hrtf: what a head and its ears do with sound of each direction: responses that were measured, from a SOFA file, or
// those of a rigid sphere.
//
// Between measured directions they are interpolated. Levels are such that sound from ahead keeps its own, in the mean
// of both ears; those of a sphere are the pressure on it beside what would be at its middle without it. Threading:
// const members from any number of threads. Source: AES69 (SOFA), SimpleFreeFieldHRIR; read by libmysofa, and not at
// all in builds without it (RTSG_SOFA=OFF). Duda and Martens, JASA 104 (1998), for the sphere.
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

class Hrtf {
  public:
    /// Errors: a file that cannot be read or holds something else.
    static Result<std::shared_ptr<const Hrtf>> load(const std::filesystem::path& file, int sampleRate);
    /// The ears left and right on a rigid sphere, of sound from far away: exact up to nine tenths of half the sample
    /// rate. Sound takes at most `kLongestRadius` seconds from its middle to an ear: one that is larger is heard as
    /// that. Those of the same arguments are computed once.
    static std::shared_ptr<const Hrtf> sphere(int sampleRate, double radius, double speedOfSound);
    static constexpr double kLongestRadius = 0.0008;
    ~Hrtf();
    Hrtf(const Hrtf&) = delete;
    Hrtf& operator=(const Hrtf&) = delete;

    int sampleRate() const;
    /// The responses of the left and the right ear, equally long, to an impulse that would reach the middle of the head
    /// at sample early(), from a unit direction in the listener's frame (x right, y up, z back).
    using Ears = std::array<std::vector<float>, 2>;
    Ears at(const glm::dvec3& direction) const;
    /// The same, in what has the room already, and so many samples earlier by ear: at most early().
    void at(const glm::dvec3& direction, Ears& ears, const std::array<double, 2>& earlier = {}) const;
    /// Samples by which the near ear may hear before that.
    std::size_t early() const;
    /// By how many samples a delay line may be late for ear 0 (left) or 1 in place of its response, which is then at()
    /// that much earlier and changes least with the direction.
    double smoothDelay(const glm::dvec3& direction, int ear) const;

    struct Impl;  // of those that make heads
    explicit Hrtf(std::unique_ptr<Impl> impl);

  private:
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
