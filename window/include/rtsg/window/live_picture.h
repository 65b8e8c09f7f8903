// LivePicture: pictures of a world for somebody who looks on, made on a thread of their own.
//
// While what is seen changes, each picture has as many pixels as fit into a budget of time, and is meant to be
// enlarged; while the eye rests, pixels that no change can have touched are taken over, so that there are more of them.
// Once all rests, one picture with all pixels is made, and then better ones: samples are added to those that are there
// until each pixel has `mostSamples`; by path they are denoised wherever that is better (PathPreview). A change ends
// whatever is being made at rest. Invariant: a picture shows one whole state. The scene's thread waits for nothing.
// Nothing is made while nothing changes and the picture is as good as asked for. With node renderers the scene waits.
// Threading: show() and the destructor on the scene's thread, the rest on any.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <rtsg/renderers/light_renderer.h>
#include <rtsg/renderers/shared_world.h>

namespace rtsg {

struct LivePictureOptions {
    /// The size of a whole picture, the integrator and so on; samplesPerPixel is what is added at a time at rest.
    /// Integrator::raster: by OGRE, which needs a display.
    RenderSettings settings;
    Resources resources;       // of textures
    double budget = 1 / 30.0;  // seconds for a picture while something changes
    int mostSamples = 64;      // a pixel, at rest
    double restsAfter = 0.04;  // seconds without a change
    ToneMap toneMap;
    /// Gets the renderer of rays as soon as it is there, to register node renderers with it, and says whether it has.
    /// These draw on the scene's thread: pictures are then made in show(), which waits for them.
    std::function<bool(Renderer&)> prepare;
    /// From the picture's thread: there is a new one to take, or it has failed.
    std::function<void()> wake;
};

struct LivePictureShown {
    int width = 0, height = 0;
    std::vector<std::uint8_t> pixels;  // B, G, R, 255: rows from the top
    std::uint64_t sequence = 0;        // the scene's state
    int samples = 0;                   // a pixel
    bool whole = false;                // it has all pixels
    bool isMoving = false;             // it was made because something had changed, not to be better
    double denoised = 0;               // the share of the picture that was denoised, since that is better
    double noise = 0;                  // of the mean of the samples by path, over the mean; 0: not known
    double kept = 0;                   // the share of pixels that were taken over from the picture before
    double seconds = 0;                // that it took
    Camera camera;                     // it is seen from there
};

struct LivePictureStatistics {
    std::uint64_t moving = 0, whole = 0;  // pictures made while something changed, and at rest
    std::uint64_t cancelled = 0;          // at rest, as something changed
    double secondsAPixel = 0;             // of pictures while something changes, a moving mean
};

class LivePicture {
  public:
    /// `world` must outlive this. On the scene's thread.
    LivePicture(SharedWorld& world, LivePictureOptions options);
    ~LivePicture();
    LivePicture(const LivePicture&) = delete;
    LivePicture& operator=(const LivePicture&) = delete;

    /// After each frame of the scene, and before the first: the present state is what to picture. `eye`: seen from
    /// there instead of from the bound viewpoint. Errors: those of SharedWorld::present() and OgreRenderer::open(); the
    /// pictures' own.
    Result<> show(const std::optional<Camera>& eye = std::nullopt);
    /// Of a whole picture. Precondition: above 0.
    void setSize(int width, int height);
    /// The newest picture, if it has not been taken yet; else null.
    std::shared_ptr<const LivePictureShown> take();
    LivePictureStatistics statistics() const;
    /// What show() was given last, with other settings of the same integrator; it waits for that. Errors: the
    /// renderer's.
    Result<Picture> picture(const RenderSettings& settings) const;
    /// The newest picture is as good as it will be.
    bool isDone() const;
    /// What makes the pictures, for reports.
    std::string renderer() const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
