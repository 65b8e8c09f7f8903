// SceneHandle: a scene as Python holds it: the scene itself with all that runs in it, its world, its renderers, its
// subscribers in Python, and what else hangs on it.
//
// Invariant: nothing is called on a scene that is closed, or from another thread than its own: both raise. Whatever
// hangs on the scene ends before it does. Threading: with the interpreter's lock, on the scene's thread, unless said.
#pragma once

#include <pybind11/pybind11.h>

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <rtsg/core/device_input.h>
#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>
#include <rtsg/documents/scene_builder.h>
#include <rtsg/physics/rigid_body_physics.h>
#include <rtsg/renderers/light_renderer.h>
#include <rtsg/renderers/world_queries.h>

#include "own_nodes.h"
#include "unlocked.h"

namespace rtsg::python {

class SceneHandle;

/// An object that must end before its scene, such as a server or a log.
class Dependent {
  public:
    virtual ~Dependent() = default;
    virtual void end() noexcept = 0;
    /// Forgets its resources without ending them: in a forked process, whose threads are gone.
    virtual void abandon() noexcept = 0;
    /// Called before each frame, without the interpreter's lock.
    virtual void beforeFrame() {}
};

/// A subscriber that is a function of Python.
class Subscription final : public Subscriber {
  public:
    Subscription(SceneHandle& handle, pybind11::function call);
    ~Subscription() override;
    /// Attaches; the function gets the snapshot at once.
    void begin();
    Result<> apply(const Scene& scene, const ChangeSet& changes) override;
    std::string subscriberName() const override { return name_; }
    bool active() const { return attachment_.attached(); }
    /// Lets go of the function, too, and the scene of this: whoever calls it holds it.
    void end();
    /// In a process that was forked, see Dependent::abandon().
    void leave() { handle_ = nullptr; }
    const pybind11::function& call() const { return call_; }
    const pybind11::object& error() const { return error_; }

  private:
    SceneHandle* handle_;  // null once it has ended
    pybind11::function call_;
    pybind11::object error_ = pybind11::none();
    std::string name_;
    Attachment attachment_;
};

class SceneHandle : public std::enable_shared_from_this<SceneHandle> {
  public:
    /// The arguments of a scene's constructor.
    struct Options {
        Resources resources;
        std::filesystem::path file;  // empty: of no file
        bool scripts = true;
    };
    /// An empty scene of its own in which documents are read, Scripts run and bodies move.
    static std::shared_ptr<SceneHandle> make(Options options);
    /// An empty scene of its own that follows another one.
    static std::shared_ptr<SceneHandle> makeReplica(Options options);
    /// A scene that `keeper` owns.
    static std::shared_ptr<SceneHandle> borrow(Scene& scene, std::shared_ptr<void> keeper, Options options,
                                               bool readOnly);
    ~SceneHandle();
    SceneHandle(const SceneHandle&) = delete;
    SceneHandle& operator=(const SceneHandle&) = delete;

    /// For reading. Raises Closed, WrongThread.
    Scene& scene() const;
    /// Not within a frame: for what looks at whole states. Raises from the functions of node types.
    Scene& between() const;
    /// The same for edits, which raise where the scene is another's copy.
    Scene& edited() const;
    bool isClosed() const { return scene_ == nullptr; }
    bool isReadOnly() const { return readOnly_; }
    /// It is not closed, and this is its thread.
    bool isHere() const { return scene_ && scene_->isOwnThread(); }
    /// Ends all that hangs on it, then the scene; warns of what went wrong in that. Raises WrongThread, and Error from
    /// within a call.
    void close();
    /// While one lives, a call is going on that has functions of Python called, and needs the scene after them.
    class Within {
      public:
        explicit Within(const SceneHandle& handle) : handle_(handle) { ++handle_.within_; }
        ~Within() { --handle_.within_; }
        Within(const Within&) = delete;
        Within& operator=(const Within&) = delete;

