// Stores the records of a growing log file in a stream of JetStream, and fetches them as a file.
#include <rtsg/nats/nats_log.h>

#include <atomic>
#include <cerrno>
#include <condition_variable>
#include <cstring>
#include <mutex>
#include <optional>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <rtsg/core/descriptor.h>
#include <rtsg/core/worker.h>
#include <rtsg/sync/byte_buffer.h>
#include <rtsg/sync/log.h>
#include <rtsg/sync/record.h>

#include "link/open_nats.h"

namespace rtsg {

using namespace std::chrono_literals;

namespace {

constexpr std::size_t kBesideData = 512;  // bytes of a message: headers that name the sequence before it
constexpr auto kLookAgain = 20ms;         // for another record in the file
constexpr auto kStoreAgain = 200ms;       // after a failure that may pass
constexpr auto kGoneFor = 3s;             // a server that begins anew finds its streams within that

std::string streamOf(const NatsAddress& address) {
    return "RTSG_" + address.name;
}

/// A user who names three servers of a cluster wants stored data to survive the loss of one.
int copiesFor(const NatsAddress& address) {
    return address.servers.size() >= 3 ? 3 : 1;
}

Diagnostic storeFailure(const NatsAddress& address, std::string problem) {
    return {Severity::error, address.shown, {}, withoutSecrets(std::move(problem), address)};
}

Result<NatsStream> findStream(NatsLink& link, const NatsAddress& address) {
    NatsStream stream;
    if (std::string problem = link.streamState(streamOf(address), stream); !problem.empty())
        return std::unexpected(storeFailure(address, std::move(problem)));
    return stream;
}

/// Writes what the store still has of a session: limits, purges and deletions take messages away.
Result<NatsLog::Fetched> fetchInto(NatsLink& link, const NatsAddress& address, const NatsStream& stream,
                                   const std::filesystem::path& file,
                                   const std::function<bool(std::uint64_t, std::uint64_t)>& progress) {
    const int descriptor = ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (descriptor < 0) return fail(fmt::format("cannot be written: {}", std::strerror(errno)), {}, file);
    NatsLog::Fetched fetched;
    std::string unwritten;
    const auto sink = [&](std::uint64_t sequence, std::string_view bytes) {
        if (sequence != fetched.last + 1) fetched.missing.emplace_back(fetched.last + 1, sequence - 1);
        fetched.last = sequence;
        fetched.bytes += bytes.size();
        if (::write(descriptor, bytes.data(), bytes.size()) != static_cast<ssize_t>(bytes.size())) {
            unwritten = std::strerror(errno);
            return false;
        }
        return !progress || progress(fetched.bytes, stream.bytes);
    };
    std::string problem;
    if (stream.messages > 0)
        problem = link.read(streamOf(address), NatsSubjects(address.name).log, stream.first, stream.last, sink);
    ::close(descriptor);
    if (!unwritten.empty()) return fail(fmt::format("cannot be written: {}", unwritten), {}, file);
    if (!problem.empty()) return std::unexpected(storeFailure(address, std::move(problem)));
    if (fetched.last < stream.last)
        fetched.missing.emplace_back(std::exchange(fetched.last, stream.last) + 1, stream.last);
    return fetched;
}

Result<> checkStored(const NatsStream& stream, const NatsAddress& address) {
    if (stream.messages > 0) return {};
    return fail(stream.last > 0 ? "the store has let go of all messages of the session" : "no session is stored there",
                {}, address.shown);
}

/// Where a writer goes on in the file: a record of several messages may be there in part.
std::uint64_t intactEnd(const std::filesystem::path& file) {
    auto reader = LogReader::open(file);
    if (!reader) return 0;
    while (reader->next()) continue;
    return reader->intactEnd();
}

/// The next whole record of a file that grows.
class GrowingLog {
  public:
    GrowingLog(std::filesystem::path file, std::uint64_t offset) : file_(std::move(file)), offset_(offset) {}

    /// False if there is none yet.
    bool next(ByteBuffer& record) {
        // A writer may put a new file in this place until it has written something.
        if (offset_ == 0) descriptor_.close();
        if (!descriptor_) descriptor_ = Descriptor(::open(file_.c_str(), O_RDONLY | O_CLOEXEC));
        if (!descriptor_ || !read(record, kRecordHeaderSize)) return false;
        const auto header = parseRecordHeader(record.bytes(), offset_);
        if (!header || !read(record, header->size()) || !checkRecord(record.bytes(), offset_)) return false;
        offset_ += header->size();
        return true;
    }
    std::uint64_t offset() const { return offset_; }
    /// True if all bytes of the file belong to records that were read.
    bool atEnd() const {
        struct stat about{};
        return ::stat(file_.c_str(), &about) != 0 || static_cast<std::uint64_t>(about.st_size) <= offset_;
    }

