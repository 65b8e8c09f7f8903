// Hands out sealed sets: to immediate subscribers at once, into a backlog for those that poll, which a thread of its
// own keeps short. Sets that are sealed while another is handed out wait in a queue, so that everybody gets every set
// in order.
#include <rtsg/core/bus.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <exception>
#include <mutex>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/change_composer.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/worker.h>

namespace rtsg {

namespace {

/// A cursor keeps this many sets as they are. Older ones are merged by the merger, which is woken when this many more
/// wait. If the merger is late, the scene's thread merges the sets beyond the last of these numbers.
constexpr std::size_t kBacklog = 256, kOverdue = 320, kMax = 384;

constexpr const char* kUnmerged = "there was no memory to merge what it had not taken";

/// Reports subscribers that failed, on whatever thread.
class Reports {
  public:
    void setReporter(std::function<void(const Diagnostic&)> reporter) {
        const std::scoped_lock lock(mutex_);
        reporter_ = std::move(reporter);
        chosen_ = true;
    }
    void report(Diagnostic diagnostic) {
        std::function<void(const Diagnostic&)> reporter;
        {
            const std::scoped_lock lock(mutex_);
            if (!reporter_) {
                // Who chose nothing might look nowhere, and wonder why the subscriber gets no more sets.
                if (!chosen_) notify(diagnostic);
                return kept_.add(std::move(diagnostic));
            }
            reporter = reporter_;
        }
        reporter(diagnostic);  // without the lock: it may set another one
    }
    void takeKept(Diagnostics& into) {
        const std::scoped_lock lock(mutex_);
        if (kept_.errors() == 0) return;
        into.append(kept_);
        kept_ = Diagnostics();
    }

  private:
    /// A text may be a scene's: nothing in it gives a terminal orders (C0, and C1 in UTF-8).
    static void notify(const Diagnostic& diagnostic) {
        std::string line = diagnostic.format();
        for (std::size_t i = 0; i < line.size(); ++i) {
            const auto byte = static_cast<unsigned char>(line[i]);
            const bool second = i > 0 && line[i - 1] == '\xc2' && byte >= 0x80 && byte < 0xa0;
            if (byte < 0x20 || byte == 0x7f) line[i] = '?';
            if (second) line[i - 1] = line[i] = '?';
        }
        line += '\n';
        std::fputs(line.c_str(), stderr);  // unlike fmt::print() it does not throw where that takes nothing
    }

    std::mutex mutex_;
    std::function<void(const Diagnostic&)> reporter_;
    bool chosen_ = false;  // a reporter, or none
    Diagnostics kept_;
};

using Sets = std::vector<std::shared_ptr<const ChangeSet>>;

/// The sets that a polled subscriber has not taken yet, oldest first: some merged into one, then sets as they came. The
/// composer belongs to whoever holds the cursor's `merging`, everything else to whoever holds its `mutex`.
class Backlog {
  public:
    /// No set waits. Merged sets always have others after them.
    bool empty() const { return waiting() == 0; }
    /// The state that the newest set leads to. Precondition: !empty().
    std::uint64_t to() const { return sets_.back()->to; }
    std::size_t waiting() const { return sets_.size() - first_; }
    void add(std::shared_ptr<const ChangeSet> set) { sets_.push_back(std::move(set)); }
    void clear() {
        sets_.clear();
        first_ = 0;
        ++generation_;
    }

    /// The oldest set, to be merged next. Precondition: waiting() > 0.
    std::shared_ptr<const ChangeSet> oldest() const { return sets_[first_]; }
    std::uint64_t generation() const { return generation_; }
    /// Only `merging` is held: nobody else has the set and the composer.
    void merge(const ChangeSet& set, std::uint64_t generation) {
        freshen(generation);
        merged_->add(set);
    }
    /// The oldest set is merged, unless all has been cleared meanwhile.
    void dropOldest(std::uint64_t generation) {
        if (generation != generation_) return;
        sets_[first_++].reset();
        if (first_ < kBacklog) return;
        sets_.erase(sets_.begin(), sets_.begin() + static_cast<std::ptrdiff_t>(first_));
        first_ = 0;
    }
    /// Hands over the merged set, for an empty composer, and the sets after it.
    void takeInto(std::unique_ptr<ChangeComposer>& merged, Sets& sets) {
        freshen(generation_);
        merged_.swap(merged);
        sets_.swap(sets);
        sets.erase(sets.begin(), sets.begin() + static_cast<std::ptrdiff_t>(std::exchange(first_, 0)));
    }

