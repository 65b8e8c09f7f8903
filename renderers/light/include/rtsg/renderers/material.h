// Material and Light: X3D's Appearance and light nodes as plain numbers for shading, so that no node is read for a hit.
//
// Reflection and refraction, which X3D's Material cannot say, are read from its metadata, so that other browsers still
// show the file: a MetadataSet named "RTSG" (or the entry alone, with reference "RTSG") holding MetadataFloats
//   "reflectivity"     r or r g b: the share of light that is mirrored, whatever the angle
//   "refractiveIndex"  n > 0: a smooth dielectric; the share mirrored follows Fresnel's equations, what enters is bent;
//                      `transparency` is the share of it that passes, the rest meets the material's own colours
//   "absorption"       a or r g b, 1/m: Beer's law inside; of a surface that bends nothing, what one metre would take
//   "priority"         p >= 0, by default 0: of bodies with a refractive index that overlap, the one with the highest
//   is
//                      there, of these the one with the smallest box
// PhysicalMaterial mirrors by itself: Schlick's Fresnel term of baseColor and metallic times (1 - roughness)^2.
// Colours are as their fields have them, and beside that in linear light. Threading: immutable once read. Source:
// ISO/IEC 19775-1 V4.0 12.4, 17.2.2, 17.4, 18.2; glTF 2.0, 3.9 and, as shading.h says, appendix B.
#pragma once

#include <array>
#include <limits>
#include <memory>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/value.h>
#include <rtsg/renderers/instance_delta.h>
#include <rtsg/renderers/shading.h>
#include <rtsg/renderers/space_texture.h>
#include <rtsg/renderers/texture.h>

namespace rtsg {

class Node;
class Scene;
class TextureStore;
namespace trace {
class Environment;
}

enum class ShadingModel : std::uint8_t { unlit, phong, physical };
enum class AlphaMode : std::uint8_t { automatic, opaque, mask, blend };

/// A GeneratedCubeMapTexture (34.4.2), whose sides are drawn anew for each picture, from the middle of its shape and
/// without that shape. Or a RenderedTexture (X3D 4.1), which is one picture through the picture's own eye, without the
/// shapes that show it.
struct GeneratedCube {
    NodeId node;
    int size = 128;  // pixels along a side; width of a RenderedTexture
    int height = 0;  // of a RenderedTexture
    bool isFlat() const { return height > 0; }
};

/// A texture as a material uses it: one of the three kinds, or none.
struct TextureUse {
    std::shared_ptr<const Texture> texture;
    std::shared_ptr<const SpaceTexture> space;
    std::shared_ptr<const GeneratedCube> generated;
    TextureAccess access;
    TextureMatrix matrix;
    std::shared_ptr<const glm::mat4> matrix3;  // of a transform of three coordinates; replaces `matrix`
    String mapping;                            // of TexCoords::mapping; empty: the first channel
    bool namesTransform = false;               // there is a texture transform of that name
    explicit operator bool() const { return texture || space || generated; }
    /// Whether its pixels, or the border around them, have an alpha below 1.
    bool hasAlpha() const {
        const auto shows = [&](TextureWrap wrap) { return wrap == TextureWrap::border && access.border.a < 1; };
        if (texture) return texture->hasAlpha() || shows(access.wrapS) || shows(access.wrapT);
        return space && (space->hasAlpha() || shows(access.wrapS) || shows(access.wrapT) || shows(access.wrapR));
    }
};

/// One texture of a MultiTexture (18.4.3). It is combined with the result of the stage before, or in the first stage
/// with the material's colour. It uses the texture coordinates of the same number, or the last ones if there are fewer.
struct TextureStage {
    enum class Mode : std::uint8_t {
        modulate,
        replace,  // and SELECTARG1
        modulate2x,
        modulate4x,
        add,
        addSigned,
        addSigned2x,
        subtract,
        addSmooth,
        blendDiffuseAlpha,
        blendTextureAlpha,
        blendFactorAlpha,
        blendCurrentAlpha,
        modulateAlphaAddColor,
        modulateInvAlphaAddColor,
        modulateInvColorAddAlpha,
        off,
        selectArg2,
        dotProduct3,
    };
    enum class Source : std::uint8_t { previous, diffuse, specular, factor };
    enum class Function : std::uint8_t { none, complement, alphaReplicate };
    TextureUse use;
    Mode color = Mode::modulate, alpha = Mode::modulate;
    Source source = Source::previous;  // the colour that the texture is combined with
    Function function = Function::none;
};

/// The result of a stage. `texel` is the texture's colour, `with` the colour that the stage's source names;
/// `diffuseAlpha` and `factorAlpha` are the material's opacity and the MultiTexture's alpha.
Vec4f combine(const TextureStage& stage, const Vec4f& texel, const Vec4f& with, const Vec4f& current,
              float diffuseAlpha, float factorAlpha);

/// The textures a material may have; `base` is diffuse, base or (unlit) emissive.
enum class TextureRole : std::uint8_t {
    base,
    emissive,
    specular,
    normal,
    metallicRoughness,
    occlusion,
    ambient,
    shininess
};
constexpr std::size_t kTextureRoles = 8;

/// FillProperties (12.4.3): lines over a surface, in pixels of the picture, 8 apart and one wide.
struct Hatching {
    static constexpr float kApart = 8;
    bool present = false;
    bool filled = true;  // else the surface between the lines is invisible
    Vec3f color{1};      // as in the field
    std::int32_t style =
        0;  // 1 horizontal, 2 vertical, 3 rising, 4 falling, 5 both of 1 and 2, 6 both of 3 and 4; 0 none
    /// Whether a line is at this place of the picture, in pixels to the right and up.
    bool isLine(const Vec2f& pixel) const;
};

struct Material {
    ShadingModel model = ShadingModel::unlit;
    AlphaMode alphaMode = AlphaMode::automatic;
    Vec3f base{0};      // diffuseColor or baseColor; unlit: emissiveColor
    Vec3f specular{0};  // phong
    Vec3f emissive{0};  // not unlit's
    /// The same colours in linear light: decoded, except for a PhysicalMaterial, whose fields hold linear numbers.
    struct Linear {
        Vec3f base{0}, specular{0}, emissive{0};
    } linear;
    float ambient = 0;   // ambientIntensity
    float exponent = 0;  // 128 * shininess
    float opacity = 1;   // 1 - transparency
    float alphaCutoff = 0.5f;
    float metallic = 0, roughness = 1;
    float normalScale = 1, occlusionStrength = 1;
    Vec3f reflectivity{0};
    float refractiveIndex = 0;  // 0: not a dielectric
    Vec3f absorption{0};
    float priority = 0;
    std::array<TextureUse, kTextureRoles> textures;
    std::vector<TextureStage> stages;  // of a MultiTexture in place of the base texture
    Vec4f factor{1};                   // its colour and alpha
    Hatching hatching;
    /// For the back of surfaces that are not solid; null: the same as the front.
    std::shared_ptr<const Material> back;

