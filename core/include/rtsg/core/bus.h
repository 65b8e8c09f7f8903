// The change bus: one append-only sequence of sealed ChangeSets for each scene, and one cursor for each subscriber.
//
// Laws: a subscriber sees whole frames only, in order, each state exactly once. It never blocks the scene; a subscriber
// that is behind gets the sets it missed merged into one. A subscriber that throws or reports an error is detached and
// reported, and the others go on. All this holds inside apply as well, where a subscriber may edit, seal, run frames,
// attach and detach: the sets that it causes wait until all subscribers have the present one.
// Threading: publish, attach and the scene belong to one thread. Attachment::poll may run on one other thread, whose
// subscriber must then read only the ChangeSet, never the scene.

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
    /// Called for each set. On the scene's thread `scene` is in state `changes.to`, or ahead of it if another
    /// subscriber has edited it during this delivery; those edits come with the next set. So a node of `changes` may be
    /// gone (use Scene::find), and Scene::snapshot() may be of a later state than `changes.to`. The first set is a
    /// snapshot. A later snapshot means that a replica joined anew: forget what was before. `changes` is valid during
    /// the call; copy Values to keep them (this is cheap).
    virtual Result<> apply(const Scene& scene, const ChangeSet& changes) = 0;
    /// Called on the scene's thread when the scene is about to start over (Scene::reset) and is still as it was. Right
    /// after this call, sets that polled subscribers have not taken yet are dropped; a subscriber that needs them waits
    /// here until they are taken. It must not edit the scene.
    virtual void beforeRestart() {}
    virtual std::string subscriberName() const { return "subscriber"; }
};

enum class Delivery : std::uint8_t {
    immediate,  // applied inside newFrame, every frame
    polled,     // applied when poll() is called, with all sets since the last call merged
};

class Bus;

/// Detaches its subscriber when it is destroyed. Movable. It must not be polled after the scene's bus has ended, but
/// may be destroyed later.
class Attachment {
  public:
    Attachment() = default;
    Attachment(Attachment&&) noexcept;
    Attachment& operator=(Attachment&&) noexcept;
    ~Attachment();

    /// Applies everything that was not yet seen as one set. Returns true if there was something.
    bool poll();
    /// Applies the same changes set by set. If more than 256 sets waited, the older ones come first, merged into one
    /// set. Returns the number of sets.
    std::size_t drain();
    /// The number of the state after the last set that was handed out; 0 before the first.
    std::uint64_t sequence() const;
    bool attached() const;
    /// The reason why the bus detached it; empty if it did not.
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

    /// An immediate subscriber gets a snapshot at once, or, inside newFrame, when the frame is complete; a polled one
    /// finds a snapshot at its first poll. `subscriber` must outlive the attachment.
    Attachment attach(Subscriber& subscriber, Delivery delivery = Delivery::immediate);
    /// Called by the scene. A set that is published during a delivery waits for its turn. Sets that a polled subscriber
    /// has not taken yet are kept, and merged in steps by a thread of the bus, so memory grows with the scene and not
    /// with the lag.
    void publish(std::shared_ptr<const ChangeSet> set);
    /// The number of sets that have been handed out since the outermost publish began or that wait for it to end; 0
    /// outside of publish.
    std::size_t inDelivery() const;
    /// Called by the scene before it is reset; tells all subscribers.
    void beforeRestart();
    /// Called by the scene when it is reset: from then on no subscriber has seen anything.
    void restart();
    /// Sets the function that is told of each subscriber that is detached because it failed, on the thread where it
    /// failed. Without a reporter, or with an empty one, such failures are found in Scene::diagnostics(). As long as
    /// none was ever set (an empty one counts), a line on standard error tells of each failure, too.
    void setReporter(std::function<void(const Diagnostic&)> reporter);
    /// Moves the failures that were reported while there was no reporter, from any thread, to `into`; for
    /// Scene::diagnostics().
    void takeReports(Diagnostics& into);
    std::size_t subscribers() const;

  private:
    struct State;
    std::shared_ptr<State> state_;
};

}  // namespace rtsg
