// RunningScene: a scene file while it runs, with what its urls may open, the Inlines that load and unload, events with
// their times, and all their diagnostics.
//
// Invariant: a frame is the same whoever runs it: due events, the cascade, then the Inlines that the cascade
// asked for. When the call returns, their content is in the scene and with all subscribers. Times count from start(),
// on the scene's own clock.
// Threading: the scene's thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <rtsg/core/device_input.h>
#include <rtsg/dis/dis_network.h>
#include <rtsg/documents/scene_builder.h>
#include <rtsg/physics/rigid_body_physics.h>
#include <rtsg/session/notices.h>
#include <rtsg/session/world_on_demand.h>
#include <rtsg/sync/session.h>

namespace rtsg {

class FetchedFiles;
class FollowedFile;
class Injections;
class InlineLoader;
class WorldQueries;

/// The time of a scene's clock when it begins to run, and which of its animations plays.
struct SceneStart {
    double time = 946'684'800;  // seconds since 1970; 2000-01-01, the same in every run
    bool isGiven = false;       // then a file that begins with a later state is an error
    std::string clip;           // of a glTF file, by its name; else the first
};

/// How long to run, and at which frame rate.
struct Pace {
    double seconds = 1, framesPerSecond = 60;
    bool realtime = false;

    /// The number of frames: at k / framesPerSecond before `seconds`, and at `seconds`.
    std::uint64_t frames() const;
    double timeOf(std::uint64_t frame) const;
};

class RunningScene {
  public:
    /// How often a file is looked at whose edits are followed.
    static constexpr std::chrono::milliseconds kLookEvery{100};

    /// `file`: "-" is standard input. `resources`: what its urls may open.
    RunningScene(std::string file, Resources resources, SceneStart start = {}, SessionContext context = {});
    /// Ends the scene's programs, and reports the diagnostics of their shutdown().
    ~RunningScene();
    RunningScene(const RunningScene&) = delete;
    RunningScene& operator=(const RunningScene&) = delete;

    /// Call it before load(). Sets the addresses that DIS nodes may use; by default none.
    void allowNetwork(std::vector<std::string> addresses) { allowedAddresses_ = std::move(addresses); }
    /// Call it before load(). From now on the scene follows edits of its file, and of those that it inlines, at the
    /// beginning of a frame. Error (kUsageCode): it is no document in a file.
    Result<> followEdits();
    bool followsEdits() const { return followsEdits_; }
    /// Looks whether the file has been edited, so that a frame is due.
    bool isEdited();
    /// Files from the network become part of the scene with their bytes, and so of logs and mirrors. Call it before
    /// load().
    void embedFetched() { embedsFetched_ = true; }
    /// Reads the file and reports its diagnostics. Returns false if nothing in it was usable.
    bool load();
    /// Call it instead of load() to go on with the session in a log, after its last state. start() is then the log's.
    Result<ResumedSession> resume(const std::string& log);
    /// From now on all Texts are measured, not only those whose size something in the scene uses.
    void measureAllTexts();
    /// Events with their times, as --set has them. Call it after load(). `end`: how long the scene will run, in
    /// seconds.
    Result<> inject(const std::vector<std::string>& events, double end);

    const std::string& file() const { return file_; }
    Scene& scene() { return scene_; }
    const Scene& scene() const { return scene_; }
    const Resources& resources() const { return resources_; }

    /// Errors of the file, when it was loaded.
    std::size_t errors() const { return errors_; }
    /// What the scene knows about where geometry is. Call it after load().
    WorldQueries& queries() { return *queries_; }
    /// For pictures, sound and pointer rays.
    WorldOnDemand& world() { return world_; }

    double start() const { return start_; }
    /// When the scene does something by itself next: Scene::restsUntil(), counted from the start.
    double restsUntil() const;
    /// Sets what is called before each frame, with its time.
    void beforeFrames(std::function<void(double t)> call) { before_ = std::move(call); }
    /// The time of the last frame.
    double time() const { return time_; }
    /// Runs one frame and returns its set. Inlines that it loads are published as sets of their own.
    std::shared_ptr<const ChangeSet> frame(double t);
    /// The same with a time on the scene's clock.
    void frameAt(double sceneTime) { frame(sceneTime - start_); }
    /// Runs frames from the present time to `seconds`, at the rate of `rtsg run`.
    void runTo(double seconds);
    /// Runs frames until `after`, which gets the frame's number and set, returns false. Returns their number.
    std::uint64_t run(const Pace& pace, const std::string& label,
                      const std::function<bool(std::uint64_t, const ChangeSet&)>& after);

    /// Reports the diagnostics since the last call, for those who do not wait for the end.
    void reportNews();
    /// Reports the diagnostics since load() that have not been reported. `known` is a subscriber's failure that the
    /// caller reports itself.
    void reportDiagnostics(std::string_view known = {});

  private:
    void followInlines();

    std::string file_;
    Resources resources_;
    SessionContext context_;
    std::string clip_;
    double start_, time_ = 0;
    std::size_t errors_ = 0;                                   // of the file, when it was loaded
    std::size_t reportedOfInlines_ = 0, reportedOfScene_ = 0;  // diagnostics
    bool startWasGiven_, followsEdits_ = false, embedsFetched_ = false;
    Scene scene_;
    Diagnostics inlineDiagnostics_;
    std::unique_ptr<FollowedFile> followed_;
    std::unique_ptr<InlineLoader> inlines_;
    std::unique_ptr<FetchedFiles> fetched_;
    WorldOnDemand world_;
    std::unique_ptr<WorldQueries> queries_;
    std::unique_ptr<RigidBodyPhysics> physics_;
    std::vector<std::string> allowedAddresses_;
    std::unique_ptr<DisNetwork> network_;
    std::unique_ptr<Injections> injections_;
    std::function<void(double t)> before_;
    Extensions::Attached subscribers_;  // of plug-ins
};

}  // namespace rtsg
