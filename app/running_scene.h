// A scene file as a verb runs it: the scene, what its urls may open, the Inlines that come and go while it runs, the
// events of --set, and what all of these have to say.
//
// Invariant: a frame is the same whichever verb runs it: the events that are due, the cascade, then the Inlines that
// the cascade asked for, whose content is in the scene (and with all subscribers) when the call returns. Times count
// from the start, which is start() on the scene's own clock. Threading: the scene's thread.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <rtsg/core/device_input.h>
#include <rtsg/dis/dis_network.h>
#include <rtsg/documents/scene_builder.h>
#include <rtsg/physics/rigid_body_physics.h>
#include <rtsg/sync/session.h>

#include "cli.h"
#include "injections.h"
#include "outputs.h"
#include "start_time.h"

namespace rtsg::app {

/// How far to run, and how.
struct Pace {
    double seconds = 1, framesPerSecond = 60;
    bool realtime = false;

    /// At k / framesPerSecond before `seconds`, and at `seconds`.
    std::uint64_t frames() const;
    double timeOf(std::uint64_t frame) const;
};

class RunningScene {
  public:
    /// Throws UsageError as ResourceArguments::ofFile() and StartTime::seconds().
    RunningScene(std::string file, const ResourceArguments& arguments, const StartTime& start);
    /// Ends the scene's programs, and prints the diagnostics of their shutdown().
    ~RunningScene();
    RunningScene(const RunningScene&) = delete;
    RunningScene& operator=(const RunningScene&) = delete;

    /// Before load(): addresses that DIS nodes may use; else none.
    void allowNetwork(const NetworkArguments& network) { allowedAddresses_ = network.dis; }
    /// Reads the file and prints its diagnostics. False if nothing usable was in it.
    bool load();
    /// Errors that load() has printed: the rest of the file is there.
    std::size_t errorsOfLoading() const { return errorsOfLoading_; }
    /// Instead of load(): goes on with the session in a log, at the time after its last state; start() is the log's.
    Result<ResumedSession> resume(const std::string& log);
    /// From now on all Texts say how large they are, not only those of which something in the scene may hear.
    void measureAllTexts();
    /// --set; after load(). `end`: seconds, how long it will run.
    Result<> inject(const std::vector<std::string>& events, double end);

    const std::string& file() const { return file_; }
    Scene& scene() { return scene_; }
    const Scene& scene() const { return scene_; }
    const Resources& resources() const { return resources_; }

    /// For pictures, sound and the rays of pointers.
    WorldOnDemand& world() { return world_; }

    double start() const { return start_; }
    /// When it does something by itself next, as Scene::restsUntil(), but counted from the start.
    double restsUntil() const;
    /// The time of the last frame.
    double time() const { return time_; }
    /// One frame. Returns its set; Inlines that were loaded are sets of their own, published as well.
    std::shared_ptr<const ChangeSet> frame(double t);
    /// The same by the scene's clock.
    void frameAt(double sceneTime) { frame(sceneTime - start_); }
    /// Frames from the present time to `seconds`, as even as those of `rtsg run`.
    void runTo(double seconds);
    /// Frames until `after` (given the frame's number and its set) says false. Returns how many there were.
    std::uint64_t run(const Pace& pace, const std::string& label,
                      const std::function<bool(std::uint64_t, const ChangeSet&)>& after);

    /// Prints the diagnostics since load(). `said` is the failure of a subscriber that the verb reports itself.
    void printDiagnostics(std::string_view said = {});

  private:
    void followInlines();

    std::string file_;
    Resources resources_;
    std::string clip_;
    double start_, time_ = 0;
    bool startWasGiven_;
    std::size_t errorsOfLoading_ = 0;
    Scene scene_;
    Diagnostics inlineDiagnostics_;
    std::unique_ptr<InlineLoader> inlines_;
    WorldOnDemand world_;
    std::unique_ptr<SpaceQueries> queries_;
    std::unique_ptr<RigidBodyPhysics> physics_;
    std::vector<std::string> allowedAddresses_;
    std::unique_ptr<DisNetwork> network_;
    Injections injections_;
};

}  // namespace rtsg::app
