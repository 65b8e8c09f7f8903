// Materials and textures of the graphics system.
//
// Threading: the thread of the graphics context.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>

#include <OgreMaterial.h>
#include <OgreTexture.h>
#include <glm/glm.hpp>

#include "programs.h"
#include "raster/raster_module.h"

namespace rtsg {

/// The numbers that a thing's programs read besides its material's, each of four floats: of the thing, and of the view
/// that is drawn now.
enum class DrawNumber : std::uint8_t {
    item,
    stroke,
    attenuation,
    named,        // x: its number and 1
    eyePosition,  // w: 1 if it is orthographic
    eyeForward,
    eyeRight,  // w: whether it has a headlight
    eyeUp,
    eyeLimits,  // near, far, visibility
    eyePixels,  // spread, size
    eyeMore,    // share of a pixel
    eyeEdges,
    pictureSize,
    squareX,  // columns of RasterView::square; w: 1 if it is uneven
    squareY,
    squareZ,
    count
};
using ViewNumbers = std::array<Ogre::Vector4, static_cast<std::size_t>(DrawNumber::count)>;

inline Ogre::Vector4 vector(const glm::vec3& v, float w) {
    return {v.x, v.y, v.z, w};
}

/// The textures and programs that materials share.
class GpuLibrary {
  public:
    /// Names of the objects that it makes begin with `prefix`.
    explicit GpuLibrary(std::string prefix) : prefix_(std::move(prefix)) {}
    GpuLibrary(const GpuLibrary&) = delete;
    GpuLibrary& operator=(const GpuLibrary&) = delete;
    ~GpuLibrary();

    void setTexture(std::uint32_t number, const RasterTexture& texture);
    void dropTexture(std::uint32_t number);
    /// A small white one for 0 and for unknown numbers.
    const Ogre::TexturePtr& texture(std::uint32_t number);

    /// Fills the table of numbers that programs read. To be called before the first material is made. False: there are
    /// too many.
    bool setTable(std::vector<glm::vec4> texels);
    Ogre::MaterialPtr makeMaterial(const std::string& name, const RasterMaterial& material);
    /// Lets it show numbers in place of colours where a viewport asks for the scheme kNumbers.
    void addNumbers(const Ogre::MaterialPtr& material, const RasterMaterial& from);
    static constexpr const char* kNumbers = "numbers";
    Ogre::MaterialPtr makeBackground(const std::string& name, const RasterSky& sky);

  private:
    std::string unique(const char* what);
    void usePrograms(Ogre::Pass& pass, const ProgramKey& key);
    void setNumbers(Ogre::Pass& pass, const RasterMaterial& material);
    void setUp(Ogre::Pass& pass, const RasterMaterial& material, bool numbers);
    std::string prefix_;
    std::uint64_t created_ = 0;
    std::map<std::uint32_t, Ogre::TexturePtr> textures_;
    Ogre::TexturePtr white_, table_;
};

}  // namespace rtsg
