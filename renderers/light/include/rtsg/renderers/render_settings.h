// The settings of a ray-traced picture, and the statistics of one that was made.
//
// Threading: values.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include <rtsg/renderers/camera.h>
#include <rtsg/renderers/color.h>
#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/picture.h>
#include <rtsg/renderers/ray_world.h>

namespace rtsg {

/// Which lights cast shadows. `authored`: those whose `shadows` field is TRUE. `all`: all but the headlight, whatever
/// the fields say. `automatic`: as `authored` if any light's field is TRUE, else as `all`, since authors seldom set the
/// field.
enum class Shadows : std::uint8_t { authored, all, none, automatic };

/// Whitted: lights, mirrors and glass; X3D's ambient terms stand for other light. Path: unbiased, with light between
/// surfaces and from the sky, without ambient terms; colours that would reflect more light than they receive are
/// reduced (bsdf.h): highlights beside bright diffuse colours, PhysicalMaterial's white at grazing angles. Raster: for
/// other renderers, not for this tracer.
enum class Integrator : std::uint8_t { whitted, path, raster };

/// Bits of RenderSettings::layers: data of pixels besides their colours, in Picture::layers. They describe the first
/// surface that lets less than half of the light from behind through, or bends it; if there is none, Z is infinite and
/// all others are 0. depth, position, normal, node and motion are those of the pixel's middle; the others are means
/// over samples. All are for the picture's instant, whatever its shutter.
enum DataLayer : std::uint32_t {
    kDepth = 1,     // "Z": metres along the view, in panoramas from the eye
    kPosition = 2,  // "P.X", "P.Y", "P.Z": world, metres
    kNormal = 4,    // "N.X" ...: the shading normal, in world space, on the eye's side
    /// "albedo.R" ...: diffuseColor, baseColor, or the colour of an unlit surface, with textures, in linear light; 1
    /// for the share of light that is mirrored or bent. From 0 to 1.
    kAlbedo = 8,
    kNode = 16,       // "node.id": NodeId of the Shape, an integer
    kObjects = 32,    // "CryptoObject00.R" ...: Cryptomatte 1.2 of RenderSettings::nameOf(shape)
    kMaterials = 64,  // "CryptoMaterial00.R" ...: of nameOf(appearance)
    /// "motion.X", "motion.Y": the vector from a pixel's middle to the position of its content in the previous picture,
    /// in pixels to the right and up; 0 if that is not known. For content that is infinitely far, it follows from the
    /// eye's rotation.
    kMotion = 128
};
constexpr std::uint32_t kAllLayers = 255;

/// So many times the picture's own light (averageLight()) are added to a pixel's value before an error is divided by
/// it, since errors in dark pixels are not visible.
constexpr float kErrorFloor = 1 / 32.0f;

/// The world and the eye of the previous picture, for motion since then.
struct PictureBefore {
    std::shared_ptr<const WorldVersion> world;  // of the same RayWorld
    Camera camera;
};

struct RenderSettings {
    Integrator integrator = Integrator::whitted;
    int width = 1280, height = 720;
    /// The part of the picture that is made; empty: all of it. The result has the region's size, and the same bits as
    /// the whole picture has there. Blocks of 16 x 16 pixels are traced whole, so a region between multiples of 16
    /// costs its share of the picture. RenderStats count what is traced.
    PixelRegion region;
    int samplesPerPixel = 1;  // 1: through the pixels' centres; more: a scrambled (0,2)-sequence
    /// If above 0, the picture gets as many samples, all pixels alike, as its relative standard error
    /// (RenderStats::error) needs to be at most this, and at most samplesPerPixel. A region is such a picture of its
    /// own: it may get other numbers of samples than the whole. Picture::interval then holds the error of each pixel.
    float error = 0;
    std::uint64_t seed = 1;      // of the scrambling
    float cutoff = 1 / 1024.0f;  // for whitted: rays whose share of the pixel is smaller are left out; at least 1e-6
    int maxDepth = 250;          // for whitted: the most mirrorings and refractions on one path
    Shadows shadows = Shadows::automatic;
    /// The space in which light is computed (docs/color.md). The picture is in the display space, or linear if `linear`
    /// is chosen. Paths always compute in linear light: for them `automatic` means linear, and `display` is an error.
    ColorSpace colorSpace = ColorSpace::automatic;
    /// Whether closed bodies are filled where ClipPlanes cut them (11.4.1), in their material's own colours; otherwise
    /// one looks into them.
    bool caps = false;
    unsigned threads = 0;      // 0: one for each core
    std::uint32_t layers = 0;  // DataLayers
    /// The share, up to 1, of the time since the previous picture in which the shutter is open; it closes at this
    /// picture's instant. Moving instances (each as a rigid or evenly scaled thing) and the eye are blurred along their
    /// paths. Lights, lines, points, volumes and deforming meshes keep their last position. Needs several samples.
    float shutter = 0;
    /// The previous picture, for `shutter` and kMotion; null: nothing has moved. LightRenderer sets it itself.
    std::shared_ptr<const PictureBefore> before;
    /// Names nodes for kObjects and kMaterials; it is called before the rays are traced, on the caller's thread. A node
    /// without a name gets its number. LightRenderer uses DEF names if it is on the scene's thread.
    std::function<std::string(NodeId)> nameOf;
    /// Called from time to time, from any thread but never from two at once, with the share that is done; false
    /// cancels.
    std::function<bool(double)> progress;
};

struct RenderStats {
    std::uint64_t primaryRays = 0, shadowRays = 0, secondaryRays = 0;
    double seconds = 0;
    /// The share of light paths that were cut off by RenderSettings::maxDepth (whitted) or after 10,000 bounces (path)
    /// while they still had weight, in the whole picture and at most in one pixel: the picture may be darker by this
    /// share.
    double missing = 0, missingMaximum = 0;
    /// Results of RenderSettings::error. `error` is the relative standard error that was reached, as root mean square
    /// over the pixels, with a bound for what may lie beyond all samples; a pixel's error is that of its brightest
    /// channel divided by (value + kErrorFloor * averageLight()). 1 for a black picture that might be lit. `unreached`
    /// is 0 where it is what was asked, else the share of pixels in tiles of 16 x 16 whose own error is larger; if none
    /// is, 1. `samples` is the number of samples of each pixel.
    double error = 0, unreached = 0, samples = 0;
    /// The root mean square of the pixels' standard errors, and the mean of the pixels, both over red, green and blue:
    /// their quotient is the visible noise of the whole picture. Only with RenderSettings::error.
    double noise = 0, mean = 0;
    /// The share of the light of shining surfaces that meets clear or mirroring surfaces first, beyond which `path`
    /// finds it by chance alone. Only with RenderSettings::error.
    double hiddenLight = 0;
    /// The same share of the light of PointLights and SpotLights: how such surfaces gather or throw it on is left out.
    double lostLight = 0;
    /// The share of pixels that were taken from the previous picture (LightRenderer), since their content cannot have
    /// changed. Counts of rays are those that were traced; all other numbers are for the whole picture.
    double kept = 0;
    bool cancelled = false;
};

/// How many materials, lights and textures have been read since the start; for tests of the invariant.
struct LightCounts {
    std::uint64_t materialsRead = 0, lightsRead = 0;
    std::size_t materials = 0, lights = 0;
};

}  // namespace rtsg
