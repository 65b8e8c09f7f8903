// What a picture by rays is made with, and what is said of one that was made.
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

/// Whitted: lights, mirrors and glass, X3D's ambient terms for the rest. Path: unbiased, light between surfaces and
/// from the sky included, ambient terms left out; colours that would send on more light than they get are smaller
/// (bsdf.h): highlights beside bright diffuse colours, PhysicalMaterial's white at grazing views. Raster: not of this
/// tracer.
enum class Integrator : std::uint8_t { whitted, path, raster };

/// Bits of RenderSettings::layers: the data of pixels besides their colours, in Picture::layers. They describe the
/// first surface that lets less than half of the light from behind through, or bends it; if there is none, Z is
/// infinite and all others are 0. depth, position, normal, node and motion are those of the pixel's middle, the others
/// means over samples. All hold for the picture's own instant, whatever its shutter.
enum DataLayer : std::uint32_t {
    kDepth = 1,     // "Z": metres along the view, of panoramas from the eye
    kPosition = 2,  // "P.X", "P.Y", "P.Z": world, metres
    kNormal = 4,    // "N.X" ...: as it is shaded, in world space, on the eye's side
    /// "albedo.R" ...: diffuseColor, baseColor, or what an unlit one shows, with textures, as light; 1 for the share
    /// that is mirrored or bent. From 0 to 1.
    kAlbedo = 8,
    kNode = 16,       // "node.id": NodeId of the Shape, an integer
    kObjects = 32,    // "CryptoObject00.R" ...: Cryptomatte 1.2 of RenderSettings::nameOf(shape)
    kMaterials = 64,  // "CryptoMaterial00.R" ...: of nameOf(appearance)
    /// "motion.X", "motion.Y": from a pixel's middle to the position that its content had in the previous picture, in
    /// pixels to the right and up; 0 if that is not known. For content that is infinitely far, it follows from the
    /// eye's rotation.
    kMotion = 128
};
constexpr std::uint32_t kAllLayers = 255;

/// Added to a pixel's value before an error is divided by it, since differences in darker pixels are not seen.
constexpr float kErrorFloor = 0.01f;

/// The world and the eye of the previous picture, from which things have moved since.
struct PictureBefore {
    std::shared_ptr<const WorldVersion> world;  // of the same RayWorld
    Camera camera;
};

struct RenderSettings {
    Integrator integrator = Integrator::whitted;
    int width = 1280, height = 720;
    /// The part of the picture that is made; empty: all of it. What comes out has the region's size, and the bits that
    /// the whole picture has there. Blocks of 16 x 16 pixels are traced whole, so a region between multiples of 16
    /// costs its share of the picture. RenderStats count what is traced.
    PixelRegion region;
    int samplesPerPixel = 1;  // 1: through the pixels' centres; more: a scrambled (0,2)-sequence
    /// If above 0, tiles of 16 x 16 pixels are sampled until their relative standard error (RenderStats::error) is at
    /// most this, and that of no block of 4 x 4 more than a tenth above it, with at most samplesPerPixel samples a
    /// pixel; Picture::interval tells how well each pixel is known.
    float error = 0;
    std::uint64_t seed = 1;      // of the scrambling
    float cutoff = 1 / 1024.0f;  // of whitted: rays that could add less than this share (1e-6 at least) are left out
    int maxDepth = 250;          // of whitted: mirrorings and refractions on one way, should its weight not run out
    Shadows shadows = Shadows::automatic;
    /// In which space light is computed (docs/color.md). The picture is of the display's space, or linear if that is
    /// asked for. Paths compute in linear light always: automatic means that, display is an error.
    ColorSpace colorSpace = ColorSpace::automatic;
    /// Whether closed bodies that ClipPlanes cut (11.4.1) are filled there, in their material's own colours; else one
    /// looks into them.
    bool caps = false;
    unsigned threads = 0;      // 0: one a core
    std::uint32_t layers = 0;  // DataLayers
    /// The share, up to 1, of the time since the previous picture in which the shutter is open; it closes at this
    /// picture's instant. Moving instances, each as a rigid or evenly stretched thing, and the eye are blurred along
    /// their ways. Lights, lines, points, volumes and deforming meshes stay where they are in the end. Needs several
    /// samples.
    float shutter = 0;
    /// The previous picture, for `shutter` and kMotion; null: nothing has moved. LightRenderer remembers its own.
    std::shared_ptr<const PictureBefore> before;
    /// Names nodes for kObjects and kMaterials; called before the rays are traced, by the thread that asks for the
    /// picture. A node without a name goes by its number. LightRenderer takes DEF names if it is on the scene's thread.
    std::function<std::string(NodeId)> nameOf;
    /// Called now and then, from any thread but never from two at once, with the share done; false cancels.
    std::function<bool(double)> progress;
};

struct RenderStats {
    std::uint64_t primaryRays = 0, shadowRays = 0, secondaryRays = 0;
    double seconds = 0;
    /// The share of the picture's, and the largest share of a pixel's, lines of sight that was cut off by
    /// RenderSettings::maxDepth (whitted) or 10,000 bounces (path) before its weight had run out: how much darker than
    /// it is something may show.
    double missing = 0, missingMost = 0;
    /// What came of RenderSettings::error. `error` is the relative standard error that was reached, as root mean square
    /// over the pixels; a pixel's is that of its brightest channel over (value + kErrorFloor). `unreached` is the share
    /// of pixels in blocks that ran out of samples, `samples` the mean number of samples that a pixel shows.
    double error = 0, unreached = 0, samples = 0;
    /// The root mean square of the pixels' standard errors, and the mean of the pixels, both over red, green and blue:
    /// their quotient is the noise as one sees it in the whole picture. With RenderSettings::error alone.
    double noise = 0, mean = 0;
    /// The share of pixels that were taken from the previous picture (LightRenderer), since their content cannot have
    /// changed. Counts of rays are of those that were traced; all other numbers are of the whole picture.
    double kept = 0;
    bool cancelled = false;
};

/// How many materials, lights and textures have been read since the start; for tests of the invariant.
struct LightCounts {
    std::uint64_t materialsRead = 0, lightsRead = 0;
    std::size_t materials = 0, lights = 0;
};

}  // namespace rtsg
