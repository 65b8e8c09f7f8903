// Keeps coded change sets in a list of buffers, and behind it in a file, until the reader takes them.
#include <rtsg/sync/frame_queue.h>

#include <condition_variable>
#include <deque>
#include <mutex>
#include <system_error>

#include <fcntl.h>
#include <unistd.h>

#include <fmt/format.h>

#include <rtsg/sync/change_codec.h>

namespace rtsg {

namespace {

/// A file without a name: read and written by position, gone with its descriptor.
class HiddenFile {
  public:
    explicit HiddenFile(std::filesystem::path folder) : folder_(std::move(folder)) {}
    ~HiddenFile() {
        if (descriptor_ >= 0) ::close(descriptor_);
    }
    HiddenFile(const HiddenFile&) = delete;
    HiddenFile& operator=(const HiddenFile&) = delete;

    Result<> write(std::span<const std::byte> bytes, std::uint64_t at) {
        if (descriptor_ < 0)
            if (auto ok = open(); !ok) return ok;
        while (!bytes.empty()) {
            const ssize_t done = ::pwrite(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(at));
            if (done < 0 && errno == EINTR) continue;
            if (done <= 0) return failed("cannot keep frames that wait", done < 0 ? errno : ENOSPC);
            bytes = bytes.subspan(static_cast<std::size_t>(done));
            at += static_cast<std::uint64_t>(done);
        }
        return {};
    }
    Result<> read(std::span<std::byte> bytes, std::uint64_t at) const {
        while (!bytes.empty()) {
            const ssize_t done = ::pread(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(at));
            if (done < 0 && errno == EINTR) continue;
            if (done <= 0) return failed("cannot read frames that waited", done < 0 ? errno : EIO);
            bytes = bytes.subspan(static_cast<std::size_t>(done));
            at += static_cast<std::uint64_t>(done);
        }
        return {};
    }
    /// Gives the disk's room back. What a failure would leave is only room not given back.
    void clear() {
        if (descriptor_ >= 0 && ::ftruncate(descriptor_, 0) != 0) return;
    }

  private:
    Result<> open() {
        std::string name = (folder_ / "rtsg-frames-XXXXXX").string();
        descriptor_ = ::mkostemp(name.data(), O_CLOEXEC);
        if (descriptor_ < 0) return failed("cannot make a file for frames that wait", errno);
        ::unlink(name.c_str());
        return {};
    }
    std::unexpected<Diagnostic> failed(std::string_view what, int error) const {
        return fail(fmt::format("{} in {}: {}", what, folder_.string(), std::generic_category().message(error)));
    }

    std::filesystem::path folder_;
    int descriptor_ = -1;
};

}  // namespace

struct FrameQueue::Impl {
    explicit Impl(FrameQueueOptions o)
        : options(std::move(o)),
          file(options.folder.empty() ? std::filesystem::temp_directory_path() : options.folder) {}

    FrameQueueOptions options;
    // The scene's thread's own, and the reader's.
    ChangeEncoder encoder;
    ChangeDecoder decoder{builtinTypes()};
    ByteBuffer reading;

    mutable std::mutex mutex;  // guards everything below
    std::condition_variable arrived;
    HiddenFile file;
    std::deque<ByteBuffer> memory;
    std::size_t memoryBytes = 0;
    std::deque<std::size_t> onDisk;  // sizes of the sets in the file: all of them are later than those in memory
    std::uint64_t fileBegin = 0, fileEnd = 0, mostOnDisk = 0;
    double newest = 0, taken = 0;
    bool closed = false;
    Result<> problem;

    Result<> put(ByteBuffer record) {
        // In order: while sets wait in the file, later ones go there too.
        if (onDisk.empty() && (memory.empty() || memoryBytes + record.size() <= options.memoryBytes)) {
            memoryBytes += record.size();
            memory.push_back(std::move(record));
            return {};
        }
        if (auto ok = file.write(record.bytes(), fileEnd); !ok) return ok;
        onDisk.push_back(record.size());
        fileEnd += record.size();
        mostOnDisk = std::max(mostOnDisk, fileEnd - fileBegin);
        return {};
    }
    /// Precondition: something waits.
    Result<> fetch() {
        if (!memory.empty()) {
            reading = std::move(memory.front());
            memory.pop_front();
            memoryBytes -= reading.size();
            return {};
        }
        const std::size_t size = onDisk.front();
        reading.clear();
        if (auto ok = file.read({reading.room(size), size}, fileBegin); !ok) return ok;
        reading.advance(size);
        onDisk.pop_front();
        fileBegin += size;
        if (onDisk.empty()) {
            fileBegin = fileEnd = 0;
            file.clear();
        }
        return {};
    }
    bool empty() const { return memory.empty() && onDisk.empty(); }
};

FrameQueue::FrameQueue(FrameQueueOptions options) : impl_(std::make_unique<Impl>(std::move(options))) {}
FrameQueue::~FrameQueue() = default;

Result<> FrameQueue::apply(const Scene&, const ChangeSet& changes) {
    Impl& s = *impl_;
    ByteBuffer record;
    s.encoder.encode(changes, record);
    const std::scoped_lock lock(s.mutex);
    if (!s.problem) return s.problem;
    if (s.closed) return {};
    if (auto ok = s.put(std::move(record)); !ok) {
        s.problem = ok;
        s.arrived.notify_one();
        return ok;
    }
    s.newest = changes.time;
    s.arrived.notify_one();
    return {};
}

void FrameQueue::close() {
    const std::scoped_lock lock(impl_->mutex);
    impl_->closed = true;
    impl_->arrived.notify_one();
}

Result<FrameQueue::Taken> FrameQueue::take(ChangeSet& into, std::chrono::milliseconds timeout) {
    Impl& s = *impl_;
    {
        std::unique_lock lock(s.mutex);
        s.arrived.wait_for(lock, timeout, [&] { return !s.empty() || s.closed || !s.problem; });
        if (s.empty()) {
            if (!s.problem) return std::unexpected(s.problem.error());
            return s.closed ? Taken::ended : Taken::nothingYet;
        }
        if (auto ok = s.fetch(); !ok) return std::unexpected(ok.error());
    }
    if (auto ok = s.decoder.decode(s.reading.bytes(), into); !ok) return std::unexpected(ok.error());
    const std::scoped_lock lock(s.mutex);
    s.taken = into.time;
    return Taken::set;
}

std::uint64_t FrameQueue::waiting() const {
    const std::scoped_lock lock(impl_->mutex);
    return impl_->memory.size() + impl_->onDisk.size();
}
double FrameQueue::secondsBehind() const {
    const std::scoped_lock lock(impl_->mutex);
    return impl_->empty() ? 0 : impl_->newest - impl_->taken;
}
std::uint64_t FrameQueue::mostOnDisk() const {
    const std::scoped_lock lock(impl_->mutex);
    return impl_->mostOnDisk;
}

}  // namespace rtsg
