// The thread that logs from its own replica, the subscriber that wakes it, and the waits of the scene's thread.
#include <rtsg/sync/log_recorder.h>

#include <atomic>
#include <condition_variable>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/replica.h>

#include "log_thread.h"

namespace rtsg {

namespace {

/// States that a scene may be ahead of the log before it waits. The bus keeps more than that without merging.
constexpr std::uint64_t kMaxAhead = 128;

}  // namespace

struct LogRecorder::Impl final : LogThread {
    /// A state of the scene. Its number begins anew whenever the scene starts over.
    struct Heard {
        std::uint64_t start = 0, state = 0;
    };
    /// Runs on the scene's thread and wakes the recorder.
    struct Bell final : Subscriber {
        Impl& impl;
        std::atomic<std::uint64_t> rung{0};
        Heard reported;  // the last state it heard of; for the scene's thread only
        explicit Bell(Impl& i) : impl(i) {}
        /// An error makes the bus report to the application that the log has ended.
        Result<> apply(const Scene&, const ChangeSet& changes) override {
            if (impl.ended) return impl.outcome();
            const bool startsOver = changes.isSnapshot() && impl.runs && reported.state != 0;
            reported.start += startsOver;
            reported.state = changes.to;
            ring();
            // If somebody counts the starts, the recorder must see each of them.
            if (impl.runs && (impl.whenBehind == WhenBehind::wait || (startsOver && impl.notifies)))
                impl.waitForRoom(reported, changes.isSnapshot() ? 0 : kMaxAhead);
            return impl.ended ? impl.outcome() : Result<>();
        }
        /// Without this the bus would drop earlier states that are not in the file yet.
        void beforeRestart() override {
            if (impl.runs && (impl.whenBehind == WhenBehind::wait || impl.notifies)) impl.waitForRoom(reported, 0);
        }
        void ring() {
            rung.fetch_add(1, std::memory_order_release);
            rung.notify_one();
        }
        std::string subscriberName() const override { return "log " + impl.file; }
    };
    /// Runs on the recorder's thread after the log: what has come so far is in the file.
    struct Acknowledger final : Subscriber {
        Impl& impl;
        explicit Acknowledger(Impl& i) : impl(i) {}
        Result<> apply(const Scene& scene, const ChangeSet& changes) override {
            return impl.acknowledge(scene, changes);
        }
        std::string subscriberName() const override { return "log acknowledger"; }
    };

    WhenBehind whenBehind = WhenBehind::merge;
    std::uint64_t start = 0;           // state of the scene when the recorder was attached
    std::unique_ptr<Replica> replica;  // used by the recorder's thread only
    Bell bell{*this};
    Acknowledger acknowledger{*this};
    Attachment bellAttachment, logAttachment, acknowledgerAttachment;
    std::atomic<bool> notifies{false};  // somebody hears what is in the file
    mutable std::condition_variable progress;
    bool begun = false;              // guarded by mutex; the first state is in the file
    bool runs = false;               // for the scene's thread: the recorder's is there
    Worker worker{"rtsg recorder"};  // last: its job uses the others

    Result<> acknowledge(const Scene& scene, const ChangeSet& changes) {
        if (!logAttachment.attached()) return fail(logAttachment.failure(), {}, file);
        if (scene.hash() != changes.hash)
            return fail(fmt::format("the replica at state {} has hash {}, the scene had {}", changes.to,
                                    scene.hash().hex(), changes.hash.hex()));
        if (!changes.isSnapshot() && changes.to > changes.from + 1) merged += changes.to - changes.from - 1;
        const std::scoped_lock lock(mutex);
        if (changes.isSnapshot() && begun && acknowledged != 0) ++starts;
        begun = true;
        acknowledged = changes.to;
        bytes = log->bytes();
        if (heard) heard(starts, acknowledged);
        progress.notify_all();
        return {};
    }

