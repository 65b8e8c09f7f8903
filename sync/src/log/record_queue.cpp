// Keeps encoded steps in a list and then in a file until the reader takes them.
#include <rtsg/sync/record_queue.h>

#include <condition_variable>
#include <deque>
#include <mutex>
#include <system_error>

#include <fcntl.h>
#include <unistd.h>

#include <fmt/format.h>

#include <rtsg/core/descriptor.h>
#include <rtsg/sync/change_codec.h>

namespace rtsg {

namespace {

/// A file without a name, read and written by position. It vanishes when its descriptor is closed.
class HiddenFile {
  public:
    explicit HiddenFile(std::filesystem::path folder) : folder_(std::move(folder)) {}

    Result<> write(std::span<const std::byte> bytes, std::uint64_t at) {
        if (!descriptor_)
            if (auto ok = open(); !ok) return ok;
        while (!bytes.empty()) {
            const ssize_t done = ::pwrite(descriptor_.get(), bytes.data(), bytes.size(), static_cast<off_t>(at));
            if (done < 0 && errno == EINTR) continue;
            if (done <= 0) return failed("cannot keep frames that wait", done < 0 ? errno : ENOSPC);
            bytes = bytes.subspan(static_cast<std::size_t>(done));
            at += static_cast<std::uint64_t>(done);
        }
        return {};
    }
    Result<> read(std::span<std::byte> bytes, std::uint64_t at) const {
        while (!bytes.empty()) {
            const ssize_t done = ::pread(descriptor_.get(), bytes.data(), bytes.size(), static_cast<off_t>(at));
            if (done < 0 && errno == EINTR) continue;
            if (done <= 0) return failed("cannot read frames that waited", done < 0 ? errno : EIO);
            bytes = bytes.subspan(static_cast<std::size_t>(done));
            at += static_cast<std::uint64_t>(done);
        }
        return {};
    }
    /// Gives disk space back. If that fails, only the space stays taken.
    void clear() {
        if (descriptor_ && ::ftruncate(descriptor_.get(), 0) != 0) return;
    }

  private:
    Result<> open() {
        std::string name = (folder_ / "rtsg-frames-XXXXXX").string();
        descriptor_ = Descriptor(::mkostemp(name.data(), O_CLOEXEC));
        if (!descriptor_) return failed("cannot make a file for frames that wait", errno);
        ::unlink(name.c_str());
        return {};
    }
    std::unexpected<Diagnostic> failed(std::string_view what, int error) const {
        return fail(fmt::format("{} in {}: {}", what, folder_.string(), std::generic_category().message(error)));
    }

    std::filesystem::path folder_;
    Descriptor descriptor_;
};

}  // namespace

struct RecordQueue::Impl {
    explicit Impl(RecordQueueOptions o)
        : options(std::move(o)),
          file(options.folder.empty() ? std::filesystem::temp_directory_path() : options.folder) {}

    RecordQueueOptions options;
    // One is used by the adding thread, the other by the reader.
    ChangeEncoder encoder;
    ChangeDecoder decoder{builtinTypes()};
    ByteBuffer fromFile;

    mutable std::mutex mutex;  // guards everything below
    std::condition_variable arrived;
    HiddenFile file;
    std::deque<SharedRecord> memory;
    std::uint64_t memoryBytes = 0;
    std::deque<std::size_t> onDisk;  // sizes of the records in the file, which are all later than those in memory
    std::uint64_t fileBegin = 0, fileEnd = 0, maxOnDisk = 0, encoded = 0;
    double newest = 0, taken = 0;
    bool closed = false;
    Result<> problem;

