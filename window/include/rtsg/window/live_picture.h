// LivePicture: makes pictures of a world for live display, on a thread of its own.
//
// While the scene or the eye changes, each picture has as many pixels as fit into a time budget, and is shown enlarged;
// while only the eye rests, unchanged pixels are reused, so there are more of them. Once all is at rest, one picture
// with all pixels is made, and then samples are added to it until each pixel has `maxSamples`; pictures by path are
// denoised where that is better (PathPreview). A change cancels a picture that is made at rest. Invariant: a picture
// shows one whole state. The scene's thread never waits, except with node renderers. Nothing is computed when nothing
// changes and the picture has its full quality. Threading: show() and the destructor on the scene's thread, other
// functions on any.
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
    /// The size of a whole picture, the integrator and so on. samplesPerPixel is the number of samples that are added
    /// at a time at rest. Integrator::raster uses OGRE, which needs a display.
    RenderSettings settings;
    Resources resources;       // for textures
    double budget = 1 / 30.0;  // seconds for a picture while something changes
    int maxSamples = 64;       // for each pixel, at rest
    double restsAfter = 0.04;  // seconds without a change until the scene counts as at rest
    ToneMap toneMap;
    /// Called when the ray renderer has been made, to register node renderers with it; returns whether it did. Node
    /// renderers draw on the scene's thread: then pictures are made in show(), which waits for them.
    std::function<bool(Renderer&)> prepare;
    /// Called on the picture's thread when there is a new picture, or an error.
    std::function<void()> wake;
};

struct LivePictureShown {
    int width = 0, height = 0;
    std::vector<std::uint8_t> pixels;  // B, G, R, 255: rows from the top
    std::uint64_t sequence = 0;        // the scene's state
    int samples = 0;                   // for each pixel
    bool whole = false;                // it has all pixels
    bool isMoving = false;             // it was made because something had changed, not for better quality
    double denoised = 0;               // the share of the picture that was denoised
    double noise = 0;                  // of the mean of the samples by path, divided by the mean; 0: not known
    double kept = 0;                   // the share of pixels that were reused from the picture before
    double seconds = 0;                // the time to make it
    Camera camera;                     // the eye it was made with
};

struct LivePictureStatistics {
    std::uint64_t moving = 0, whole = 0;  // pictures made while something changed, and at rest
    std::uint64_t cancelled = 0;          // pictures at rest that were cancelled by a change
    double secondsAPixel = 0;             // of pictures during changes, a moving mean
};

class LivePicture {
  public:
    /// `world` must outlive this. Call it on the scene's thread.
    LivePicture(SharedWorld& world, LivePictureOptions options);
    ~LivePicture();
    LivePicture(const LivePicture&) = delete;
    LivePicture& operator=(const LivePicture&) = delete;

    /// Sets the state to show; call it after each frame of the scene, and before the first. `eye` replaces the camera
    /// of the bound viewpoint. Errors: those of SharedWorld::present(), OgreRenderer::open() and the making of
    /// pictures.
    Result<> show(const std::optional<Camera>& eye = std::nullopt);
    /// Sets the size of a whole picture. Precondition: above 0.
    void setSize(int width, int height);
    /// How long it takes to show a picture, in seconds: pictures in motion get that much less.
    void setShowing(double seconds);
    /// While nobody sees pictures none are made.
    void setSeen(bool on);
    /// The renderer's and the world's diagnostics since the last call. Call it on the scene's thread.
    Diagnostics takeDiagnostics();
    /// The newest picture, if it has not been taken yet; else null.
    std::shared_ptr<const LivePictureShown> take();
    LivePictureStatistics statistics() const;
    /// Makes a picture of the state that show() was given last, with other settings of the same integrator, and waits
    /// for it. Errors: the renderer's.
    Result<Picture> picture(const RenderSettings& settings) const;
    /// Whether the newest picture has its full quality.
    bool isDone() const;
    /// The name of the renderer, for reports.
    std::string renderer() const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