      private:
        const SceneHandle& handle_;
    };
    void refuseFromWithin(const char* what) const;
    /// Work on the scene without the interpreter's lock.
    template <class Work>
    auto work(Work&& work) const {
        const Within within(*this);
        return unlocked(std::forward<Work>(work));
    }
    /// Ends it from whatever thread, for one that nobody has any more; or forgets it, see Dependent::abandon().
    void end() noexcept;
    void abandon() noexcept;
    /// All that live, for the end of the interpreter and for forks.
    static std::vector<std::shared_ptr<SceneHandle>> all();

    /// Runs a frame. Raises where the scene would only note that it is refused: time that goes back, a call from
    /// within a frame; then what subscribers raised.
    std::shared_ptr<const ChangeSet> frame(double t);
    std::shared_ptr<const ChangeSet> seal();
    /// Follows Inlines from now on: after the document was read.
    void follow();

    /// The world, made when it is first asked for.
    SharedWorld& world();
    LightRenderer& light();
    const Resources& resources() const { return options_.resources; }
    const std::filesystem::path& file() const { return options_.file; }
    /// A world whose curves are cut for measurements with this `ofRadius`.
    struct Measured {
        explicit Measured(SceneHandle& handle, float ofRadius);
        SharedWorld world;
        LightTracer tracer;
        float ofRadius;
    };
    Measured& measured(float ofRadius);

    std::shared_ptr<Subscription> subscribe(pybind11::function call);
    void forget(const Subscription& subscription);
    /// Keeps an exception of a subscriber in Python; raisePending() raises it again when the delivery is over.
    void keep(pybind11::error_already_set error);
    void raisePending();
    /// Warns of what scene and loader have said since the last call.
    void report();
    const Diagnostics& said() const { return said_; }
    void say(const Diagnostics& more) { said_.append(more); }
    /// From any thread: told with the next frame, or at the end.
    void note(const Diagnostic& failure);

    /// Keeps behaviours as long as the scene, whose types call them.
    void keep(std::unique_ptr<OwnBehaviour> behaviour) { behaviours_.push_back(std::move(behaviour)); }

    void add(Dependent& dependent) { dependents_.push_back(&dependent); }
    /// The scene keeps it until it is removed or the scene ends, whoever else holds it.
    void own(std::shared_ptr<Dependent> dependent);
    void remove(Dependent& dependent);

    int traverse(visitproc visit, void* arg);
    void clear();

  private:
    SceneHandle(Scene& scene, std::shared_ptr<void> keeper, Options options, bool readOnly);
    void endDependents() noexcept;
    void takeFailures();

    Scene* scene_;
    std::shared_ptr<void> keeper_;
    Options options_;
    bool readOnly_, ran_ = false;
    mutable int within_ = 0;
    Diagnostics said_;
    std::size_t reported_ = 0, reportedOfScene_ = 0;
    Diagnostics inlineDiagnostics_;
    std::unique_ptr<InlineLoader> inlines_;
    std::unique_ptr<RigidBodyPhysics> physics_;
    std::unique_ptr<SpaceQueries> queries_;
    std::unique_ptr<SharedWorld> world_;
    std::unique_ptr<LightRenderer> light_;
    std::unique_ptr<Measured> measured_;
    std::vector<std::shared_ptr<Subscription>> subscriptions_;
    std::vector<std::unique_ptr<OwnBehaviour>> behaviours_;
    std::vector<pybind11::error_already_set> pending_;
    std::vector<Dependent*> dependents_;
    std::vector<std::shared_ptr<Dependent>> owned_;  // of them
    /// Failures of other subscribers, from whatever thread.
    struct Reports {
        std::mutex mutex;
        std::vector<Diagnostic> failures;
    };
    std::shared_ptr<Reports> reports_ = std::make_shared<Reports>();
};

/// The Scene object of Python that stands for it.
pybind11::object objectOf(SceneHandle& handle);

}  // namespace rtsg::python
