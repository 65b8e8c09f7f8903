// The thread that writes a log of the records that its scene's follower hands over.
#include <rtsg/sync/record_log.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <utility>

#include <rtsg/core/change_composer.h>

#include "log_thread.h"

namespace rtsg {

namespace {

constexpr std::size_t kMaxWaiting = 128;                 // steps
constexpr auto kFirstWithin = std::chrono::seconds(10);  // for the first state, in case the disk hangs
constexpr std::uint64_t kMaxWaitingBytes = std::uint64_t{64} << 20;

std::uint64_t memoryOf(const RecordStep& step) {
    return (step.record ? memoryOf(*step.record) : 0) + (step.set ? step.set->changes.capacity() * sizeof(Change) : 0);
}

/// Only frames that create nodes rely on the type descriptions in earlier records.
bool createsNodes(const ChangeSet& set) {
    for (const Change& change : set.changes) {
        if (change.kind == ChangeKind::createNode) return true;
        if (change.kind != ChangeKind::defineType) return false;
    }
    return false;
}

}  // namespace

struct RecordLog::Impl final : LogThread {
    /// A step, or the place of a snapshot that was asked for and has not come yet.
    struct Entry {
        RecordStep step;
        bool isIt = false;
        bool isKeyframe = false;  // its set is the snapshot of the last state
        std::uint64_t state = 0;  // the state of the place
    };
    std::atomic<bool> wantsSnapshot{false};
    std::atomic<std::uint64_t> encoded{0};

    std::condition_variable come, gone;
    // Guarded by `mutex`.
    std::deque<Entry> waiting;
    std::uint64_t waitingBytes = 0;
    ChangeComposer late;             // frames merged behind all that wait
    bool isAsked = false;            // a snapshot was asked for and is not in the file yet; only one at a time
    Worker worker{"rtsg recorder"};  // last: its job uses the others

    // ---- with `mutex` held -----------------------------------------------------------------------------------
    bool hasRoom(std::uint64_t more) const {
        return waiting.empty() || (waiting.size() < kMaxWaiting && waitingBytes + more <= kMaxWaitingBytes);
    }
    void append(RecordStep step, bool isKeyframe = false) {
        waitingBytes += memoryOf(step);
        waiting.push_back({std::move(step), false, isKeyframe});
        come.notify_one();
    }
    /// Appends the merged frames as one step.
    void appendLate() {
        if (!late.empty()) append({nullptr, std::make_shared<const ChangeSet>(late.take())});
    }
    bool canGoOn() const { return waiting.empty() ? !late.empty() : !waiting.front().isIt; }

    /// Waits for room.
    void put(RecordStep step, bool isKeyframe = false) {
        std::unique_lock lock(mutex);
        const std::uint64_t more = memoryOf(step);
        gone.wait(lock, [&] { return ended || hasRoom(more); });
        if (!ended) append(std::move(step), isKeyframe);
    }

    /// Returns whether it is time for a snapshot, and if so notes that one was asked for.
    bool asks() {
        const std::scoped_lock lock(mutex);
        return !isAsked && (isAsked = wantsSnapshot.exchange(false));
    }
    void askNoMore() {
        const std::scoped_lock lock(mutex);
        isAsked = false;
    }

    // ---- the thread ------------------------------------------------------------------------------------------
    /// `isKeyframe` is true for a snapshot of the last state written. Other snapshots begin a session.
    Result<> write(const RecordStep& step, bool isKeyframe) {
        const bool begun = log->frames() > 0;
        if (step.record) return log->write(*step.record, step.set.get());
        if (!step.set->isSnapshot()) return log->write(*step.set);
        if (begun && isKeyframe) return log->writeSnapshot(*step.set);
        {
            const std::scoped_lock lock(mutex);
            starts += begun && acknowledged != 0;
        }
        return log->write(*step.set);
    }

    Result<> follow() override {
        std::unique_lock lock(mutex);
        for (;;) {
            come.wait(lock, [this] { return worker.stops() || canGoOn(); });
            if (waiting.empty()) appendLate();
            if (waiting.empty()) return {};
            const Entry entry = std::move(waiting.front());
            waiting.pop_front();
            if (entry.isIt) continue;  // the log ends before its snapshot has come
            waitingBytes -= memoryOf(entry.step);
            lock.unlock();
            if (auto ok = write(entry.step, entry.isKeyframe); !ok) return ok;
            wantsSnapshot = log->wantsSnapshot();  // looked at once `isAsked` is false again
            bytes = log->bytes();
            encoded = log->encoded();
            lock.lock();
            isAsked = isAsked && !entry.isKeyframe;
            acknowledged = entry.step.record ? entry.step.record->header.to : entry.step.set->to;
            if (heard) heard(starts, acknowledged);
            gone.notify_all();
        }
    }

