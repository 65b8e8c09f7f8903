// LogRecorder: a thread that writes what the bus delivers, and reports what is safely on disk.
#include <rtsg/sync/log_recorder.h>

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>

#include <fmt/format.h>

#include <rtsg/core/replica.h>

namespace rtsg {

namespace {
/// Fewer than the bus keeps unmerged.
constexpr std::uint64_t kMostWaiting = 128;
}  // namespace

struct LogRecorder::Impl {
    /// On the scene's thread: there is something to fetch.
    struct Bell final : Subscriber {
        Impl& impl;
        std::atomic<std::uint64_t> rung{0};
        explicit Bell(Impl& i) : impl(i) {}
        /// An error here has the bus report to the application that the log has ended.
        Result<> apply(const Scene&, const ChangeSet& changes) override {
            ring();
            if (impl.whenBehind == WhenBehind::wait && !changes.isSnapshot()) impl.waitUntilNear(changes.to);
            if (!impl.failed) return {};
            const std::scoped_lock lock(impl.mutex);
            return impl.result;
        }
        void ring() {
            rung.fetch_add(1, std::memory_order_release);
            rung.notify_one();
        }
        std::string subscriberName() const override { return "log " + impl.file; }
    };
    /// On the recorder's thread, behind the log: what has come so far is in the file.
    struct Acknowledger final : Subscriber {
        Impl& impl;
        explicit Acknowledger(Impl& i) : impl(i) {}
        Result<> apply(const Scene& scene, const ChangeSet& changes) override {
            return impl.acknowledge(scene, changes);
        }
        std::string subscriberName() const override { return "log acknowledger"; }
    };

    std::string file;
    WhenBehind whenBehind = WhenBehind::merge;
    std::uint64_t start = 0;  // state of the scene when the recorder was attached
    std::unique_ptr<LogWriter> log;
    std::unique_ptr<Replica> replica;  // the recorder's thread's own
    Bell bell{*this};
    Acknowledger acknowledger{*this};
    Attachment bellAttachment, logAttachment, acknowledgerAttachment;
    std::atomic<bool> stopping{false}, failed{false}, begun{false};
    std::atomic<std::uint64_t> acknowledged{0}, merged{0}, bytes{0};
    mutable std::mutex mutex;
    mutable std::condition_variable progress;
    Result<> result;  // guarded by mutex
    std::thread thread;

    Result<> acknowledge(const Scene& scene, const ChangeSet& changes) {
        if (!logAttachment.attached()) return fail(logAttachment.failure());
        if (scene.hash() != changes.hash)
            return fail(fmt::format("the replica at state {} has hash {}, the scene had {}", changes.to,
                                    scene.hash().hex(), changes.hash.hex()));
        if (!changes.isSnapshot() && changes.to > changes.from + 1) merged += changes.to - changes.from - 1;
        const std::scoped_lock lock(mutex);
        acknowledged = changes.to;
        bytes = log->bytes();
        progress.notify_all();
        return {};
    }

    void waitUntilNear(std::uint64_t state) const {
        std::unique_lock lock(mutex);
        progress.wait(lock, [&] { return failed || acknowledged + kMostWaiting >= state; });
    }
    /// The first state is written: from here on none is taken together with another.
    void waitUntilBegun() const {
        std::unique_lock lock(mutex);
        progress.wait(lock, [&] { return failed || begun; });
    }

    void run() {
        Result<> ended;
        std::uint64_t heard = 0;
        // As one set: an empty replica is no state of the scene's, and the log shall begin with one.
        replica->poll();
        if (const std::uint64_t first = replica->scene().sequence(); first > start) merged = first - start - 1;
        Bus& bus = replica->scene().bus();
        logAttachment = bus.attach(*log);
        acknowledgerAttachment = bus.attach(acknowledger);
        {
            const std::scoped_lock lock(mutex);
            begun = true;
            progress.notify_all();
        }
        for (bool last = false; !last && acknowledgerAttachment.attached() && replica->attached();) {
            bell.rung.wait(heard, std::memory_order_acquire);
            heard = bell.rung.load(std::memory_order_acquire);
            last = stopping;
            replica->drain();
        }
        if (!acknowledgerAttachment.attached())
            ended = fail(acknowledgerAttachment.failure());
        else if (!replica->failure().empty())
            ended = fail(replica->failure());
        acknowledgerAttachment.detach();
        logAttachment.detach();
        if (auto ok = log->close(); !ok && ended) ended = ok;
        replica.reset();
        const std::scoped_lock lock(mutex);
        result = ended;
        failed = !ended;
        bytes = log->bytes();
        progress.notify_all();
    }
};

LogRecorder::LogRecorder(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

LogRecorder::~LogRecorder() {
    (void)stop();
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
    impl->whenBehind = whenBehind;
    impl->replica = std::make_unique<Replica>(scene);
    impl->start = scene.sequence();
    impl->bellAttachment = scene.bus().attach(impl->bell);
    impl->thread = std::thread([i = impl.get()] { i->run(); });
    if (whenBehind == WhenBehind::wait) impl->waitUntilBegun();
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

bool LogRecorder::waitFor(std::uint64_t state, std::chrono::milliseconds timeout) const {
    std::unique_lock lock(impl_->mutex);
    impl_->progress.wait_for(lock, timeout, [&] { return impl_->acknowledged >= state || !impl_->result; });
    return impl_->acknowledged >= state;
}

std::string LogRecorder::failure() const {
    const std::scoped_lock lock(impl_->mutex);
    return impl_->result ? "" : impl_->result.error().format();
}

Result<> LogRecorder::stop() {
    if (impl_->thread.joinable()) {
        impl_->bellAttachment.detach();
        impl_->stopping = true;
        impl_->bell.ring();
        impl_->thread.join();
    }
    const std::scoped_lock lock(impl_->mutex);
    return impl_->result;
}

}  // namespace rtsg
