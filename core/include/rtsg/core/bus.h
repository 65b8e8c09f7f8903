// The change bus: one append-only run of sealed ChangeSets a scene, one cursor a subscriber.
//
// Laws: a subscriber sees whole frames only, in order, each state exactly once; it never blocks the scene; one
// that is behind gets the sets it missed merged into one. A subscriber that throws or reports an error is
// detached and reported, the others go on. This holds from within as well: a subscriber may edit, seal, run frames,
// attach and detach inside apply. The sets it causes wait until everybody has the present one.
// Threading: publish, attach and the scene belong to one thread; Attachment::poll may run on any one other
// thread, whose subscriber must then read only the ChangeSet, never the scene.

// Example:
//     #include <rtsg/core/scene.h>
//     struct Counter : rtsg::Subscriber {
//         std::size_t changes = 0;
//         rtsg::Result<> apply(const rtsg::Scene&, const rtsg::ChangeSet& set) override {
//             changes += set.changes.size();  // first a snapshot, then every frame
//             return {};
//         }
//     };
//     rtsg::Scene scene;
//     Counter counter;
//     const rtsg::Attachment attachment = scene.bus().attach(counter);
//     scene.newFrame(0);
#pragma once

#include <functional>
#include <memory>
#include <string>

#include <rtsg/core/change.h>
#include <rtsg/core/diagnostic.h>

namespace rtsg {

class Scene;

class Subscriber {
  public:
    virtual ~Subscriber() = default;
    /// On the scene's thread `scene` is in state `changes.to`; if another subscriber has edited it from within this
    /// delivery, it is ahead by those edits, which come with the next set. So a node of `changes` may be gone: use
    /// Scene::find; and Scene::snapshot() is of a later state than `changes.to`, which its number says. First comes a
    /// snapshot; another one later means: forget what was before (a replica joined anew). Changes are valid during the
    /// call; to keep Values, copy them (cheap).
    virtual Result<> apply(const Scene& scene, const ChangeSet& changes) = 0;
    /// On the scene's thread, when the scene is about to start over (Scene::reset) and still as it was: sets that
    /// polled subscribers have not taken yet are dropped right after this. A subscriber that needs them waits here
    /// until they are taken. Must not edit the scene.
    virtual void beforeRestart() {}
    virtual std::string subscriberName() const { return "subscriber"; }
};

enum class Delivery : std::uint8_t {
    immediate,  // applied inside newFrame, every frame
    polled,     // applied when poll() is called; what was missed comes merged
};

class Bus;

/// Detaches when destroyed. Movable. Must not outlive the scene's bus by being polled; destroying later is fine.
class Attachment {
  public:
    Attachment() = default;
    Attachment(Attachment&&) noexcept;
    Attachment& operator=(Attachment&&) noexcept;
    ~Attachment();

    /// Applies everything not yet seen as one set. Returns true if there was something.
    bool poll();
    /// Applies what poll() would, set by set. If more than 256 sets waited, the older ones come first, as one set that
    /// the bus has merged. Returns the number of sets.
    std::size_t drain();
    /// The state that the last set handed out led to; 0 before the first.
    std::uint64_t sequence() const;
    bool attached() const;
    /// Why the bus detached it, if it did.
    std::string failure() const;
    void detach();

    struct Cursor;

  private:
    friend class Bus;
    std::shared_ptr<Cursor> cursor_;
};

class Bus {
  public:
    explicit Bus(Scene& scene);
    ~Bus();
    Bus(const Bus&) = delete;
    Bus& operator=(const Bus&) = delete;

    /// The subscriber at once gets a snapshot (immediate) or finds one at its first poll; inside newFrame, when the
    /// frame is complete. `subscriber` must outlive the attachment.
    Attachment attach(Subscriber& subscriber, Delivery delivery = Delivery::immediate);
    /// Called by the scene; from within a delivery the set waits its turn. Sets that a polled subscriber has not taken
    /// yet are kept, and merged in steps by a thread of the bus's own: memory follows the scene and not the lag.
    void publish(std::shared_ptr<const ChangeSet> set);
    /// Sets handed out since the outermost publish began, and waiting for it; 0 outside of one.
    std::size_t inDelivery() const;
    /// Called by the scene before it is reset: tells all subscribers.
    void beforeRestart();
    /// Called by the scene when it is reset: nobody has seen anything yet.
    void restart();
    /// Hears of each subscriber that is detached because it failed, on the thread where it did. Without one, and when
    /// it is empty, they are found in Scene::diagnostics(); until one is set, an empty one say, a line on standard
    /// error tells of each, too.
    void setReporter(std::function<void(const Diagnostic&)> reporter);
    /// Moves what was reported from any thread, while there was no reporter, to `into`; for Scene::diagnostics().
    void takeReports(Diagnostics& into);
    std::size_t subscribers() const;

  private:
    struct State;
    std::shared_ptr<State> state_;
};

}  // namespace rtsg