    void afterEnd() override {
        waiting.clear();
        waitingBytes = 0;
        gone.notify_all();
    }
};

RecordLog::RecordLog(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
RecordLog::~RecordLog() {
    (void)stop();  // as in LogWriter, callers that want errors call it before
}

Result<std::unique_ptr<RecordLog>> RecordLog::start(const Scene& scene, const std::filesystem::path& file,
                                                    LogOptions options) {
    if (options.mode.mode == Mode::input)
        return fail("a log in input mode is written by a LogWriter on the scene itself", {}, file.string());
    auto impl = std::make_unique<Impl>();
    auto log = LogWriter::create(file, builtinTypes(), std::move(options));
    if (!log) return std::unexpected(log.error());
    impl->log = std::move(*log);
    impl->file = file.string();
    impl->worker.run([i = impl.get()] { i->run(); },
                     [i = impl.get()] {
                         const std::scoped_lock lock(i->mutex);
                         i->come.notify_one();
                     });
    impl->put({nullptr, std::make_shared<const ChangeSet>(scene.snapshot())});
    {
        std::unique_lock lock(impl->mutex);
        impl->gone.wait_for(lock, kFirstWithin, [i = impl.get()] { return i->ended || i->bytes > 0; });
    }
    return std::unique_ptr<RecordLog>(new RecordLog(std::move(impl)));
}

void RecordLog::add(const Scene& scene, const RecordStep& step) {
    Impl& s = *impl_;
    if (s.ended) return;
    const bool begins = step.set && step.set->isSnapshot();
    if (begins)
        s.put({nullptr, step.set});  // another session, whose types the log describes itself
    else
        s.put({step.record, step.record && !(step.set && createsNodes(*step.set)) ? nullptr : step.set});
    if (begins || !s.asks()) return;
    // A log must not go on from a state that differs from the origin's.
    const Hash128 origin = step.record ? step.record->header.hash : step.set->hash;
    if (scene.hash() == origin && !scene.hasUnsealedEdits())
        s.put({nullptr, std::make_shared<const ChangeSet>(scene.snapshot())}, true);
    else
        s.askNoMore();
}

bool RecordLog::addInPassing(const RecordStep& step, const ChangeSet& changes) {
    Impl& s = *impl_;
    if (s.ended) return false;
    const auto copy = [&] { return step.set ? step.set : std::make_shared<const ChangeSet>(changes); };
    const std::scoped_lock lock(s.mutex);
    if (changes.isSnapshot()) {
        s.appendLate();
        s.append({nullptr, copy()});
        return false;
    }
    RecordStep kept{step.record, step.record && !createsNodes(changes) ? nullptr : copy()};
    if (!s.late.empty() || !s.hasRoom(memoryOf(kept))) {
        ++s.merged;
        s.late.add(changes);
        return false;
    }
    s.append(std::move(kept));
    if (s.isAsked || !s.wantsSnapshot.exchange(false)) return false;
    s.isAsked = true;
    s.waiting.push_back({{}, true, true, changes.to});
    return true;
}

void RecordLog::giveSnapshot(std::uint64_t state, std::shared_ptr<const ChangeSet> snapshot) {
    Impl& s = *impl_;
    const std::scoped_lock lock(s.mutex);
    const auto isIt = [&](const Impl::Entry& entry) { return entry.isIt && entry.state == state; };
    const auto found = std::ranges::find_if(s.waiting, isIt);
    if (found == s.waiting.end()) return;
    if (snapshot) {
        found->isIt = false;
        found->step.set = std::move(snapshot);
        s.waitingBytes += memoryOf(found->step);
    } else {
        s.waiting.erase(found);
        s.isAsked = false;
    }
    s.come.notify_one();
}

void RecordLog::onAcknowledged(std::function<void(std::uint64_t start, std::uint64_t state)> heard) {
    Impl& s = *impl_;
    const std::scoped_lock lock(s.mutex);
    s.heard = std::move(heard);
    if (s.ended)
        s.reportEnd();
    else if (s.heard)
        s.heard(s.starts, s.acknowledged);
}
std::uint64_t RecordLog::merged() const {
    return impl_->merged;
}

std::uint64_t RecordLog::acknowledged() const {
    return impl_->acknowledged;
}
std::uint64_t RecordLog::bytes() const {
    return impl_->bytes;
}
std::uint64_t RecordLog::encoded() const {
    return impl_->encoded;
}

std::string RecordLog::failure() const {
    return impl_->ended ? impl_->failure() : std::string();
}

Result<> RecordLog::stop() {
    impl_->worker.stop();
    return impl_->outcome();
}

}  // namespace rtsg
