// LightRenderer: pictures of a scene by rays, as one of the renderers of a SharedWorld.
//
// Invariant: a picture shows the scene's present state, however it got there: loaded, run, mirrored or replayed.
// Materials, lights, sky and textures, which only light needs, are here; places are the world's. Levels of detail are
// chosen for the eye of the last picture, and hold for all who see in the world; sound has its own. Threading: as
// WorldRenderer; a picture itself is made by several. Source: paper section 5.1 and Listing 1.

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

/// Two eyes' pictures as one: the left one's on the left or above; each is as large as the settings say.
enum class Stereo : std::uint8_t { none, beside, above };

struct ImageOptions {
    RenderSettings settings;
    std::string viewpoint;  // DEF name or description; empty: the bound one
    bool panorama = false;  // Camera::around()
    double lensRadius = 0;  // Camera::lensRadius
    double focus = 0;       // metres, of the lens and of stereo; 0: the far distance, of a lens 1 m
    Stereo stereo = Stereo::none;
    double eyeDistance = 0.063;  // metres
    /// Whether a picture takes from the last one whatever cannot have changed since. A still scene costs nothing;
    /// pictures by `whitted` keep the tiles whose rays met nothing that has changed (RenderStats::kept). The pictures
    /// are the same as without. It holds a picture and a version of the world.
    bool keep = true;
    /// A picture by `path` of what is the same as in the picture before goes on adding samples to that one, up to
    /// 16,384 a pixel (RenderStats::samples); else it is that one. Counts where `keep` does, without `error`.
    bool refine = false;

    /// The size of the whole picture, with both eyes.
    int fileWidth() const { return stereo == Stereo::beside ? 2 * settings.width : settings.width; }
    int fileHeight() const { return stereo == Stereo::above ? 2 * settings.height : settings.height; }
};

/// How somebody looks at states of a world, where that is other than options say.
struct OwnLook {
    std::optional<Camera> eye;  // one of their own, in what the bound viewpoint's layer shows; shaped to the picture
    /// What is sized in pixels is laid out for a picture of this size, of which this one is a coarser copy; 0: for this
    /// one.
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
    /// Asked of node renderers once a picture is traced: to draw into frame(), which is linear radiance.
    static constexpr Operation kDraw{1};

    /// Attached on return; if that failed, attached() is false and renderFrame() says why.
    explicit LightRenderer(SharedWorld& world);
    LightRenderer(SharedWorld& world, Options options);
    ~LightRenderer() override;

    /// Makes the picture of the scene's present state: frame(). Errors: as picture().
    Result<> renderFrame() override;
    /// On the scene's thread: the present state, with the levels of detail for the eye of its picture. renderFrame() of
    /// it, on any thread while the scene goes on, makes the picture that renderFrame() would make now. Errors: as
    /// picture().
    Result<std::shared_ptr<const WorldState>> prepare();
    /// The picture of that state, bit for bit the one that renderFrame() makes on the scene's thread in it; levels of
    /// detail are those that the state has, and the next will have them for this eye. Errors: as picture(); node
    /// renderers are registered here, which draw on the scene's thread only.
    Result<> renderFrame(const WorldState& state) override;
    /// renderFrame(state) with other options, by whoever looks on; hands the picture out, and ImageOptions::keep
    /// counts. A state that is laid out for another size is taken as it is, and the next is asked for. Errors: as
    /// renderFrame().
    Result<Picture> nextPicture(const WorldState& state, const ImageOptions& options, const OwnLook& look,
                                RenderStats* stats = nullptr);
    /// On the scene's thread: lets the present state count as the picture before the next one, for
    /// RenderSettings::shutter and kMotion. If these are asked for, every picture does so by itself. Errors: those of
    /// picture().
    Result<> remember(const ImageOptions& options);
    /// The last picture, empty before the first; camera() is the one it was taken with.
    Picture& frame();
    const Camera& camera() const;
    const RenderStats& stats() const;

    /// renderFrame() with other options; hands the picture out. Errors: an unknown viewpoint, an impossible size, an
    /// integrator that is not built in; whatever a node renderer reports.
    Result<Picture> picture(const ImageOptions& options, RenderStats* stats = nullptr);
    /// The same of a picture in a series, as renderFrame() makes them: ImageOptions::keep counts.
    Result<Picture> nextPicture(const ImageOptions& options, RenderStats* stats = nullptr);

    const LightTracer& tracer() const;
    /// Diagnostics of materials, lights and textures, and of light that pictures lack, since the start. The world has
    /// diagnostics of its own.
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
