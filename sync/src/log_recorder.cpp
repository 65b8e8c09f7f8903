#include <rtsg/sync/log_recorder.h>

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>

#include <fmt/format.h>

namespace rtsg {

struct LogRecorder::Impl {
    /// On the scene's thread: there is something to fetch.
    struct Bell final : Subscriber {
        Impl& impl;
        std::atomic<std::uint64_t> rung{0};
        explicit Bell(Impl& i) : impl(i) {}
        /// An error here has the bus report to the application that the log has ended.
        Result<> apply(const Scene&, const ChangeSet&) override {
            if (impl.failed) {
                const std::scoped_lock lock(impl.mutex);
                return impl.result;
            }
            ring();
            return {};
        }
        void ring() {
            rung.fetch_add(1, std::memory_order_release);
            rung.notify_one();
        }
        std::string subscriberName() const override { return "log " + impl.file; }
    };
    /// On the recorder's thread: into the replica, which the log follows.
    struct Follower final : Subscriber {
        Impl& impl;
        explicit Follower(Impl& i) : impl(i) {}
        Result<> apply(const Scene&, const ChangeSet& changes) override { return impl.take(changes); }
        std::string subscriberName() const override { return "log recorder"; }
    };

    std::unique_ptr<LogWriter> log;
    std::string file;
    Bell bell{*this};
    Follower follower{*this};
    Attachment attachment, bellAttachment;
    std::unique_ptr<Scene> replica;  // the recorder's thread's own
    Attachment logAttachment;
    bool following = false;
    std::atomic<bool> stopping{false}, failed{false};
    std::atomic<std::uint64_t> acknowledged{0}, merged{0}, bytes{0};
    mutable std::mutex mutex;
    mutable std::condition_variable progress;
    Result<> result;  // guarded by mutex
    std::thread thread;

    Result<> take(const ChangeSet& changes) {
        if (changes.isSnapshot() && replica->sequence() > 0)
            if (auto ok = replica->reset(); !ok) return ok;
        if (!changes.isSnapshot() && changes.to > changes.from + 1) merged += changes.to - changes.from - 1;
        if (auto ok = replica->apply(std::make_shared<const ChangeSet>(changes)); !ok) return ok;
        if (!following) logAttachment = replica->bus().attach(*log);
        following = true;
        if (!logAttachment.attached()) return fail(logAttachment.failure());
        if (replica->hash() != changes.hash)
            return fail(fmt::format("the replica at state {} has hash {}, the scene had {}", changes.to,
                                    replica->hash().hex(), changes.hash.hex()));
        const std::scoped_lock lock(mutex);
        acknowledged = changes.to;
        bytes = log->bytes();
        progress.notify_all();
        return {};
    }

    void run() {
        replica = std::make_unique<Scene>();
        replica->setBehavioursEnabled(false);
        std::uint64_t heard = 0;
        while (true) {
            bell.rung.wait(heard, std::memory_order_acquire);
            heard = bell.rung.load(std::memory_order_acquire);
            const bool last = stopping;
            attachment.drain();
            if (last || !attachment.attached()) break;
        }
        logAttachment.detach();
        Result<> closed = attachment.attached() ? Result<>{} : fail(attachment.failure());
        attachment.detach();
        if (auto ok = log->close(); !ok && closed) closed = ok;
        replica.reset();
        const std::scoped_lock lock(mutex);
        result = closed;
        failed = !closed;
        bytes = log->bytes();
        progress.notify_all();
    }
};

LogRecorder::LogRecorder(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

LogRecorder::~LogRecorder() {
    (void)stop();
}

Result<std::unique_ptr<LogRecorder>> LogRecorder::start(Scene& scene, const std::filesystem::path& file,
                                                        LogOptions options) {
    if (options.mode.mode == Mode::input)
        return fail("a log in input mode is written by a LogWriter on the scene itself", {}, file.string());
    auto impl = std::make_unique<Impl>();
    auto log = LogWriter::create(file, builtinTypes(), std::move(options));
    if (!log) return std::unexpected(log.error());
    impl->log = std::move(*log);
    impl->file = file.string();
    impl->attachment = scene.bus().attach(impl->follower, Delivery::polled);
    impl->bellAttachment = scene.bus().attach(impl->bell);
    impl->thread = std::thread([i = impl.get()] { i->run(); });
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