  private:
    bool read(ByteBuffer& into, std::uint64_t length) {
        into.clear();
        const ssize_t count = ::pread(descriptor_.get(), into.room(length), length, static_cast<off_t>(offset_));
        if (count != static_cast<ssize_t>(length)) return false;
        into.advance(length);
        return true;
    }

    const std::filesystem::path file_;
    std::uint64_t offset_;
    Descriptor descriptor_;
};

}  // namespace

class NatsLog::Impl {
  public:
    Impl(NatsAddress address, std::unique_ptr<NatsLink> link, const std::filesystem::path& file, const Fetched& there,
         bool replaces)
        : address_(std::move(address)),
          subject_(NatsSubjects(address_.name).log),
          link_(std::move(link)),
          log_(file, there.bytes),
          missing_(there.missing),
          storedBytes_(there.bytes),
          lastSequence_(there.last),
          replaces_(replaces) {
        worker_.run([this] { run(); });
    }

    const std::string& address() const { return address_.shown; }
    const Missing& missing() const { return missing_; }
    std::uint64_t bytes() const { return storedBytes_; }
    std::uint64_t messages() const { return lastSequence_; }
    std::string failure() const {
        const std::scoped_lock lock(mutex_);
        return failure_;
    }
    Result<> finish(std::chrono::milliseconds patience);

  private:
    void run();
    bool replaceLog();
    bool storeRecord(std::span<const std::byte> record);
    bool storePiece(std::span<const std::byte> piece);
    bool isThere(std::span<const std::byte> piece, std::string& problem);
    /// False once it shall end.
    bool pause(std::chrono::milliseconds maximum);
    void setFailure(std::string text, bool forGood) {
        const std::scoped_lock lock(mutex_);
        failure_ = std::move(text);
        ended_ = ended_ || forGood;
        changed_.notify_all();
    }

