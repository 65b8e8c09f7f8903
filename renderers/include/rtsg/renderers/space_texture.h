// SpaceTexture: a picture that is looked up by three coordinates: the six sides of a cube, by a direction, or a block
// of layers, by a place in it.
//
// Invariant: sides are seen from inside, upright, as those of a Background: front towards -z, right towards +x, top
// towards +y with its lower edge at the front. Layers are evenly spaced, the first in the middle of the lowest 1/n of
// r. Threading: immutable; share freely. Source: ISO/IEC 19775-1 V4.0 24.2.1 (panoramas), 33.2 (three-dimensional
// textures), 34.2 (cube maps). Differs in that every side may have a size of its own, and need not be square.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include <rtsg/renderers/texture.h>

namespace rtsg {

/// Front, back, left, right, top, bottom.
enum class CubeSide : std::uint8_t { front, back, left, right, top, bottom };

/// The side that a direction leaves a cube through, and where: (0, 0) the side's lower left corner, seen from inside. A
/// direction without length leaves through the front's middle.
struct CubePlace {
    CubeSide side = CubeSide::front;
    Vec2f st{0.5f};
};
CubePlace cubePlace(const Vec3f& direction);
/// The unit direction of a place on a side.
Vec3f cubeDirection(CubeSide side, Vec2f st);
/// The place of a unit direction in a panorama around the y axis: its middle towards -z, t = 1 towards +y.
Vec2f panoramaPlace(const Vec3f& direction);

class SpaceTexture {
  public:
    using Layers = std::vector<std::shared_ptr<const Texture>>;

    /// Sides without a picture show nothing: clear black.
    static SpaceTexture cube(std::array<std::shared_ptr<const Texture>, 6> sides);
    /// One picture that holds all sides, by its shape: twice as wide as high, a panorama around the y axis, its middle
    /// at the front; 3:2 the faces of a DDS file as readers lay them out (+x +y +z above -x -y -z, +z the front); 6:1
    /// and 1:6 strips of +x -x +y -y +z -z; 4:3 and 3:4 unfolded cubes (crosses). Error: another shape.
    static Result<SpaceTexture> ofPicture(const std::shared_ptr<const Texture>& picture);
    /// Layers from r = 0 on. Error: none, or layers of several sizes.
    static Result<SpaceTexture> block(Layers layers);

    bool isCube() const { return kind_ != Kind::block; }
    bool hasAlpha() const;
    std::size_t bytes() const;
    const Layers& layers() const { return layers_; }  // or sides

    /// Cube: towards (s, t, r), of any length. Block: at (s, t, r), each from 0 to 1. `footprint` as in
    /// Texture::sample, of a side or layer; blocks are filtered within their layers.
    Vec4f sample(const Vec3f& str, float footprint, const TextureAccess& access,
                 ColorSpace space = ColorSpace::linear) const;
    /// The same at a place of a side of a cube, or (side 0) of a panorama. Precondition: isCube().
    Vec4f sampleSide(std::size_t side, Vec2f place, float footprint, const TextureAccess& access,
                     ColorSpace space = ColorSpace::linear) const;

  private:
    enum class Kind : std::uint8_t { cube, panorama, block };
    Kind kind_ = Kind::cube;
    Layers layers_;
};

}  // namespace rtsg
