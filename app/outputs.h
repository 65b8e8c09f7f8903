// What --render, --listen and --save make of a scene that something drives: a file, a mirror or a log.
//
// Outputs makes every picture that is due and all of the sound, on the scene's thread; OutputsBehind (behind.h) the
// same on a thread of its own, however late; LiveOutputs (live_outputs.h) of the newest state, at the machine's own
// pace. Invariant: pictures are taken at even distances of scene time if the file's name holds a place for a number
// (%04d) or is a .mp4 or .gif; else one is taken at the end. Of T seconds at F pictures a second these are the ones at
// k / F < T, and sound is T long to the sample; OutputReport says what is not. Where the scene's time goes back (a log
// that is played again) they go on from there, as if that took no time. Threading: the scene's thread.
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <initializer_list>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <rtsg/audio/live_sound.h>
#include <rtsg/audio/sound_renderer.h>
#include <rtsg/renderers/image.h>

#include "cli.h"
#include "files.h"
#include "given_sounds.h"

namespace rtsg::app {

/// --size, --spp and so on; shared by all verbs that make pictures.
struct PictureArguments {
    std::string size = "1280x720", viewpoint, integrator = "whitted", shadows = "auto", colorSpace = "auto",
                tessellation;
    int samples = 4, depth = 250;
    unsigned threads = 0;
    std::uint64_t seed = 1;
    double error = 0, exposure = 1, shutter = 0;
    bool caps = false;

    void addTo(Command& command);
    /// Throws UsageError for what is wrong or not built in.
    ImageOptions parse() const;
    /// As --tessellation has it; throws UsageError.
    TessellationError tessellationError() const;
    /// Throws UsageError if such a picture does not fit into the file's format.
    static void checkSize(const std::string& file, const ImageOptions& options);
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
    std::string sofa;
    GivenSoundArguments given;
    std::string document;  // the scene's file, if there is one; set by the verb

    void addTo(Command& command);
    /// Without what is given: GivenSoundArguments::open().
    ListenOptions parse() const;
    /// What the sound is made from besides the scene.
    std::vector<std::string> files() const;
};

struct OutputArguments {
    std::string render, listen, record, save, device;
    ResourceArguments resources;
    double picturesPerSecond = 5;
    /// Scene time to make pictures and sound of; set by the verb.
    double seconds = std::numeric_limits<double>::infinity();
    bool force = false, live = false, denoise = false;
    /// No end was stated: an interruption is the regular one. Set by the verb.
    bool endsByInterruption = false;
    PictureArguments picture;
    SoundArguments sound;

    /// `run` has an --fps of its own, which is that of its pictures; only `mirror` has --record.
    enum class Options : std::uint8_t { ofRun, ofReplay, ofMirror };
    void addTo(Command& command, Options which);
    bool animated() const;
    /// --listen names the film of --render.
    bool soundInFilm() const;
    /// Played, not written.
    bool onDevice() const { return listen == "device"; }
    bool isLive() const { return live || onDevice(); }
    bool any() const { return !render.empty() || !listen.empty() || !record.empty() || !save.empty(); }
    std::vector<OutputName> names() const;
    /// Interrupted before the end that was stated: what is one file for all of it, or for its end, is not complete.
    bool isCutShort() const { return !endsByInterruption && interrupted(); }
    /// These files, not written: an error that names them, if there are any.
    Result<> leftUnwritten() const;
    /// Finds out before any work that something cannot be made, or would overwrite one of `inputs` (checkFiles(), to
    /// which `more` outputs of the verb go as well). Throws UsageError.
    Result<> check(const std::vector<std::string>& inputs, std::vector<OutputName> more = {}) const;
};

/// How a scene whose urls these are is flattened: with as many instances as their policy lets.
SharedWorld::Options worldOptions(const Resources& resources);

/// What a picture lacks of --error, whose pixels have run out of samples in the share `unreached`; empty: nothing.
std::string missingError(double error, double unreached);

/// ,"tessellation":… of a JSON object.
std::string tessellationJson(const Flattener::Cuts& cuts);

/// The present state as a document.
Result<> saveScene(const Scene& scene, const std::string& file, Existing existing);

/// Scene time from a start on. Where it goes back (a log that is played again), that takes no time.
class ElapsedTime {
  public:
    explicit ElapsedTime(double start = 0) : start_(start), last_(start) {}
    /// Seconds, now that the scene's time is `now`.
    double at(double now) {
        if (now < last_) start_ -= last_ - now;
        last_ = now;
        return now - start_;
    }
    /// What a time is counted from now.
    double start() const { return start_; }

  private:
    double start_, last_;
};

/// What was made, for the reports of verbs.
struct OutputReport {
    /// The scene's number of the state that each picture shows; of the one that the sound up to the same instant was
    /// made from (0: there is none); and the instant, in seconds from the start.
    std::vector<std::uint64_t> pictureStates, soundStates;
    std::vector<double> pictureTimes;
    double kept = 0;       // RenderStats::kept, added up over the pictures
    double unreached = 0;  // RenderStats::unreached, the most of a picture
    double soundSeconds = 0;
    double mostBehind = 0;         // seconds of scene time that the outputs ever were behind the scene
    std::uint64_t overlapped = 0;  // frames that came while what the one before asked for was still in the making
    std::string missing;           // "7 of 20 pictures, 1.4 of 4 s of sound"; empty if all that was asked for is there
    SharedWorld::Counts world;
    std::optional<Flattener::Cuts> cuts;  // with --tessellation
    struct Live {
        std::uint64_t states = 0;                           // of the scene, while it was followed
        std::uint64_t statesPictured = 0, statesHeard = 0;  // of them; the others were merged with these
        std::uint64_t picturesSkipped = 0;  // times k / F that went by while another picture was in the making
        std::optional<LiveReport> device;
    };
    std::optional<Live> live;