    const NatsAddress address_;
    const std::string subject_;
    std::unique_ptr<NatsLink> link_;
    GrowingLog log_;
    const Missing missing_;
    std::atomic<std::uint64_t> storedBytes_, lastSequence_;
    std::optional<std::chrono::steady_clock::time_point> goneSince_;  // no stream was found
    bool replaces_;             // another log is there until this one has its first record
    mutable std::mutex mutex_;  // guards the members below
    std::condition_variable changed_;
    std::string failure_;
    bool ended_ = false;
    bool idle_ = false;  // all records that were in the file when it was last looked at are stored
    std::uint64_t looks_ = 0;
    Worker worker_{"rtsg store"};  // last: it uses the others
};

void NatsLog::Impl::run() {
    ByteBuffer record;
    try {
        while (true) {
            if (log_.next(record)) {
                if ((replaces_ && !replaceLog()) || !storeRecord(record.bytes())) return;
                continue;
            }
            {
                const std::scoped_lock lock(mutex_);
                idle_ = log_.atEnd();
                ++looks_;
                changed_.notify_all();
            }
            if (!pause(kLookAgain)) return;
        }
    } catch (const std::exception& e) {
        setFailure(fmt::format("nothing is stored any more: {}", e.what()), true);
    }
}

bool NatsLog::Impl::pause(std::chrono::milliseconds maximum) {
    if (!worker_.pause(maximum)) return false;
    const std::scoped_lock lock(mutex_);
    return !ended_;
}

/// Tries until the stream is empty, as storePiece() does.
bool NatsLog::Impl::replaceLog() {
    const std::string name = streamOf(address_);
    while (replaces_) {
        std::string problem = link_->removeStream(name);
        if (problem.empty()) problem = link_->makeStream(name, subject_, copiesFor(address_));
        replaces_ = !problem.empty();
        setFailure(withoutSecrets(std::move(problem), address_), false);
        if (replaces_ && !pause(kStoreAgain)) return false;
    }
    return true;
}

bool NatsLog::Impl::storeRecord(std::span<const std::byte> record) {
    while (!record.empty()) {
        const auto piece = record.first(std::min(record.size(), link_->maxPayload() - kBesideData));
        if (!storePiece(piece)) return false;
        record = record.subspan(piece.size());
    }
    return true;
}

/// Tries until it is stored. A store that is full, or a server that is gone, may be there again.
bool NatsLog::Impl::storePiece(std::span<const std::byte> piece) {
    while (true) {
        std::string problem;
        const NatsLink::Stored stored = link_->store(streamOf(address_), subject_, piece, lastSequence_, problem);
        if (stored == NatsLink::Stored::yes || (stored == NatsLink::Stored::unknown && isThere(piece, problem))) {
            storedBytes_ += piece.size();
            ++lastSequence_;
            setFailure({}, false);
            return true;
        }
        setFailure(withoutSecrets(std::move(problem), address_), false);
        if (!pause(kStoreAgain)) return false;
    }
}

/// True if the store has this piece at the place where it belongs, because only the answer was lost.
bool NatsLog::Impl::isThere(std::span<const std::byte> piece, std::string& problem) {
    NatsStream stream;
    const std::uint64_t own = lastSequence_ + 1;
    if (!link_->streamState(streamOf(address_), stream).empty()) return false;
    if (!stream.exists) {
        const auto now = std::chrono::steady_clock::now();
        problem = "the stream is no longer there: somebody has deleted it";
        setFailure(problem, now - goneSince_.value_or(now) > kGoneFor);
        if (!goneSince_) goneSince_ = now;
        return false;
    }
    goneSince_.reset();
    if (stream.last < own - 1)
        setFailure(fmt::format("the store has lost messages: {} of {} are there", stream.last, own - 1), true);
    if (stream.last < own) return false;
    bool same = false;
    const std::string unread =
        link_->read(streamOf(address_), subject_, own, own, [&](std::uint64_t, std::string_view bytes) {
            same = bytes.size() == piece.size() && std::memcmp(bytes.data(), piece.data(), piece.size()) == 0;
            return true;
        });
    if (!unread.empty()) return false;
    if (same && stream.last == own) return true;
    problem = "somebody else stores a session there";
    setFailure(problem, true);
    return false;
}

Result<> NatsLog::Impl::finish(std::chrono::milliseconds patience) {
    auto end = std::chrono::steady_clock::now() + patience;
    std::uint64_t before = lastSequence_;
    std::unique_lock lock(mutex_);
    const std::uint64_t look = looks_;
    while (!ended_ && !(idle_ && looks_ > look)) {
        changed_.wait_for(lock, 50ms);
        if (lastSequence_ != std::exchange(before, lastSequence_)) end = std::chrono::steady_clock::now() + patience;
        if (std::chrono::steady_clock::now() > end) break;
    }
    if (!ended_ && idle_ && looks_ > look) return {};
    return std::unexpected(
        storeFailure(address_, fmt::format("only the first {} bytes are stored{}", storedBytes_.load(),
                                           failure_.empty() ? "" : ": " + failure_)));
}

NatsLog::NatsLog(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
NatsLog::~NatsLog() = default;

Result<NatsLog::Fetched> NatsLog::fetch(const std::string& address, const std::filesystem::path& file,
                                        const std::function<bool(std::uint64_t, std::uint64_t)>& progress) {
    auto parsed = NatsAddress::parse(address);
    if (!parsed) return std::unexpected(parsed.error());
    auto link = openNatsLink(*parsed, "rtsg");
    if (!link) return std::unexpected(link.error());
    const auto stream = findStream(**link, *parsed);
    if (!stream) return std::unexpected(stream.error());
    if (auto ok = checkStored(*stream, *parsed); !ok) return std::unexpected(ok.error());
    return fetchInto(**link, *parsed, *stream, file, progress);
}

Result<std::unique_ptr<NatsLog>> NatsLog::start(const std::string& address, const std::filesystem::path& file,
                                                Begin begin) {
    auto parsed = NatsAddress::parse(address);
    if (!parsed) return std::unexpected(parsed.error());
    auto link = openNatsLink(*parsed, "rtsg");
    if (!link) return std::unexpected(link.error());
    const auto stream = findStream(**link, *parsed);
    if (!stream) return std::unexpected(stream.error());
    Fetched there;
    if (begin == Begin::goOn) {
        if (auto ok = checkStored(*stream, *parsed); !ok) return std::unexpected(ok.error());
        auto fetched = fetchInto(**link, *parsed, *stream, file, {});
        if (!fetched) return std::unexpected(fetched.error());
        there = std::move(*fetched);
        there.bytes = intactEnd(file);
    } else if (begin == Begin::fresh && stream->last > 0) {
        return fail("a session is stored there already; --force replaces it", {}, parsed->shown);
    }
    if (!stream->exists)
        if (std::string problem =
                (*link)->makeStream(streamOf(*parsed), NatsSubjects(parsed->name).log, copiesFor(*parsed));
            !problem.empty())
            return std::unexpected(storeFailure(*parsed, std::move(problem)));
    const bool replaces = begin == Begin::replace && stream->last > 0;
    return std::unique_ptr<NatsLog>(
        new NatsLog(std::make_unique<Impl>(std::move(*parsed), std::move(*link), file, there, replaces)));
}

const std::string& NatsLog::address() const {
    return impl_->address();
}
const NatsLog::Missing& NatsLog::missing() const {
    return impl_->missing();
}
std::uint64_t NatsLog::storedBytes() const {
    return impl_->bytes();
}
std::uint64_t NatsLog::storedMessages() const {
    return impl_->messages();
}
std::string NatsLog::failure() const {
    return impl_->failure();
}
Result<> NatsLog::finish(std::chrono::milliseconds patience) {
    return impl_->finish(patience);
}

}  // namespace rtsg
