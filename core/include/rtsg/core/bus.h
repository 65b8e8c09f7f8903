// The change bus: one append-only run of sealed ChangeSets a scene, one cursor a subscriber.
//
// Laws: a subscriber sees whole frames only, in order, each state exactly once; it never blocks the scene; one
// that is behind gets the sets it missed merged into one. A subscriber that throws or reports an error is
// detached and reported, the others go on.
// Threading: publish, attach and the scene belong to one thread; Attachment::poll may run on any one other
// thread, whose subscriber must then read only the ChangeSet, never the scene.
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
    /// On the scene's thread `scene` is in state `changes.to`. First comes a snapshot; another one later means: forget
    /// what was before (a replica joined anew). Changes are valid during the call; to keep Values, copy them (cheap).
    virtual Result<> apply(const Scene& scene, const ChangeSet& changes) = 0;
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
    /// As poll, but hands out the sets one by one, unmerged (a log wants every frame). Returns their number.
    std::size_t drain();
    /// The merged set is `sequence()` afterwards.
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

    /// The subscriber at once gets a snapshot (immediate) or finds one at its first poll. `subscriber` must outlive
    /// the attachment.
    Attachment attach(Subscriber& subscriber, Delivery delivery = Delivery::immediate);
    /// Called by the scene. Sets not yet polled by someone are kept; beyond `kept` of them a cursor's backlog is
    /// merged, so memory is bounded by the scene, not by the lag.
    void publish(std::shared_ptr<const ChangeSet> set);
    /// Called by the scene when it is reset: nobody has seen anything yet.
    void restart();
    void setReporter(std::function<void(const Diagnostic&)> reporter);
    std::size_t subscribers() const;

  private:
    struct State;
    std::shared_ptr<State> state_;
};

}  // namespace rtsg
