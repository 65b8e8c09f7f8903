// Outputs: what --render, --listen and --save make of a scene that something else drives: a file, a mirror or a log.
//
// Invariant: every state is seen in its turn, however many come at once. Pictures are taken at even distances of scene
// time if the file's name holds a place for a number (%04d) or is a .gif; else one is taken at the end. Of T seconds at
// F pictures a second these are the ones at k / F < T, and sound is T long to the sample; missing() says what is not.
// Threading: the scene's thread.
#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <rtsg/audio/sound_renderer.h>
#include <rtsg/renderers/image.h>

#include "cli.h"
#include "files.h"

namespace rtsg::app {

/// --size, --spp and so on; shared by all verbs that make pictures.
struct PictureArguments {
    std::string size = "1280x720", viewpoint, integrator = "whitted", shadows = "auto", colorSpace = "auto";
    int samples = 4, depth = 250;
    unsigned threads = 0;
    std::uint64_t seed = 1;
    double error = 0, exposure = 1;

    void addTo(Command& command);
    /// Throws UsageError for what is wrong or not built in.
    ImageOptions parse() const;
    ToneMap toneMap() const { return {static_cast<float>(exposure)}; }
};

/// --binaural, --stereo, --rays and so on.
struct SoundArguments {
    bool binaural = false, stereo = false;
    int ambisonic = 0;
    std::uint64_t rays = 0;
    double error = 0, length = 0;
    AirChoice air;
    bool noAir = false;

    void addTo(Command& command);
    ListenOptions parse() const;
};

struct OutputArguments {
    std::string render, listen, record, save;
    ResourceArguments resources;
    double picturesPerSecond = 5;
    /// Scene time to make pictures and sound of; set by the verb.
    double seconds = std::numeric_limits<double>::infinity();
    bool force = false;
    PictureArguments picture;
    SoundArguments sound;

    /// `run` has an --fps of its own, which is that of its pictures; only `mirror` has --record.
    enum class Options : std::uint8_t { ofRun, ofReplay, ofMirror };
    void addTo(Command& command, Options which);
    bool animated() const;
    bool any() const { return !render.empty() || !listen.empty() || !record.empty() || !save.empty(); }
    std::vector<OutputName> names() const;
    /// Finds out before any work that something cannot be made, or would overwrite one of `inputs` (checkFiles(), to
    /// which `more` outputs of the verb go as well). Throws UsageError.
    Result<> check(const std::vector<std::string>& inputs, std::vector<OutputName> more = {}) const;
};

/// How a scene whose urls these are is flattened: with as many instances as their policy lets.
SharedWorld::Options worldOptions(const Resources& resources);

/// The present state as a document.
Result<> saveScene(const Scene& scene, const std::string& file, Existing existing);

class Outputs final : public Subscriber {
  public:
    enum class Follow : std::uint8_t {
        sets,    // every set of the scene's bus
        frames,  // frame() says that a frame is complete, with all sets that belong to it
    };
    /// The scene must outlive this and be in its first state. `resources`: what urls may open. Throws as
    /// keepResources().
    static Result<std::unique_ptr<Outputs>> attach(Scene& scene, const OutputArguments& arguments,
                                                   const Resources& resources, Follow follow = Follow::sets);

    Scene& scene() { return scene_; }
    /// What pictures, sound and others share; made when first asked for.
    SharedWorld& world();

    /// Makes what is due at the scene's time.
    Result<> frame();
    Result<> apply(const Scene&, const ChangeSet&) override { return frame(); }
    std::string subscriberName() const override { return "outputs"; }
    /// Why it follows no longer; empty if it does.
    std::string failure() const { return failed_ ? "" : failed_.error().format(); }

    /// Writes what is written at the end.
    Result<> finish();

    /// ,"flattenings":…,"worlds":…,"commits":… of a JSON object: how often the scene was flattened, into how many
    /// BVHs, and in how many change sets these had something to do.
    std::string worldJson() const;
    /// After finish(): "7 of 20 pictures, 1.4 of 4 s of sound"; empty if all that was asked for is there.
    std::string missing() const;
    int pictures() const { return pictures_; }
    double soundSeconds() const { return soundSeconds_; }

  private:
    Outputs(Scene& scene, const OutputArguments& arguments, const Resources& resources)
        : scene_(scene), arguments_(arguments), worldOptions_(worldOptions(resources)) {}
    Result<> make();
    Result<> finishPictures();
    Result<> finishSound();
    Result<> takePicture(const std::string& file);
    /// Seconds from the start to the next picture.
    double nextPicture() const { return pictures_ / arguments_.picturesPerSecond; }

    Scene& scene_;
    OutputArguments arguments_;
    ImageOptions image_;
    SharedWorld::Options worldOptions_;
    std::unique_ptr<SharedWorld> world_;
    std::unique_ptr<LightRenderer> light_;
    std::unique_ptr<SoundRenderer> sound_;
    std::vector<Picture> frames_;  // of a .gif
    double start_ = 0, soundSeconds_ = 0;
    int pictures_ = 0;
    bool finishing_ = false;
    Result<> failed_;
    Attachment attachment_;
};

}  // namespace rtsg::app