    /// The sound that was made has not come into a file, nor have the pictures, if they are one.
    void forget(bool pictures);
    double meanKept() const { return pictureStates.empty() ? 0 : kept / static_cast<double>(pictureStates.size()); }
    /// ,"pictures":… of a JSON object.
    std::string json() const;
    /// A line of text.
    std::string text() const;
};

/// Of RenderStats::kept; empty for none.
std::string keptText(double share);

/// Of a picture that an interruption ended.
inline std::unexpected<Diagnostic> notWritten(const std::string& file) {
    return fail("interrupted: the picture was not written", {}, file);
}

/// A line on standard error if the sound had to be made softer.
void tellGain(const ListenReport& report);

/// Writes what was heard, as long as was asked for, into a file of its own or into the film. Returns its length in
/// seconds.
Result<double> writeSound(SoundRenderer& sound, const OutputArguments& arguments, PictureFiles& pictures);
/// The files that arguments ask for.
PictureFiles pictureFiles(const OutputArguments& arguments);

/// "1.4 of 4 s of sound", after a comma unless it is the first that is missing; empty if nothing is.
std::string missingSound(double made, double wanted, bool first);

/// Does one after the other; what fails costs the others nothing. The first error, if there is more than one the others
/// are printed.
Result<> allOf(std::initializer_list<std::function<Result<>()>> steps);

/// The one flattening and the one BVH of a scene, for its pictures, sound, export and the rays of pointers; built when
/// first asked for. The scene must outlive this.
class WorldOnDemand {
  public:
    WorldOnDemand(Scene& scene, const Resources& resources) : scene_(scene), options_(worldOptions(resources)) {}
    Scene& scene() { return scene_; }
    SharedWorld& get();
    /// How finely what is curved is cut. Error: the world is there, cut otherwise.
    Result<> cut(const TessellationError& error);
    /// Null if nobody asked for it.
    const SharedWorld* built() const { return world_.get(); }
    /// Nothing if nobody asked for it, or for another error than usual.
    std::optional<Flattener::Cuts> cuts() const;

  private:
    Scene& scene_;
    SharedWorld::Options options_;
    std::unique_ptr<SharedWorld> world_;
};

class OutputMaker {
  public:
    virtual ~OutputMaker() = default;
    OutputMaker() = default;
    OutputMaker(const OutputMaker&) = delete;
    OutputMaker& operator=(const OutputMaker&) = delete;

    /// Every set of the scene's present instant has come: makes what is due. Calling it again at the same instant, and
    /// now and then while nothing comes, does no harm.
    virtual Result<> frame() = 0;
    /// It follows no longer: there is no sense in going on. finish() says why.
    virtual bool failed() const = 0;
    /// Makes what is still to be made, and writes what is written at the end, unless all was cut short
    /// (OutputArguments::isCutShort(), an error then): numbered pictures alone are there.
    virtual Result<> finish() = 0;
    /// After finish().
    virtual OutputReport report() const = 0;
};

class Outputs final : public OutputMaker {
  public:
    /// The world must outlive this, and its scene be in its first state. `resources`: what urls may open. Throws as
    /// keepResources().
    static Result<std::unique_ptr<Outputs>> attach(WorldOnDemand& world, const OutputArguments& arguments,
                                                   const Resources& resources);
    ~Outputs() override;

    Scene& scene() { return scene_; }

    /// Waits for what the frame before has asked for.
    Result<> frame() override;
    bool failed() const override { return failed_; }
    Result<> finish() override;
    OutputReport report() const override;

  private:
    Outputs(WorldOnDemand& world, const OutputArguments& arguments)
        : world_(world), scene_(world.scene()), arguments_(arguments), files_(pictureFiles(arguments_)) {}
    /// What is to be made of one state.
    struct Job {
        std::shared_ptr<const WorldState> state;
        bool picture = false;
        double until = 0;  // seconds from the start: pictures up to there
    };
    Result<> next(bool picture, double until);
    Result<> ready();
    void work();
    Result<> make(const Job& job);
    Result<> attachLight();
    Result<> lastPicture();
    Result<> leaveUnwritten();
    bool pictureIsDue(double t) const;
    double elapsed() { return elapsed_.at(scene_.now()); }
    /// Seconds from the start to the next picture.
    double nextPicture() const {
        return static_cast<double>(report_.pictureStates.size()) / arguments_.picturesPerSecond;
    }

    WorldOnDemand& world_;
    Scene& scene_;
    OutputArguments arguments_;
    Resources resources_;
    std::unique_ptr<LightRenderer> light_;  // null until there is a picture to make
    std::unique_ptr<SoundRenderer> sound_;
    ElapsedTime elapsed_;
    std::atomic<bool> failed_{false}, afterInterruption_{false}, abandoned_{false};

    // The worker's while it has a job, else the scene's thread's.
    PictureFiles files_;
    OutputReport report_;
    Result<> result_;  // the first that failed

    std::mutex mutex_;
    std::condition_variable changed_;
    std::optional<Job> job_;
    bool stop_ = false;
    std::thread worker_;  // from the first job on
};

}  // namespace rtsg::app