    /// Sets `linear` from the others.
    void decodeColors();
    const TextureUse& texture(TextureRole role) const { return textures[static_cast<std::size_t>(role)]; }
    bool textured() const;
    /// Whether anything is visible through it: shadow rays then need a closer look.
    bool transmits() const;
    /// Whether any texture of a MultiTexture, or its own `alpha`, is less than opaque somewhere.
    bool stagesHaveAlpha() const;
    /// Whether it sends mirror rays.
    bool mirrors() const;
};

/// X3D's default without an Appearance or a material: unlit white.
Material defaultMaterial();

/// If `appearance` is none or of another type than Appearance, the result is the default. Missing textures are reported
/// and left out, as the standard wants.
Material readMaterial(const Scene& scene, NodeId appearance, TextureStore& textures, Diagnostics& diagnostics);

/// Reads the stages of a MultiTexture, and its `factor`, where there is no material.
Material readMultiTexture(const Scene& scene, const Node& node, TextureStore& textures, Diagnostics& diagnostics);

struct Light {
    /// projector and projectorParallel: things in the pyramid or the box before them get the colours of a picture.
    /// environment: light from all directions, infinitely far away.
    enum class Kind : std::uint8_t { directional, point, spot, projector, projectorParallel, environment };
    Kind kind = Kind::directional;
    bool shadows = false;  // the field; the tracer may cast them regardless
    bool on = true;
    ScopeId scope;
    Vec3f color{1};    // color * intensity
    Vec3f ambient{0};  // color * ambientIntensity
    float shadowIntensity = 1;
    Vec3d position{0};          // world
    Vec3f direction{0, 0, -1};  // world, unit
    Vec3f attenuation{1, 0, 0};
    float radius = 100;        // metres in its own frame, as for attenuation
    float localFromWorld = 1;  // scale of lengths
    float beamWidth = 0, cutOffAngle = 0;
    /// For projectors. `right` and `up` are unit vectors of the picture in world space. `extent` is the picture's left,
    /// bottom, right and top, in world lengths, for a TextureProjector at distance 1. The projector shines from
    /// nearDistance to farDistance, also in world lengths.
    Vec3f right{1, 0, 0}, up{0, 1, 0};
    Vec4f extent{0};
    float nearDistance = 0, farDistance = std::numeric_limits<float>::infinity();
    std::shared_ptr<const Texture> picture;
    /// For EnvironmentLights, which need both: the light from all directions, and the rotation into its frame.
    std::shared_ptr<const trace::Environment> environment;
    glm::mat3 localFromWorldRotation{1.0f};
};

/// Reads a light; a node that is no light gives one that is off. A projector has no picture yet, and its extent does
/// not yet have the picture's shape: see showPicture(). An EnvironmentLight has no environment yet.
Light readLight(const Scene& scene, NodeId node, const WorldFromLocal& worldFromLocal, ScopeId scope);
/// Gives a projector its picture, or switches it off if there is none. The angle of a TextureProjector is that of the
/// picture's shorter side, as for a Viewpoint.
void showPicture(Light& projector, std::shared_ptr<const Texture> picture);

struct Fog {
    FogType type = FogType::none;
    Vec3f color{1};
    float visibilityRange = 0;  // world metres; 0: no fog
    Vec3f along{0};             // a unit vector of the world in which a volumetric fog thickens; else zero
    float begin = 0;            // along it, from the world's origin, in metres
    /// The depth of a place in the fog; the path from the eye to it is `run` metres long.
    float depth(const Vec3f& position, float run) const {
        return along == Vec3f(0) ? run : glm::dot(along, position) - begin;
    }
};
/// Reads a Fog or LocalFog node. A volumetric fog whose direction is zero is no fog.
Fog readFog(const Scene& scene, NodeId node, const WorldFromLocal& worldFromLocal);

/// Cuts off the half space dot(normal, x) + offset < 0. `normal` is a unit vector.
struct CutPlane {
    Vec3d normal{0, 1, 0};
    double offset = 0;
};

}  // namespace rtsg
