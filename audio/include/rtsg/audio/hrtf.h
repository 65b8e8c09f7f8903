// Hrtf: how a head and its ears change sound from each direction: measured responses from a SOFA file, or those of a
// rigid sphere.
//
// Responses are interpolated between measured directions. Levels are scaled so that sound from ahead keeps its level in
// the mean of both ears. Responses of a sphere are the pressure on it relative to the pressure at its middle without
// it. Threading: const members may be called from any number of threads. Source: AES69 (SOFA), SimpleFreeFieldHRIR,
// read by libmysofa; builds without it (RTSG_SOFA=OFF) cannot read such files. Duda and Martens, JASA 104 (1998), for
// the sphere.
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

/// The radius of the sphere that represents an unspecified head, metres.
inline constexpr double kHeadRadius = 0.0875;

class Hrtf {
  public:
    /// Errors: the file cannot be read or is not a SimpleFreeFieldHRIR.
    static Result<std::shared_ptr<const Hrtf>> load(const std::filesystem::path& file, int sampleRate);
    /// The left and right ear on a rigid sphere, for distant sound; accurate up to nine tenths of half the sample rate.
    /// Sound takes at most `kLongestRadius` seconds from the middle of the sphere to an ear; a larger sphere is treated
    /// as this size. Results for the same arguments are computed once.
    static std::shared_ptr<const Hrtf> sphere(int sampleRate, double radius, double speedOfSound);
    static constexpr double kLongestRadius = 0.0008;
    ~Hrtf();
    Hrtf(const Hrtf&) = delete;
    Hrtf& operator=(const Hrtf&) = delete;

    int sampleRate() const;
    /// The impulse responses of the left and the right ear, of equal length. The direction is a unit vector in the
    /// listener's frame (x right, y up, z back). The impulse would reach the middle of the head at sample early().
    using Ears = std::array<std::vector<float>, 2>;
    Ears at(const glm::dvec3& direction) const;
    /// The same into vectors that have the room already, advanced by a number of samples per ear, at most early().
    void at(const glm::dvec3& direction, Ears& ears, const std::array<double, 2>& earlier = {}) const;
    /// The number of samples by which the near ear may hear the sound before the middle of the head does.
    std::size_t early() const;
    /// The delay in samples of ear 0 (left) or 1 that a delay line may apply instead of the response. at() advanced by
    /// this much changes least with the direction.
    double smoothDelay(const glm::dvec3& direction, int ear) const;

    struct Impl;  // of the functions that make heads
    explicit Hrtf(std::unique_ptr<Impl> impl);

  private:
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