  private:
    /// Drops from the composer what clear() was meant to drop: only now is the caller allowed to touch it.
    void freshen(std::uint64_t generation) {
        if (std::exchange(mergedOf_, generation) != generation) merged_ = std::make_unique<ChangeComposer>();
    }

    std::unique_ptr<ChangeComposer> merged_ = std::make_unique<ChangeComposer>();  // what came before sets_
    std::uint64_t mergedOf_ = 0;                                                   // the generation it is of
    std::uint64_t generation_ = 0;                                                 // counts clear()
    Sets sets_;
    std::size_t first_ = 0;  // those before are in merged_
};

}  // namespace

struct Attachment::Cursor {
    Subscriber* subscriber = nullptr;
    const Scene* scene = nullptr;
    Delivery delivery = Delivery::immediate;
    std::shared_ptr<Reports> reports;
    bool joining = false;  // gets its snapshot when there is a state to tell; the scene's thread only

    std::mutex merging;     // is locked before `mutex`; see Backlog
    std::mutex mutex;       // guards everything below, but for the polling thread's own
    bool overdue = false;   // the merger knows
    bool unmerged = false;  // detached for kUnmerged, and nobody told yet
    bool attached = true;
    std::string failure;
    std::uint64_t seen = 0;
    bool restarted = false;  // the next set counts whatever its number
    Backlog backlog;

    // The polling thread's own: memory that is used again with every poll.
    Sets taken;
    std::unique_ptr<ChangeComposer> composer = std::make_unique<ChangeComposer>();
    ChangeSet merged;

    /// A subscriber's exceptions never cross the bus.
    template <typename Call>
    static Result<> guarded(Call&& call) {
        try {
            return call();
        } catch (const std::exception& e) {
            return fail(e.what());
        } catch (...) {
            return fail("unknown exception");
        }
    }
    /// False, and the subscriber is detached and reported, if it fails.
    bool deliver(const ChangeSet& set) {
        const Result<> result = guarded([&] { return subscriber->apply(*scene, set); });
        {
            const std::scoped_lock lock(mutex);
            seen = set.to;
        }
        if (!result) detachFailed(result.error().text);
        return result.has_value();
    }
    void reportBeforeRestart() {
        {
            const std::scoped_lock lock(mutex);
            if (!attached) return;
        }
        const Result<> result = guarded([&] { return subscriber->beforeRestart(), Result<>(); });
        if (!result) detachFailed(result.error().text);
    }
    void detachFailed(const std::string& why) {
        {
            const std::scoped_lock lock(mutex);
            attached = false;
            failure = why;
            backlog.clear();
        }
        reports->report({Severity::error, subscriber->subscriberName(), {}, "detached: " + why});
    }
    /// Leaves the merged part in `composer`, the rest in the result. Give it back with putBack: a subscriber may poll
    /// from within its own apply.
    Sets takeBacklog() {
        Sets sets = std::move(taken);
        sets.clear();
        const std::scoped_lock held(merging);
        const std::scoped_lock lock(mutex);
        if (attached) backlog.takeInto(composer, sets);
        return sets;
    }
    /// Merges one set if more than kBacklog wait; false: they do not. On any thread.
    bool mergeOldest() {
        const std::scoped_lock held(merging);
        std::shared_ptr<const ChangeSet> set;
        std::uint64_t generation = 0;
        {
            const std::scoped_lock lock(mutex);
            if (!attached || backlog.waiting() <= kBacklog) {
                overdue = false;
                return false;
            }
            set = backlog.oldest();
            generation = backlog.generation();
        }
        try {
            backlog.merge(*set, generation);
        } catch (...) {
            const std::scoped_lock lock(mutex);
            overdue = false;
            if (attached) unmerged = true, attached = false;
            backlog.clear();
            return false;
        }
        const std::scoped_lock lock(mutex);
        backlog.dropOldest(generation);
        return true;
    }
    /// Reports a subscriber whose sets could not be merged. The scene's thread does so, since the merger's may lack the
    /// memory.
    void reportUnmerged() {
        std::string name;
        {
            const std::scoped_lock lock(mutex);
            if (!std::exchange(unmerged, false)) return;
            name = subscriber->subscriberName();
            failure = kUnmerged;
        }
        reports->report({Severity::error, name, {}, std::string("detached: ") + kUnmerged});
    }
    void putBack(Sets sets) {
        sets.clear();
        taken = std::move(sets);
    }
    /// Everything that `composer` holds and these sets, as one.
    bool deliverMerged(Sets& sets) {
        for (const auto& set : sets) composer->add(*set);
        ChangeSet whole = std::move(merged);
        composer->take(whole, scene);
        sets.clear();  // their memory can go back to the scene's pool
        const bool ok = deliver(whole);
        whole.clear();
        merged = std::move(whole);
        return ok;
    }
};

struct Bus::State {
    Scene* scene = nullptr;
    std::vector<std::shared_ptr<Attachment::Cursor>> cursors;
    std::shared_ptr<Reports> reports = std::make_shared<Reports>();
    Sets waiting;  // sealed from within a delivery, in order
    bool delivering = false;
    std::size_t handedOut = 0;  // since the outermost publish began
    std::size_t restarts = 0;
    std::size_t joining = 0;  // cursors that wait for their snapshot
    /// Merges sets for cursors that are not polled, so that it costs the scene nothing.
    Worker merger{"rtsg merger"};