    /// Blocks the scene's thread until at most so many states are not in the file.
    void waitForRoom(const Heard& reported, std::uint64_t maximum) const {
        std::unique_lock lock(mutex);
        progress.wait(lock, [&] {
            return ended || starts > reported.start ||
                   (starts == reported.start && acknowledged + maximum >= reported.state);
        });
    }

    Result<> follow() override {
        std::uint64_t rung = 0;
        // Takes everything as one set, because the log must not begin with the replica's empty state.
        replica->poll();
        if (const std::uint64_t first = replica->scene().sequence(); first > start) merged = first - start - 1;
        Bus& bus = replica->scene().bus();
        logAttachment = bus.attach(*log);
        acknowledgerAttachment = bus.attach(acknowledger);
        for (bool last = false; !last && acknowledgerAttachment.attached() && replica->attached();) {
            bell.rung.wait(rung, std::memory_order_acquire);
            rung = bell.rung.load(std::memory_order_acquire);
            last = worker.stops();
            replica->drain();
        }
        if (!acknowledgerAttachment.attached()) return fail(acknowledgerAttachment.failure(), {}, file);
        if (!replica->failure().empty()) return fail(replica->failure(), {}, file);
        return {};
    }

    void detach() override {
        acknowledgerAttachment = {};
        logAttachment = {};
    }
    void release() override {
        detach();
        replica.reset();
    }
    void afterEnd() override { progress.notify_all(); }
};

LogRecorder::LogRecorder(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

LogRecorder::~LogRecorder() {
    (void)stop();  // as in LogWriter, callers that want errors call it before
}

Result<std::unique_ptr<LogRecorder>> LogRecorder::start(Scene& scene, const std::filesystem::path& file,
                                                        LogOptions options, WhenBehind whenBehind) {
    if (options.mode.mode == Mode::input)
        return fail("a log in input mode is written by a LogWriter on the scene itself", {}, file.string());
    auto impl = std::make_unique<Impl>();
    auto log = LogWriter::create(file, builtinTypes(), std::move(options));
    if (!log) return std::unexpected(log.error());
    impl->log = std::move(*log);
    impl->file = file.string();
    impl->replica = std::make_unique<Replica>(scene);
    impl->start = scene.sequence();
    impl->bellAttachment = scene.bus().attach(impl->bell);
    impl->whenBehind = whenBehind;
    impl->runs = true;
    impl->worker.run([i = impl.get()] { i->run(); }, [i = impl.get()] { i->bell.ring(); });
    if (whenBehind == WhenBehind::wait) {
        std::unique_lock lock(impl->mutex);
        impl->progress.wait(lock, [i = impl.get()] { return i->ended || i->begun; });
    }
    return std::unique_ptr<LogRecorder>(new LogRecorder(std::move(impl)));
}

std::uint64_t LogRecorder::acknowledged() const {
    return impl_->acknowledged;
}
std::uint64_t LogRecorder::merged() const {
    return impl_->merged;
}
std::uint64_t LogRecorder::bytes() const {
    return impl_->bytes;
}

void LogRecorder::onAcknowledged(std::function<void(std::uint64_t start, std::uint64_t state)> heard) {
    const std::scoped_lock lock(impl_->mutex);
    impl_->heard = std::move(heard);
    impl_->notifies = impl_->heard != nullptr;
    if (impl_->ended)
        impl_->reportEnd();
    else if (impl_->begun && impl_->heard)
        impl_->heard(impl_->starts, impl_->acknowledged);
}

bool LogRecorder::waitFor(std::uint64_t state, std::chrono::milliseconds timeout) const {
    std::unique_lock lock(impl_->mutex);
    impl_->progress.wait_for(lock, timeout, [&] { return impl_->acknowledged >= state || impl_->ended; });
    return impl_->acknowledged >= state;
}

std::string LogRecorder::failure() const {
    return impl_->failure();
}

Result<> LogRecorder::stop() {
    if (std::exchange(impl_->runs, false)) impl_->bellAttachment.detach();
    impl_->worker.stop();
    return impl_->outcome();
}

}  // namespace rtsg
