// The interface of librtsg_ogre_module.so: a rasteriser with numbered meshes, textures, materials and things, by a
// library that only the module links.
//
// Invariant: this header does not mention OGRE, and the module does not link this library. All places are relative to
// an origin that the caller chooses near the eye, since a rasteriser computes in single precision. Spans are read
// during the call alone. The caller chooses the numbers; setting a number again replaces its content. Errors are
// sentences. Threading: driver() and run() on any thread; all else within run(), since the graphics context belongs to
// one thread of the process, which the module keeps for it.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <glm/glm.hpp>

namespace rtsg {

/// A vertex of triangles: the part that changes when a mesh deforms, and the part that does not.
struct RasterVertex {
    glm::vec3 position{0}, normal{0, 0, 1};
};
struct RasterLook {
    glm::vec3 coordinates{0};  // s and t, and how deep it is in fog (FogCoordinate)
    glm::vec4 color{1};
};
/// One of four corners of a line or point, which the rasteriser makes as wide as the picture wants it. All four know
/// both ends; a point has them in one place.
struct RasterStroke {
    glm::vec3 start{0}, end{0};
    glm::vec3 startNormal{0}, endNormal{0};
    glm::vec4 startColor{1}, endColor{1};
    glm::vec4 corner{0};  // 0 or 1: at which end; -1 or 1: on which side; how deep both ends are in fog
};

/// Either vertices, which have a place and a look each, or strokes.
struct RasterMesh {
    std::span<const RasterVertex> vertices;
    std::span<const RasterLook> looks;
    std::span<const RasterStroke> strokes;
    std::span<const std::uint32_t> indices;  // of triangles
    glm::vec3 lower{0}, upper{0};            // bounds
};

/// A picture with its coarser copies, each row by row from the bottom; all levels in one of the two forms.
struct RasterTexture {
    struct Level {
        int width = 0, height = 0;
        std::span<const std::uint32_t> bytes;  // R | G << 8 | B << 16 | A << 24
        std::span<const glm::vec4> floats;
    };
    std::vector<Level> levels;
    bool decoded = false;  // bytes are sRGB, and look-ups are to give linear light
};

enum class RasterWrap : std::uint8_t { repeat, mirror, clamp, border };
/// A texture as a material uses it.
struct RasterUse {
    std::uint32_t texture = 0;  // 0: none
    glm::vec3 s{1, 0, 0}, t{0, 1, 0};
    RasterWrap wrapS = RasterWrap::repeat, wrapT = RasterWrap::repeat;
    bool smooth = true, smoothFar = true, coarse = true, mixed = true;  // coarse: uses coarser copies; mixes two
    bool encodes = false;  // look-ups give light, display values are wanted
    glm::vec4 border{0};
    friend bool operator==(const RasterUse&, const RasterUse&) = default;
};

enum class RasterModel : std::uint8_t { unlit, phong, physical };
enum class RasterAlpha : std::uint8_t { blend, opaque, mask };
constexpr std::size_t kRasterUses = 8;  // in the order of TextureRole

struct RasterMaterial {
    RasterModel model = RasterModel::unlit;
    RasterAlpha alpha = RasterAlpha::blend;
    bool strokes = false;  // of lines or points
    bool points = false;
    bool clear = false;   // things behind it may show
    bool cutOut = false;  // transparent or opaque, hardly anything between: hides things behind it
    glm::vec3 base{0}, specular{0}, emissive{0};
    float ambient = 0, exponent = 0, opacity = 1, cutoff = .5f, metallic = 0, roughness = 1;
    glm::vec3 reflectivity{0};
    float normalScale = 1, occlusionStrength = 1;
    bool hatched = false, filled = true;
    std::int32_t hatchStyle = 0;
    glm::vec3 hatchColor{1};
    std::array<RasterUse, kRasterUses> uses;
    friend bool operator==(const RasterMaterial&, const RasterMaterial&) = default;
};

/// Something to draw.
struct RasterObject {
    std::uint32_t mesh = 0, material = 0;
    std::uint32_t surroundings = 0;  // among the surroundings
    std::uint16_t layer = 0;
    bool fronts = true, backs = true;  // which sides of triangles are drawn
    bool first = false;                // drawn before another thing in the same place: the backs of transparent shapes
    bool mirrored = false;             // its matrix is
    bool colored = false, alphaColored = false, fogged = false;  // the mesh has colours, with an alpha, and fog depths
    glm::vec4 stroke{1, 1, 1, 1};       // width in pixels; line type; least and most width of points
    glm::vec4 attenuation{1, 0, 0, 0};  // of points' widths, by their distance; w: 1 if there is any
    glm::mat3 linear{1.0f};
    glm::vec3 position{0};
};

/// The lights, fog and cuts at one place.
struct RasterSurroundings {
    std::vector<std::uint32_t> lights;
    std::vector<glm::vec4> cuts;  // planes: points with dot(xyz, place) + w < 0 are left out
    float fogType = 0;            // 0 none, 1 linear, 2 exponential
    float fogRange = 0, fogBegin = 0;
    glm::vec3 fogColor{0}, fogAlong{0};
};
struct RasterLight {
    float kind = 0;  // 0 directional, 1 point, 2 spot, 3 environment
    glm::vec3 color{1}, ambient{0}, position{0}, direction{0, 0, -1}, attenuation{1, 0, 0};
    float radius = 0, localFromWorld = 1, beamWidth = 0, cutOffAngle = 0;
    std::array<glm::vec3, 9> harmonics{};  // of an environment: what white matte surfaces show by their normals
};
struct RasterTables {
    std::vector<RasterLight> lights;
    std::vector<RasterSurroundings> surroundings;
};

/// A background: colours by the angle from the zenith, in even steps, and six pictures before them.
struct RasterSky {
    std::vector<glm::vec4> colors;  // premultiplied
    std::array<std::uint32_t, 6> sides{};
    glm::mat3 localFromWorld{1.0f};
    friend bool operator==(const RasterSky&, const RasterSky&) = default;
};

/// One layer of a picture.
struct RasterView {
    glm::mat4 viewFromWorld{1.0f}, projection{1.0f};
    glm::vec3 eye{0}, forward{0, 0, -1}, right{1, 0, 0}, up{0, 1, 0};  // right, up: for one ahead
    glm::vec3 acrossPixels{1, 0, 0}, upPixels{0, 1, 0};  // times an offset from the eye: pixels' heights for one ahead
    bool orthographic = false;
    float left = -1, rightEdge = 1, bottom = -1, top = 1;
    float pixelSpread = 0, pixelSize = 0;  // how wide a pixel is at distance 1, or of an orthographic eye
    float nearDistance = 0, farDistance = 0, visibilityLimit = 0;
    float sampleFraction = 1;  // of a pixel's width, for which one of its samples stands
    /// For an eye that is scaled unevenly: the matrix from the world to the space in which its pixels are square, where
    /// lighting is computed.
    glm::mat3 square{1.0f};
    bool uneven = false;
    bool headlight = false;
    std::uint16_t layer = 0;
    int x = 0, y = 0, width = 0, height = 0;  // of the picture, from the left and the top
    RasterSky sky;
};

class RasterModule {
  public:
    virtual ~RasterModule() = default;
    virtual std::string driver() const = 0;  // its name, for reports
    /// Runs `work` on the thread of the graphics context, and waits; calls of several threads wait for each other.
    /// Exceptions of `work` are thrown from here.
    virtual void run(const std::function<void()>& work) = 0;