    bool give(const std::shared_ptr<Attachment::Cursor>& cursor, const std::shared_ptr<const ChangeSet>& set);
    bool join(Attachment::Cursor& cursor);
    void joinAll();
    void handOut(const std::shared_ptr<const ChangeSet>& set);
    void removeDetached();
};

/// False if the subscriber is not, or no longer, attached.
bool Bus::State::give(const std::shared_ptr<Attachment::Cursor>& to, const std::shared_ptr<const ChangeSet>& set) {
    Attachment::Cursor& cursor = *to;
    std::size_t behind = 0;
    bool wake = false;
    {
        std::unique_lock lock(cursor.mutex);
        if (!cursor.attached) {
            lock.unlock();
            cursor.reportUnmerged();
            return false;
        }
        const std::uint64_t have = cursor.backlog.empty() ? cursor.seen : cursor.backlog.to();
        // A set that leads to the state it starts from repairs faults in that state.
        const bool repairs = set->from == set->to && have == set->to && have != 0;
        if (have >= set->to && !repairs && !cursor.restarted) return true;
        cursor.restarted = false;
        if (cursor.delivery == Delivery::polled) {
            cursor.backlog.add(set);
            behind = cursor.backlog.waiting();
            if (behind <= kOverdue) return true;
            wake = !std::exchange(cursor.overdue, true);
        }
    }
    if (cursor.delivery == Delivery::immediate) return cursor.deliver(*set);
    if (wake)
        merger.start([this, to] {
            while (!merger.stops() && to->mergeOldest()) continue;
        });
    if (behind > kMax) cursor.mergeOldest();
    return true;
}

/// Gives the cursor the scene as it is now. Precondition: nothing is pending.
bool Bus::State::join(Attachment::Cursor& cursor) {
    auto snapshot = std::make_shared<const ChangeSet>(scene->snapshot());
    {
        const std::scoped_lock lock(cursor.mutex);
        if (!cursor.attached) return false;
        if (cursor.delivery == Delivery::polled) {
            cursor.backlog.add(std::move(snapshot));
            return true;
        }
    }
    return cursor.deliver(*snapshot);
}

void Bus::State::joinAll() {
    joining = 0;
    for (std::size_t i = 0; i < cursors.size(); ++i) {
        const auto cursor = cursors[i];
        if (!cursor->joining) continue;
        scene->seal();  // what another that joins has edited from within
        cursor->joining = scene->hasUnsealedEdits();
        if (cursor->joining)
            ++joining;
        else
            join(*cursor);
    }
}

void Bus::State::handOut(const std::shared_ptr<const ChangeSet>& set) {
    if (joining != 0) joinAll();
    // The loop goes by index, as a subscriber may attach or detach others while it runs; one that attaches has this
    // state already.
    bool anyGone = false;
    const std::size_t count = cursors.size(), before = restarts;
    for (std::size_t i = 0; i < count; ++i) {
        const auto cursor = cursors[i];
        anyGone |= !give(cursor, set);
        if (restarts != before) break;  // the scene starts over: this set is about one that is gone
    }
    if (anyGone) removeDetached();
}

void Bus::State::removeDetached() {
    std::erase_if(cursors, [](const auto& cursor) {
        const std::scoped_lock lock(cursor->mutex);
        return !cursor->attached;
    });
}

Bus::Bus(Scene& scene) : state_(std::make_shared<State>()) {
    state_->scene = &scene;
}

Bus::~Bus() {
    for (const auto& cursor : state_->cursors) {
        const std::scoped_lock lock(cursor->mutex);
        cursor->attached = false;
    }
}

Attachment Bus::attach(Subscriber& subscriber, Delivery delivery) {
    State& s = *state_;
    auto cursor = std::make_shared<Attachment::Cursor>();
    cursor->subscriber = &subscriber;
    cursor->scene = s.scene;
    cursor->delivery = delivery;
    cursor->reports = s.reports;
    Attachment attachment;
    attachment.cursor_ = cursor;
    s.scene->seal();  // pending edits would otherwise come twice: in the snapshot and in the next set
    if (s.scene->isInFrame() || s.scene->hasUnsealedEdits()) {
        cursor->joining = true;
        ++s.joining;
    } else if (!s.join(*cursor)) {
        return attachment;
    }
    s.cursors.push_back(std::move(cursor));
    return attachment;
}

void Bus::publish(std::shared_ptr<const ChangeSet> set) {
    State& s = *state_;
    if (s.delivering) return s.waiting.push_back(std::move(set));
    s.delivering = true;
    s.handedOut = 1;
    s.handOut(set);
    while (!s.waiting.empty()) {
        const auto next = std::move(s.waiting.front());
        s.waiting.erase(s.waiting.begin());
        ++s.handedOut;
        s.handOut(next);
    }
    s.delivering = false;
}

std::size_t Bus::inDelivery() const {
    return state_->delivering ? state_->handedOut + state_->waiting.size() : 0;
}

void Bus::beforeRestart() {
    // The loop goes by index, as a subscriber may detach others, or attach them.
    for (std::size_t i = 0; i < state_->cursors.size(); ++i) {
        const auto cursor = state_->cursors[i];
        cursor->reportBeforeRestart();
    }
}

void Bus::restart() {
    ++state_->restarts;
    state_->waiting.clear();
    for (const auto& cursor : state_->cursors) {
        const std::scoped_lock lock(cursor->mutex);
        cursor->seen = 0;
        cursor->restarted = true;
        cursor->backlog.clear();
    }
}

void Bus::setReporter(std::function<void(const Diagnostic&)> reporter) {
    state_->reports->setReporter(std::move(reporter));
}

void Bus::takeReports(Diagnostics& into) {
    state_->reports->takeKept(into);
}

std::size_t Bus::subscribers() const {
    std::size_t count = 0;
    for (const auto& cursor : state_->cursors) {
        const std::scoped_lock lock(cursor->mutex);
        count += cursor->attached ? 1 : 0;
    }
    return count;
}

Attachment::Attachment(Attachment&&) noexcept = default;
Attachment& Attachment::operator=(Attachment&& other) noexcept {
    if (this != &other) {
        detach();
        cursor_ = std::move(other.cursor_);
    }
    return *this;
}
Attachment::~Attachment() {
    detach();
}

void Attachment::detach() {
    if (!cursor_) return;
    const std::scoped_lock lock(cursor_->mutex);
    cursor_->attached = cursor_->unmerged = false;
    cursor_->backlog.clear();
}

bool Attachment::poll() {
    if (!cursor_) return false;
    const auto cursor = cursor_;  // a subscriber may detach itself
    auto sets = cursor->takeBacklog();
    const bool any = !sets.empty();  // a merged set has sets after it
    if (sets.size() == 1 && cursor->composer->empty())
        cursor->deliver(*sets.front());
    else if (any)
        cursor->deliverMerged(sets);
    cursor->putBack(std::move(sets));
    return any;
}

std::size_t Attachment::drain() {
    if (!cursor_) return 0;
    const auto cursor = cursor_;
    auto sets = cursor->takeBacklog();
    std::size_t count = 0;
    bool ok = true;
    if (!cursor->composer->empty()) {
        Sets none;
        ++count;
        ok = cursor->deliverMerged(none);
    }
    for (std::size_t i = 0; ok && i < sets.size(); ++i, ++count) ok = cursor->deliver(*sets[i]);
    cursor->putBack(std::move(sets));
    return count;
}

std::uint64_t Attachment::sequence() const {
    if (!cursor_) return 0;
    const std::scoped_lock lock(cursor_->mutex);
    return cursor_->seen;
}

bool Attachment::attached() const {
    if (!cursor_) return false;
    const std::scoped_lock lock(cursor_->mutex);
    return cursor_->attached;
}

std::string Attachment::failure() const {
    if (!cursor_) return {};
    const std::scoped_lock lock(cursor_->mutex);
    return cursor_->unmerged ? kUnmerged : cursor_->failure;
}

}  // namespace rtsg
