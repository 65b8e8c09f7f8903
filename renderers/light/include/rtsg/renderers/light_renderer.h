// LightRenderer: ray-traced pictures of a scene, as one of the renderers of a SharedWorld.
//
// Invariant: a picture shows the scene's present state, whether it was loaded, run, mirrored or replayed. Materials,
// lights, sky and textures, which only light needs, are kept here; positions are the world's. Levels of detail are
// chosen for the eye of the last picture, for all renderers of pictures in this world; sound has its own. Threading: as
// for WorldRenderer; each picture is made by several threads. Source: paper section 5.1 and Listing 1.

// Example:
//     #include <rtsg/documents/loader.h>
//     #include <rtsg/renderers/light_renderer.h>
//     rtsg::Scene scene;
//     rtsg::Diagnostics diagnostics;
//     rtsg::loadFile(scene, "hall.x3dv", diagnostics);
//     rtsg::SharedWorld world(scene);
//     rtsg::LightRenderer light(world, rtsg::LightRenderer::Options(rtsg::Resources::ofFile("hall.x3dv")));
//     scene.newFrame(0);
//     rtsg::ImageOptions options;
//     options.settings.width = 640, options.settings.height = 360;
//     if (const auto picture = light.picture(options)) (void)rtsg::writePicture(*picture, "hall.png");
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <rtsg/renderers/light_tracer.h>
#include <rtsg/renderers/picture.h>
#include <rtsg/renderers/world_renderer.h>

namespace rtsg {

/// Two eyes' pictures in one, the left eye's on the left or above; each has the size of the settings.
enum class Stereo : std::uint8_t { none, beside, above };

struct ImageOptions {
    RenderSettings settings;
    std::string viewpoint;  // DEF name or description; empty: the bound viewpoint
    bool panorama = false;  // Camera::around()
    double lensRadius = 0;  // Camera::lensRadius
    double focus = 0;       // metres, for the lens and for stereo; 0: infinity for stereo, 1 m for a lens
    Stereo stereo = Stereo::none;
    double eyeDistance = 0.063;  // metres
    /// Whether a picture reuses the parts of the last one that cannot have changed. A still scene costs nothing;
    /// pictures by `whitted` keep the tiles whose rays met nothing that has changed (RenderStats::kept). The pictures
    /// are the same as without it. It keeps a picture and a version of the world in memory.
    bool keep = true;
    /// If nothing has changed since the last picture by `path`, more samples are added to it, up to 16,384 a pixel
    /// (RenderStats::samples); without `refine` the last picture is returned. It works if `keep` is true and `error` is
    /// not used.
    bool refine = false;

    /// The size of the whole picture, with both eyes.
    int fileWidth() const { return stereo == Stereo::beside ? 2 * settings.width : settings.width; }
    int fileHeight() const { return stereo == Stereo::above ? 2 * settings.height : settings.height; }
};

/// How one viewer looks at states of a world, where this differs from the options.
struct OwnLook {
    std::optional<Camera> eye;  // the viewer's own eye, for the layer of the bound viewpoint; fitted to the picture's
                                // shape
    /// Things in pixels are laid out for a picture of this size, of which this one is a coarser copy; 0: for the size
    /// of this one.
    int wholeWidth = 0, wholeHeight = 0;
};

class LightRenderer final : public WorldRenderer {
  public:
    struct Options {
        Options() = default;
        explicit Options(Resources textures, ImageOptions pictures = {})
            : image(std::move(pictures)), resources(std::move(textures)) {}
        ImageOptions image;
        Resources resources;  // what urls of textures may open, and where relative ones start
    };
    /// Sent to node renderers when a picture is traced, so that they draw into frame(), which is linear radiance.
    static constexpr Operation kDraw{1};

    /// Attaches to the world; if that failed, attached() is false and renderFrame() says why.
    explicit LightRenderer(SharedWorld& world);
    LightRenderer(SharedWorld& world, Options options);
    ~LightRenderer() override;

    /// Makes the picture of the scene's present state: frame(). Errors: as picture().
    Result<> renderFrame() override;
    /// Called on the scene's thread: returns the present state, with levels of detail for the eye of its picture.
    /// renderFrame() of that state, on any thread while the scene goes on, makes the picture that renderFrame() would
    /// make now. Errors: as for picture().
    Result<std::shared_ptr<const WorldState>> prepare();
    /// Makes the picture of that state, bit for bit the one that renderFrame() makes on the scene's thread. It uses the
    /// levels of detail of the state; the next state will have them for this eye. Errors: as for picture(); node
    /// renderers are registered here, which draw on the scene's thread only.
    Result<> renderFrame(const WorldState& state) override;
    /// Does the same as renderFrame(state) with other options, for any viewer, and returns the picture;
    /// ImageOptions::keep is used. A state with a layout for another size is accepted, and a layout for this size is
    /// requested for the next. Errors: as for renderFrame().
    Result<Picture> nextPicture(const WorldState& state, const ImageOptions& options, const OwnLook& look,
                                RenderStats* stats = nullptr);
    /// Called on the scene's thread: makes the present state the picture before the next one, for
    /// RenderSettings::shutter and kMotion. If these are used, every picture does so by itself. Errors: those of
    /// picture().
    Result<> remember(const ImageOptions& options);
    /// The last picture, empty before the first; camera() is the one it was taken with.
    Picture& frame();
    const Camera& camera() const;
    const RenderStats& stats() const;

    /// Does the same as renderFrame() with other options, and returns the picture. Errors: an unknown viewpoint, an
    /// invalid size, an integrator that is not built in; errors of node renderers.
    Result<Picture> picture(const ImageOptions& options, RenderStats* stats = nullptr);
    /// The same for a picture in a series, as in renderFrame(): ImageOptions::keep is used.
    Result<Picture> nextPicture(const ImageOptions& options, RenderStats* stats = nullptr);

    const LightTracer& tracer() const;
    /// Diagnostics since the start: of materials, lights and textures, and of light that pictures lack. The world has
    /// its own.
    const Diagnostics& diagnostics() const;
    std::string subscriberName() const override { return "light renderer"; }

  protected:
    Result<> follow(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) override;
    std::shared_ptr<const void> freezeTables() override;
    std::optional<PictureSight> looksFrom() override;

  private:
    Result<Camera> look(const ImageOptions& options);
    Result<> make(const ImageOptions& options, bool inSeries);
    Result<> makeOf(const WorldState& state, const ImageOptions& options, const OwnLook* look);
    Result<> take(Result<Picture> picture, const RenderSettings& settings);
    Result<> keepBefore(const RenderSettings& settings);
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