    virtual void setMesh(std::uint32_t number, const RasterMesh& mesh) = 0;
    /// Only the places, and the looks if there are any, of as many vertices as the mesh has, and its bounds.
    virtual void bendMesh(std::uint32_t number, const RasterMesh& mesh) = 0;
    virtual void dropMesh(std::uint32_t number) = 0;
    virtual void setTexture(std::uint32_t number, const RasterTexture& texture) = 0;
    virtual void dropTexture(std::uint32_t number) = 0;
    virtual void setMaterial(std::uint32_t number, const RasterMaterial& material) = 0;
    virtual void dropMaterial(std::uint32_t number) = 0;
    /// Mesh and material must be there before the things that have them, and go after them.
    virtual void setItem(std::uint32_t number, const RasterObject& object) = 0;
    virtual void moveItem(std::uint32_t number, const glm::mat3& linear, const glm::vec3& position, bool mirrored) = 0;
    virtual void dropItem(std::uint32_t number) = 0;
    virtual void setTables(const RasterTables& tables) = 0;
    /// Draws the layers one over the other. `pixels`: width * height premultiplied display values, row by row from the
    /// top.
    virtual void draw(int width, int height, const std::vector<RasterView>& views, std::vector<glm::vec4>& pixels) = 0;
    /// The frontmost thing at the middle of each pixel of a layer, also if it is partly transparent: x is its number
    /// plus 1, or 0 for nothing; y its depth along the view, in metres. Things that are wholly transparent there do not
    /// count. Precondition: numbers are below kMaxNamed.
    virtual void drawNumbers(int width, int height, const RasterView& view, std::vector<glm::vec4>& pixels) = 0;
    static constexpr std::uint32_t kMaxNamed = (1u << 24) - 2;  // which a float holds exactly
    /// The first error since the last call; empty if there was none.
    virtual std::string problem() = 0;
};

/// Null, and why.
using OpenRaster = std::unique_ptr<RasterModule> (*)(std::string& problem);
/// The one symbol of the module: a function without arguments that returns an OpenRaster.
#define RTSG_OGRE_SYMBOL "rtsg_open_raster_3"

}  // namespace rtsg
