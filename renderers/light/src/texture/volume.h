// Volume: the content of an X3DVolumeDataNode: its voxels, and the optical properties that its render styles give them.
//
// Invariant: all fields are finite and in their ranges, so that a march needs no checks. Colours are display values.
// Threading: immutable once read; share freely. Source: ISO/IEC 19775-1 V4.0 clause 41; docs/volumes.md says what is
// done where the clause leaves something open.
#pragma once

#include <cstdint>
#include <memory>
#include <utility>
#include <variant>
#include <vector>

#include <rtsg/renderers/material.h>

#include "texture_store.h"
#include "voxels.h"

namespace rtsg::trace {

/// 41.4.7: what voxels of a value look like. Without a texture a voxel has its own colour, and an opacity of its alpha;
/// where it has none, of its value.
struct TransferFunction {
    std::vector<Vec4f> row;                // of voxels with one component: the texture's lowest row
    std::shared_ptr<const Texture> plane;  // null, as the next: none
    std::shared_ptr<const SpaceTexture> block;
    Vec4f of(const Vec4f& voxel, int components) const;
};

/// A step that changes colour and opacity, as 41.4 defines it for each node.
struct OpacityMap {
    TransferFunction map;
};
struct BoundaryEnhancement {
    float retained = .2f, boundary = .9f, exponent = 2;
};
struct Cartoon {
    int steps = 4;
    Vec4f orthogonal{1}, parallel{0, 0, 0, 1};
};
struct EdgeEnhancement {
    Vec3f color{0};
    float cosine = 1;  // of the angle to the view from which on the colour is mixed with this one
};
struct SilhouetteEnhancement {
    float retained = 1, boundary = 0, sharpness = .5f;
};
struct ToneMapped {
    Vec3f cool{0, 0, 1}, warm{1, 1, 0};
};
struct Shaded {
    bool lighting = false, shadows = false, hasMaterial = false;
    Material material;
};
struct Blended;
struct StyleStep {
    std::variant<OpacityMap, BoundaryEnhancement, Cartoon, EdgeEnhancement, SilhouetteEnhancement, ToneMapped, Shaded,
                 std::shared_ptr<const Blended>>
        what;
    std::shared_ptr<const VoxelGrid> normals;  // that the author gives; null: from the gradient
};

struct VolumeStyle {
    enum class Projection : std::uint8_t { none, largest, smallest, mean };
    bool drawn = true;
    Projection projection = Projection::none;
    float threshold = 0;
    std::vector<StyleStep> steps;
};

/// 41.4.1: a second volume in the same box.
struct Blended {
    enum class WeightFunction : std::uint8_t { constant, alpha1, alpha2, oneMinusAlpha1, oneMinusAlpha2, table };
    struct Weight {
        WeightFunction weight = WeightFunction::constant;
        float constant = .5f;
        std::shared_ptr<const Texture> table;
        float of(float alpha1, float alpha2) const;
    };
    std::shared_ptr<const VoxelGrid> voxels;
    VolumeStyle style;
    Weight first, second;
};

struct Volume {
    std::shared_ptr<const VoxelGrid> voxels;  // null: there is nothing to draw
    std::shared_ptr<const VoxelGrid> segments, gradients;
    Vec3f dimensions{1};
    std::vector<VolumeStyle> styles;  // by segment or, with surfaces, as those say; one at least
    std::vector<bool> segmentEnabled;
    bool isSurfaces = false;
    std::vector<std::pair<float, std::uint32_t>> surfaces;  // value and style, the lowest first
    float tolerance = 0;

    const VolumeStyle& styleOf(std::size_t index) const { return styles[std::min(index, styles.size() - 1)]; }
};

/// `before`: the last result, or null; unchanged voxels are taken from it.
std::shared_ptr<const Volume> readVolume(const Scene& scene, const Node& node, TextureStore& textures,
                                         const Volume* before, Diagnostics& diagnostics);

}  // namespace rtsg::trace