    Result<> put(SharedRecord record) {
        // While records wait in the file, later ones must go there, too, to keep the order.
        if (onDisk.empty() && (memory.empty() || memoryBytes + memoryOf(*record) <= options.memoryBytes)) {
            memoryBytes += memoryOf(*record);
            memory.push_back(std::move(record));
            return {};
        }
        if (auto ok = file.write(record->bytes.bytes(), fileEnd); !ok) return ok;
        onDisk.push_back(record->bytes.size());
        fileEnd += record->bytes.size();
        maxOnDisk = std::max(maxOnDisk, fileEnd - fileBegin);
        return {};
    }
    /// Precondition: something waits. Returns null if the record is now in `fromFile`.
    Result<SharedRecord> fetch() {
        if (!memory.empty()) {
            SharedRecord record = std::move(memory.front());
            memory.pop_front();
            memoryBytes -= memoryOf(*record);
            return record;
        }
        const std::size_t size = onDisk.front();
        fromFile.clear();
        if (auto ok = file.read({fromFile.room(size), size}, fileBegin); !ok) return std::unexpected(ok.error());
        fromFile.advance(size);
        onDisk.pop_front();
        fileBegin += size;
        if (onDisk.empty()) {
            fileBegin = fileEnd = 0;
            file.clear();
        }
        return nullptr;
    }
    bool empty() const { return memory.empty() && onDisk.empty(); }
};

RecordQueue::RecordQueue(RecordQueueOptions options) : impl_(std::make_unique<Impl>(std::move(options))) {}
RecordQueue::~RecordQueue() = default;

Result<> RecordQueue::add(const ChangeSet& set) {
    const auto record = std::make_shared<EncodedRecord>();
    impl_->encoder.encode(set, record->bytes);
    finishRecord(*record);
    {
        const std::scoped_lock lock(impl_->mutex);
        impl_->encoded += !set.isSnapshot();
    }
    return add(RecordStep{record, nullptr});
}

Result<> RecordQueue::add(const RecordStep& step) {
    if (!step.record) return add(*step.set);
    Impl& s = *impl_;
    const std::scoped_lock lock(s.mutex);
    if (!s.problem) return s.problem;
    if (s.closed) return {};
    s.problem = s.put(step.record);
    if (s.problem) s.newest = step.record->header.time;
    s.arrived.notify_one();
    return s.problem;
}

void RecordQueue::close() {
    const std::scoped_lock lock(impl_->mutex);
    impl_->closed = true;
    impl_->arrived.notify_one();
}

Result<RecordQueue::Taken> RecordQueue::take(ChangeSet& into, std::chrono::milliseconds timeout) {
    Impl& s = *impl_;
    SharedRecord record;
    {
        std::unique_lock lock(s.mutex);
        s.arrived.wait_for(lock, timeout, [&] { return !s.empty() || s.closed || !s.problem; });
        if (s.empty()) {
            if (!s.problem) return std::unexpected(s.problem.error());
            return s.closed ? Taken::ended : Taken::nothingYet;
        }
        auto fetched = s.fetch();
        if (!fetched) return std::unexpected(fetched.error());
        record = std::move(*fetched);
    }
    const auto bytes = record ? record->bytes.bytes() : s.fromFile.bytes();
    if (auto ok = s.decoder.decode(bytes, into); !ok) return std::unexpected(ok.error());
    const std::scoped_lock lock(s.mutex);
    s.taken = into.time;
    return Taken::set;
}

std::uint64_t RecordQueue::waiting() const {
    const std::scoped_lock lock(impl_->mutex);
    return impl_->memory.size() + impl_->onDisk.size();
}
double RecordQueue::secondsBehind() const {
    const std::scoped_lock lock(impl_->mutex);
    return impl_->empty() ? 0 : impl_->newest - impl_->taken;
}
std::uint64_t RecordQueue::inMemory() const {
    const std::scoped_lock lock(impl_->mutex);
    return impl_->memoryBytes;
}
std::uint64_t RecordQueue::maxOnDisk() const {
    const std::scoped_lock lock(impl_->mutex);
    return impl_->maxOnDisk;
}
std::uint64_t RecordQueue::encoded() const {
    const std::scoped_lock lock(impl_->mutex);
    return impl_->encoded;
}

}  // namespace rtsg
