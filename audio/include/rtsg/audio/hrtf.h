// Hrtf: what a head and its ears do with sound of each direction: responses that were measured, from a SOFA file.
//
// Between measured directions they are interpolated. Levels are such that sound from ahead keeps its own, in the mean
// of both ears. Threading: const members from any number of threads. Source: AES69 (SOFA), SimpleFreeFieldHRIR; read by
// libmysofa, and not at all in builds without it (RTSG_SOFA=OFF).
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
    ~Hrtf();
    Hrtf(const Hrtf&) = delete;
    Hrtf& operator=(const Hrtf&) = delete;

    int sampleRate() const;
    /// What the left and the right ear hear of an impulse that would be at sample early() at the middle of the head,
    /// from a unit direction in the listener's frame (x right, y up, z back). Both of the same length.
    using Ears = std::array<std::vector<float>, 2>;
    Ears at(const glm::dvec3& direction) const;
    /// The same, in what has the room already, and so many samples earlier by ear: at most early().
    void at(const glm::dvec3& direction, Ears& ears, const std::array<double, 2>& earlier = {}) const;
    /// Samples by which the near ear may hear before that.
    std::size_t early() const;

  private:
    struct Impl;
    explicit Hrtf(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
