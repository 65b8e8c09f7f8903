// VoxelGrid: the numbers of a three-dimensional texture as volumes look them up, and how they change from place to
// place.
//
// Invariant: places are shares of the box, 0 to 1; voxel i of n has its middle at (i + 1/2) / n; between middles it is
// trilinear, and constant beyond the outermost ones. Numbers are as stored, 0 to 1 for 8 bits: grey (L, L, L, 1), grey
// and alpha (L, L, L, A), (R, G, B, 1) or (R, G, B, A). Threading: immutable; share freely.
// Source: ISO/IEC 19775-1 V4.0 41.2.2 (layers in the XY plane, the first at the lowest z), 33.2.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <rtsg/renderers/space_texture.h>

namespace rtsg::trace {

class VoxelGrid {
  public:
    /// `texture` must have been read as data. Null, and why in `problem`: a cube.
    static std::shared_ptr<const VoxelGrid> of(std::shared_ptr<const SpaceTexture> texture, std::string& problem);
    /// Whether it was made of these very layers.
    bool isOf(const SpaceTexture& texture) const { return texture_->layers() == texture.layers(); }

    int components() const { return components_; }
    const glm::ivec3& size() const { return size_; }
    Vec4f at(const Vec3f& position) const;
    Vec4f nearest(const Vec3f& position) const;
    /// The mean of the colours, what counts as a voxel's value.
    float value(const Vec3f& position) const;
    /// How the value changes from one voxel to the next along each axis, by central differences.
    Vec3f gradient(const Vec3f& position) const;

  private:
    struct Cell;
    Cell cellOf(const Vec3f& position) const;
    template <class Number>
    Vec4f mix(const std::vector<Number>& from, const Cell& cell) const;
    template <class Number>
    float mixValues(const std::vector<Number>& from, const Cell& cell) const;
    std::size_t offset(int x, int y, int z) const {
        return ((static_cast<std::size_t>(z) * static_cast<std::size_t>(size_.y) + static_cast<std::size_t>(y)) *
                    static_cast<std::size_t>(size_.x) +
                static_cast<std::size_t>(x)) *
               static_cast<std::size_t>(components_);
    }
    std::shared_ptr<const SpaceTexture> texture_;
    glm::ivec3 size_{0};
    int components_ = 1;
    std::vector<float> numbers_;  // components_ each, x first; of pictures with more than 8 bits, or
    std::vector<std::uint8_t> bytes_;
};

}  // namespace rtsg::trace
