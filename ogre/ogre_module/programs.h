// The GLSL programs that draw things and backgrounds: X3D's lighting model, for each pixel.
//
// One source with defines for each kind of material. Source: ISO/IEC 19775-1 V4.0 17.2.2 (lighting), 24.4.2 (fog).
// Threading: re-entrant.
#pragma once

#include <string>

#include "raster/raster_module.h"

namespace rtsg {

/// The GLSL names of the textures, in the order of RasterMaterial::uses.
const char* const kUseNames[kRasterUses] = {"baseTexture",    "emissiveTexture",  "specularTexture",
                                            "normalTexture",  "roughnessTexture", "occlusionTexture",
                                            "ambientTexture", "shininessTexture"};

/// The properties of a material by which its programs are chosen.
struct ProgramKey {
    RasterModel model = RasterModel::unlit;
    bool strokes = false, points = false, hatched = false, background = false;
    bool numbers = false;  // in place of colours: RasterModule::drawNumbers()
    unsigned uses = 0;     // of RasterMaterial::uses, a bit each
    explicit ProgramKey(const RasterMaterial& material);
    ProgramKey() = default;
    /// One word for each, as a name.
    std::string name() const;
};

std::string vertexProgram(const ProgramKey& key);
std::string fragmentProgram(const ProgramKey& key);

/// The size of the tables' texture.
constexpr int kTableWidth = 64, kTableHeight = 4096;

}  // namespace rtsg
