// ListenerImages: mirror images of a listener that scattering walls are connected with.
//
// Sound that is scattered and then reflected specularly one to three times reaches a listener through one of its
// images. The most important images are found by specular reflection of rays from the listener. Each is identified by
// its planes, in every order in which a ray met them. So the tracer can tell whether a path belongs to one of these
// images, and each path is counted once, by its image or elsewhere. The choice depends only on hits of rays, never on
// numbers of planes.
// Threading: const once constructed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>

namespace rtsg::trace {

/// Planes that a path was mirrored in one after the other, as long as they are few.
class MirrorSequence {
  public:
    static constexpr int kMax = 3;

    void append(std::uint32_t plane) {
        const bool fits = !full() && plane < (1u << kBits) - 1;
        planes_ = fits ? planes_ << kBits | (plane + 1) : kTooLong;
    }
    bool full() const { return (planes_ >> (kBits * (kMax - 1))) != 0; }
    std::uint64_t number() const { return planes_; }
    friend bool operator==(const MirrorSequence&, const MirrorSequence&) = default;

  private:
    static constexpr unsigned kBits = 21;
    static constexpr std::uint64_t kTooLong = std::numeric_limits<std::uint64_t>::max();
    std::uint64_t planes_ = 0;
};

class ListenerImages {
  public:
    struct Image {
        glm::dvec3 position{0};
        double fraction = 1;  // of energy that the mirrors of its ways leave at most, in any band
    };
    static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

    ListenerImages() = default;
    /// At most `most` images of at most `maxOrder` mirrors; none where there are no planes to mirror in.
    ListenerImages(const AcousticGeometry& geometry, const glm::dvec3& listener, int maxOrder, std::size_t maximum);

    const std::vector<Image>& all() const { return images_; }
    /// The image that leads to the listener by these planes, in the order in which sound meets them; kNone: none of
    /// all().
    std::uint32_t of(const MirrorSequence& planes) const {
        if (slots_.empty()) return kNone;
        for (std::size_t at = hash(planes);; ++at) {
            const Slot& slot = slots_[at & (slots_.size() - 1)];
            if (slot.image == kNone || slot.planes == planes) return slot.image;
        }
    }

  private:
    struct Slot {
        MirrorSequence planes;
        std::uint32_t image = kNone;
    };
    static std::size_t hash(const MirrorSequence& planes) {
        return static_cast<std::size_t>((planes.number() * 0x9E3779B97F4A7C15ull) >> 32);
    }
    void remember(const MirrorSequence& planes, std::uint32_t image);

    std::vector<Image> images_;
    std::vector<Slot> slots_;  // a power of two of them, at most half used
};

}  // namespace rtsg::trace
