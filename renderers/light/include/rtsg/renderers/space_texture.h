// SpaceTexture: a picture with three coordinates: the six sides of a cube, addressed by a direction, or a block of
// layers, addressed by a position in it.
// Invariant: sides are seen from inside, upright, as those of a Background: front towards -z, right towards +x, top
// towards +y with its lower edge at the front. Layers are evenly spaced, the first in the middle of the lowest 1/n of
// r. Threading: immutable; share freely. Source: ISO/IEC 19775-1 V4.0 24.2.1 (panoramas), 33.2 (three-dimensional
// textures), 34.2 (cube maps). Unlike there, each side may have its own size, and need not be square.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include <rtsg/renderers/texture.h>

namespace rtsg {

/// Front, back, left, right, top, bottom.
enum class CubeSide : std::uint8_t { front, back, left, right, top, bottom };

/// The side through which a direction leaves a cube, and the position on it: (0, 0) is the side's lower left corner,
/// seen from inside. A zero direction leaves through the middle of the front.
struct CubePosition {
    CubeSide side = CubeSide::front;
    Vec2f st{0.5f};
};
CubePosition cubePosition(const Vec3f& direction);
/// The unit direction of a place on a side.
Vec3f cubeDirection(CubeSide side, Vec2f st);
/// The position of a unit direction in a panorama around the y axis: its middle is towards -z, t = 1 towards +y.
Vec2f panoramaPosition(const Vec3f& direction);

class SpaceTexture {
  public:
    using Layers = std::vector<std::shared_ptr<const Texture>>;

    /// Sides without a picture are transparent black.
    static SpaceTexture cube(std::array<std::shared_ptr<const Texture>, 6> sides);
    /// Makes it of one picture with all sides, whose shape gives the layout: twice as wide as high, a panorama around
    /// the y axis, its middle at the front; 3:2 the faces of a DDS file as readers lay them out (+x +y +z above -x -y
    /// -z, +z the front); 6:1 and 1:6 strips of +x -x +y -y +z -z; 4:3 and 3:4 unfolded cubes (crosses). Error: another
    /// shape.
    static Result<SpaceTexture> ofPicture(const std::shared_ptr<const Texture>& picture);
    /// Makes a block of layers, from r = 0 on. Error: no layers, or layers of several sizes.
    static Result<SpaceTexture> block(Layers layers);

    bool isCube() const { return kind_ != Kind::block; }
    bool hasAlpha() const;
    std::size_t bytes() const;
    const Layers& layers() const { return layers_; }  // or sides

    /// For a cube, the colour in direction (s, t, r), of any length; for a block, the colour at (s, t, r), each from 0
    /// to 1. `footprint` is as in Texture::sample, for a side or layer; blocks are filtered within their layers.
    Vec4f sample(const Vec3f& str, float footprint, const TextureAccess& access,
                 ColorSpace space = ColorSpace::linear) const;
    /// The colour at a place on a side of a cube, or (side 0) in a panorama. Precondition: isCube().
    Vec4f sampleSide(std::size_t side, Vec2f point, float footprint, const TextureAccess& access,
                     ColorSpace space = ColorSpace::linear) const;

  private:
    enum class Kind : std::uint8_t { cube, panorama, block };
    Kind kind_ = Kind::cube;
    Layers layers_;
};

}  // namespace rtsg
