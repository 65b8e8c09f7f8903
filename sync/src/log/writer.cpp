// Writes a log: each record with one write, into a file of its own, never over an existing one.
#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <random>
#include <span>
#include <thread>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <rtsg/core/frame_input.h>
#include <rtsg/core/scene.h>
#include <rtsg/sync/log.h>

#include "index.h"
#include "log_files.h"

namespace rtsg {

namespace {

/// The most bytes, per second of scene time, for keyframes that are due because of time.
constexpr double kKeyframeRate = 1 << 20;
constexpr off_t kRoomForHead = 1024;

std::uint64_t freshEpoch() {
    std::random_device device;
    const std::uint64_t high = device();
    return high << 32 | device();
}

/// Makes sure that a new file's name survives a loss of power, too.
void syncFolderOf(const std::filesystem::path& file) {
    const std::filesystem::path folder = file.has_parent_path() ? file.parent_path() : ".";
    const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (descriptor < 0) return;
    ::fsync(descriptor);
    ::close(descriptor);
}

bool isStill(int descriptor, const std::filesystem::path& file) {
    struct stat ours{}, there{};
    return ::fstat(descriptor, &ours) == 0 && ::stat(file.c_str(), &there) == 0 && ours.st_dev == there.st_dev &&
           ours.st_ino == there.st_ino;
}

/// Returns false if another writer has the file, or has renamed it since it was opened. Readers test for writers with a
/// short lock of their own, so this tries several times.
bool lockForWriting(int descriptor, const std::filesystem::path& file) {
    for (int tries = 0; ::flock(descriptor, LOCK_EX | LOCK_NB) != 0; ++tries) {
        if (tries == 10) return false;
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    return isStill(descriptor, file);
}

}  // namespace

LogWriter::LogWriter(std::filesystem::path file, TypeTable types, LogOptions options)
    : file_(std::move(file)),
      types_(types),
      options_(std::move(options)),
      encoder_(options_.mode, types),
      inputs_(types) {}

Diagnostic LogWriter::failure(std::string_view what, int error) const {
    return {Severity::error, file_.string(), {}, fmt::format("{}: {}", what, std::strerror(error))};
}

Result<std::unique_ptr<LogWriter>> LogWriter::create(const std::filesystem::path& file, TypeTable types,
                                                     LogOptions options) {
    std::unique_ptr<LogWriter> log(new LogWriter(file, types, std::move(options)));
    if (auto ok = log->openFile(); !ok) return std::unexpected(ok.error());
    if (auto ok = log->beginEpoch(); !ok) return std::unexpected(ok.error());
    if (log->regular_ && log->options_.sync != LogOptions::Sync::atClose) syncFolderOf(file);
    return log;
}

/// Opens a new file, a replacement for an existing one, an irregular file (as it is), or the end of an existing log.
Result<> LogWriter::openFile() {
    struct stat status{};
    const bool there = ::stat(file_.c_str(), &status) == 0;
    regular_ = !there || S_ISREG(status.st_mode);
    if (!regular_) {
        descriptor_ = ::open(file_.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC);
        return descriptor_ < 0 ? std::unexpected(failure("cannot write", errno)) : Result<>{};
    }
    if (there && options_.append) return openAppended();
    if (there && options_.existing == Existing::keep) return fail("there is a file already", {}, file_.string());
    if (options_.rotateBytes > 0 || options_.rotateSeconds > 0) replacedPieces_ = recordedPieces(file_);
    if (options_.existing == Existing::keep && !replacedPieces_.empty())
        return fail("there is a piece of an earlier recording already", {}, replacedPieces_.front().string());
    std::filesystem::path target = file_, fresh = file_;
    if (there) {
        // A writer of the old file would go on with a file that nobody can find.
        replaced_ = ::open(file_.c_str(), O_WRONLY | O_CLOEXEC);
        if (replaced_ < 0) return std::unexpected(failure("cannot write", errno));
        if (!lockForWriting(replaced_, file_)) return fail("another log writer has the file open", {}, file_.string());
        std::error_code error;
        target = std::filesystem::canonical(file_, error);
        if (error) return fail("cannot write: " + error.message(), {}, file_.string());
        fresh = freshNameBeside(target);
    }
    descriptor_ = ::open(fresh.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (descriptor_ < 0) return std::unexpected(failure("cannot write", errno));
    // If there is no room even for a head, no empty file may stay or replace a log.
    if (::fallocate(descriptor_, FALLOC_FL_KEEP_SIZE, 0, kRoomForHead) != 0 && errno == ENOSPC) {
        ::unlink(fresh.c_str());
        return std::unexpected(failure("cannot write", ENOSPC));
    }
    if (!lockForWriting(descriptor_, fresh)) return fail("another log writer has the file open", {}, file_.string());
    created_ = fresh;
    if (there) target_ = target;
    return {};
}

/// The new file replaces the old one once it has its first state, so a full disk destroys no log.
Result<> LogWriter::replaceFile() {
    if (replaced_ < 0) return {};
    if (::rename(created_.c_str(), target_.c_str()) != 0) {
        broken_ = true;
        return std::unexpected(failure("cannot replace", errno));
    }
    created_ = target_;
    ::close(std::exchange(replaced_, -1));
    return {};
}

/// Deletes pieces of the replaced log, which would look like the first pieces of the new session.
Result<> LogWriter::dropReplacedPieces() {
    for (const std::filesystem::path& piece : std::exchange(replacedPieces_, {})) {
        std::error_code error;
        std::filesystem::remove(piece, error);
        if (!error) continue;
        broken_ = true;
        return fail("cannot remove a piece of the recording that is replaced: " + error.message(), {}, piece.string());
    }
    return {};
}

/// Deletes a log without a state, unless somebody else has put another file there.
void LogWriter::discard() {
    if (frames_ > 0 || created_.empty()) return;
    if (isStill(descriptor_, created_)) ::unlink(created_.c_str());
    size_ = 0;
}

Result<> LogWriter::openAppended() {
    descriptor_ = ::open(file_.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC);
    struct stat status{};
    if (descriptor_ < 0 || ::fstat(descriptor_, &status) != 0) return std::unexpected(failure("cannot write", errno));
    // Locks before it changes anything, because two writers would destroy each other's log.
    if (!lockForWriting(descriptor_, file_)) return fail("another log writer has the file open", {}, file_.string());
    if (options_.epoch != 0 && isCutInHead(file_)) {
        // The first record is incomplete, so the file begins anew, as the piece that it was to be.
        if (const auto before = pieceBefore(file_); !before.empty()) goOnBehind(before);
    } else if (status.st_size > 0) {
        Result<LogReader> old = LogReader::open(file_);
        if (!old) return std::unexpected(old.error());
        keyframes_ = scanLogKeyframes(*old);
        size_ = old->intactEnd();
        if (options_.epoch != 0) goOnInFile();
    }
    if (::ftruncate(descriptor_, static_cast<off_t>(size_)) != 0)
        return std::unexpected(failure("cannot append", errno));
    dropSecondName();
    if ((options_.keepSeconds > 0 || options_.keepBytes > 0 || options_.keepFree > 0) && options_.epoch != 0)
        adoptPieces();
    return {};
}

/// Continues the same session in its file, which is a piece.
void LogWriter::goOnInFile() {
    // If the program restarts more often than files rotate, the file must still rotate by its age.
    if (!keyframes_.empty()) pieceStart_ = keyframes_.front().time;
    const auto head = headOf(file_);
    if (!head || head->epoch != options_.epoch || !head->start) return;
    isLater_ = true;
    keptFrom_ = head->keptFrom;
    if (!options_.sessionStart) options_.sessionStart = head->start;
}

void LogWriter::goOnBehind(const std::filesystem::path& piece) {
    const auto head = headOf(piece);
    if (!head || head->epoch != options_.epoch) return;
    isLater_ = true;
    keptFrom_ = head->keptFrom;
    if (!options_.sessionStart) options_.sessionStart = head->start;
}

/// Drops the piece name that the file was getting when its writer was killed.
void LogWriter::dropSecondName() {
    const auto pieces = earlierPieces(file_);
    std::error_code error;
    if (!pieces.empty() && !std::filesystem::is_symlink(pieces.back(), error) && sameFile(pieces.back(), file_))
        std::filesystem::remove(pieces.back(), error);
}

LogWriter::~LogWriter() {
    (void)close();  // callers that want errors call it before
    if (replaced_ >= 0) ::close(replaced_);
}

Result<> LogWriter::beginEpoch() {
    const std::uint64_t given = std::exchange(options_.epoch, 0);  // a scene that starts over is another session
    epoch_ = given ? given : freshEpoch();
    firstOfEpoch_ = true;
    sessionStart_ = std::exchange(options_.sessionStart, std::nullopt);
    if (given == 0) {
        isLater_ = false;
        keptFrom_.reset();
    }
    makeHead();
    return writeHead();
}

/// The first state of a later piece no longer tells when the session began, so the head does.
void LogWriter::makeHead() {
    const std::optional<double> start = isLater_ ? sessionStart_ : std::nullopt;
    encodeHead(epoch_, options_.creator, types_, options_.mode, headRecord_, start, keptFrom_ ? keptFrom_ : start);
}

Result<> LogWriter::writeHead() {
    head_ = size_;
    return writeRecord(headRecord_);
}

Result<> LogWriter::writeRecord(const ByteBuffer& record) {
    if (broken_ || descriptor_ < 0) return fail("the log is closed", {}, file_.string());
    const std::byte* at = record.data();
    std::size_t left = record.size();
    while (left > 0) {
        const ssize_t written = ::write(descriptor_, at, left);
        if (written < 0 && errno == EINTR) continue;
        if (written <= 0) {
            const int error = written < 0 ? errno : ENOSPC;
            broken_ = true;
            // The file must end with a whole record, whatever happened to this one.
            const bool cut = !regular_ || ::ftruncate(descriptor_, static_cast<off_t>(size_)) == 0;
            return std::unexpected(failure(cut ? "cannot write" : "cannot write, nor cut back", error));
        }
        at += written;
        left -= static_cast<std::size_t>(written);
    }
    size_ += record.size();
    return {};
}

Result<> LogWriter::flush() {
    if (::fdatasync(descriptor_) == 0 || errno == EINVAL || errno == EROFS) return {};  // pipes cannot be synced
    return std::unexpected(failure("cannot flush", errno));
}

/// Finds out whether the log has been deleted or truncated by others, before its owner relies on it.
Result<> LogWriter::checkFile() {
    struct stat status{};
    if (!regular_ || broken_ || ::fstat(descriptor_, &status) != 0) return {};
    const auto found = static_cast<std::uint64_t>(status.st_size);
    if (status.st_nlink > 0 && found == size_) return {};
    broken_ = true;
    return fail(status.st_nlink == 0 ? "the log was deleted while it was written"
                                     : fmt::format("the log was changed by someone else while it was written: it has "
                                                   "{} bytes, {} were written",
                                                   found, size_),
                {}, file_.string());
}

Result<> LogWriter::writeKeyframe(const ChangeSet& changes) {
    if (auto ok = checkFile(); !ok) return ok;
    const int copies = firstOfEpoch_ && record_.size() <= options_.repeatFirstUpTo ? 2 : 1;
    for (int copy = 0; copy < copies; ++copy) {
        if (auto ok = writeHead(); !ok) return ok;
        const std::uint64_t offset = size_;
        if (auto ok = writeRecord(record_); !ok) return ok;
        keyframes_.push_back({offset, changes.to, changes.time, head_});
    }
    if (changes.to > 0) firstOfEpoch_ = false;  // else the first state that has content is still to come
    keyframeSize_ = record_.size();
    keyframeTime_ = changes.time;
    sinceKeyframe_ = 0;
    record_ = ByteBuffer();  // frees memory, as frames need less
    return {};
}

/// Writes its changes, its input, or both, depending on the mode.
Result<> LogWriter::writeFrame(const ChangeSet& changes) {
    const bool inputMode = options_.mode.mode == Mode::input;
    const bool withInput = !needsState(changes) && (inputMode || options_.inputs);
    if (inputMode && !(changes.input && (withInput || changes.input->runState)))
        return fail("a log in input mode needs a scene that records its inputs, set by set", {}, file_.string());
    const std::uint64_t before = size_;
    if (withInput) {
        inputs_.encode(changes, record_);
        if (auto ok = writeRecord(record_); !ok) return ok;
    }
    if (!inputMode || !withInput) {
        encoder_.encode(changes, record_);
        if (auto ok = changes.isSnapshot() ? writeKeyframe(changes) : writeRecord(record_); !ok) return ok;
    }
    if (!withInput && changes.input && changes.input->runState && (inputMode || options_.inputs)) {
        if (auto ok = inputs_.encodeRunState(changes, record_); !ok) return ok;
        if (auto ok = writeRecord(record_); !ok) return ok;
    }
    if (!changes.isSnapshot()) sinceKeyframe_ += size_ - before;
    return {};
}

Result<> LogWriter::write(const ChangeSet& changes) {
    if (changes.isSnapshot() && state_ != 0 && (changes.to != state_ || changes.hash != hash_))
        if (auto ok = beginEpoch(); !ok) return ok;
    enter(changes.to, changes.hash, changes.time);
    if (auto ok = writeFrame(changes); !ok) return ok;
    encoded_ += !changes.isSnapshot();
    return entered(changes.isSnapshot());
}

void LogWriter::enter(std::uint64_t state, const Hash128& hash, double time) {
    state_ = state;
    hash_ = hash;
    time_ = time;
    if (!pieceStart_) pieceStart_ = time;
    if (!sessionStart_) sessionStart_ = time;
}

Result<> LogWriter::entered(bool isSnapshot) {
    if (auto ok = replaceFile(); !ok) return ok;
    ++frames_;
    // From here on the new log stays, even if the old pieces cannot be removed.
    if (auto ok = dropReplacedPieces(); !ok) return ok;
    if (options_.sync == LogOptions::Sync::always || (options_.sync == LogOptions::Sync::atKeyframes && isSnapshot))
        return flush();
    return {};
}

Result<> LogWriter::write(const EncodedRecord& frame, const ChangeSet* set) {
    if (set && !encoder_.describesTypesOf(*set)) return write(*set);
    enter(frame.header.to, frame.header.hash, frame.header.time);
    if (auto ok = writeRecord(frame.bytes); !ok) return ok;
    sinceKeyframe_ += frame.bytes.size();
    return entered(false);
}

bool LogWriter::wantsSnapshot() const {
    return rotationDue(time_) || keyframeDue(time_);
}

Result<> LogWriter::writeSnapshot(const ChangeSet& snapshot) {
    if (rotationDue(snapshot.time)) return rotate(snapshot);
    if (auto ok = write(snapshot); !ok) return ok;
    --frames_;
    return {};
}

bool LogWriter::keyframeDue(double now) const {
    if (sinceKeyframe_ == 0) return false;
    const auto size = static_cast<double>(keyframeSize_), since = static_cast<double>(sinceKeyframe_);
    if (sinceKeyframe_ >= options_.keyframeBytes && since >= options_.keyframeFactor * size) return true;
    return options_.keyframeSeconds > 0 &&
           now - keyframeTime_ >= std::max(options_.keyframeSeconds, size / kKeyframeRate);
}

Result<> LogWriter::apply(const Scene& scene, const ChangeSet& changes) {
    if (auto ok = write(changes); !ok) return ok;
    if (!wantsSnapshot()) return {};
    // Only if the scene is in the state that was just written. A polled subscriber may lag behind, and another
    // subscriber may have edited the scene during this delivery.
    if (scene.sequence() != changes.to || scene.hasUnsealedEdits()) return {};
    return writeSnapshot(scene.snapshot());
}

bool LogWriter::rotationDue(double now) const {
    if (!regular_ || sinceKeyframe_ == 0) return false;
    return (options_.rotateBytes > 0 && size_ >= std::max(options_.rotateBytes, 4 * keyframeSize_)) ||
           (options_.rotateSeconds > 0 && pieceStart_ && now - *pieceStart_ >= options_.rotateSeconds);
}

/// Takes over the pieces that the session wrote before it was resumed. Otherwise they would never be deleted, and later
/// pieces would, which leaves a gap. Each piece ends where the next one begins.
void LogWriter::adoptPieces() {
    if (keyframes_.empty()) return;
    double end = keyframes_.front().time;
    const auto before = numberedPieces(file_);
    for (auto piece = before.rbegin(); piece != before.rend(); ++piece) {
        auto log = LogReader::open(piece->second);
        const auto record = log ? log->next() : std::nullopt;
        if (!record || record->header.kind != RecordKind::head) return;
        const auto head = decodeHead(record->bytes);
        if (!head || head->epoch != options_.epoch || log->keyframes().empty()) return;
        pieces_.insert(pieces_.begin(),
                       {piece->second, std::exchange(end, log->keyframes().front().time), options_.epoch});
    }
}

/// The next number above those of all files. Pieces of an earlier session keep their numbers and come first.
Result<std::filesystem::path> LogWriter::freePieceName() {
    if (pieceNumber_ == 0)
        for (const auto& [number, piece] : numberedPieces(file_))
            if (number + 1 < kMaxPieces) pieceNumber_ = number;
    while (++pieceNumber_ < kMaxPieces) {
        std::filesystem::path name = file_;
        name.replace_filename(
            fmt::format("{}.{:04}{}", file_.stem().string(), pieceNumber_, file_.extension().string()));
        std::error_code error;
        if (!std::filesystem::exists(std::filesystem::symlink_status(name, error))) return name;
    }
    return fail("there is no number left for its next piece", {}, file_.string());
}

/// The present file becomes a piece and says that another follows. The new file gets the log's name once `state` is in
/// it. So whenever the process is killed, the log's own name leads to a session that can be continued.
Result<> LogWriter::rotate(const ChangeSet& state) {
    if (auto ok = checkFile(); !ok) return ok;
    RecordHeader next;
    next.to = state.to;
    next.time = state.time;
    next.hash = state.hash;
    if (auto ok = writeIndex(next); !ok) return ok;
    if (auto ok = flush(); !ok) return ok;
    const auto piece = freePieceName();
    if (!piece) return std::unexpected(piece.error());
    const std::filesystem::path fresh = freshNameBeside(*piece);
    const int old = std::exchange(descriptor_, -1);
    const std::size_t going = oldPieces(state.time);
    const std::uint64_t whole = std::exchange(size_, 0);
    keyframes_.clear();
    pieceStart_.reset();
    isLater_ = true;
    for (const Piece& before : std::span(pieces_).first(going))
        if (before.epoch == epoch_) keptFrom_ = std::max(keptFrom_.value_or(before.end), before.end);
    Result<> done = beginPiece(fresh, state);
    if (done) done = moveIntoPlace(fresh, *piece);
    ::close(old);  // until the file has its piece name, nobody else may write it
    if (!done) {
        broken_ = true;
        size_ = whole;  // the file of that name is still the one before
        ::unlink(fresh.c_str());
        return done;
    }
    pieces_.push_back({*piece, state.time, epoch_});
    dropPieces(going);
    return {};
}

Result<> LogWriter::beginPiece(const std::filesystem::path& fresh, const ChangeSet& state) {
    descriptor_ = ::open(fresh.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (descriptor_ < 0 || !lockForWriting(descriptor_, fresh)) return std::unexpected(failure("cannot write", errno));
    makeHead();
    if (auto ok = writeHead(); !ok) return ok;
    firstOfEpoch_ = true;
    if (auto ok = write(state); !ok) return ok;
    --frames_;
    return {};
}

/// The file has both names for a moment, or neither if the file system has no hard links.
Result<> LogWriter::moveIntoPlace(const std::filesystem::path& fresh, const std::filesystem::path& piece) {
    const bool linked = ::link(file_.c_str(), piece.c_str()) == 0;
    if (!linked && (errno == ENOENT || errno == EEXIST || ::rename(file_.c_str(), piece.c_str()) != 0))
        return std::unexpected(failure("cannot rotate", errno));
    if (::rename(fresh.c_str(), file_.c_str()) == 0) return {};
    const int error = errno;
    if (linked)
        ::unlink(piece.c_str());
    else
        ::renameat2(AT_FDCWD, piece.c_str(), AT_FDCWD, file_.c_str(), RENAME_NOREPLACE);
    return std::unexpected(failure("cannot rotate", error));
}

/// How many of the oldest pieces are to go, now that the present file is full.
std::size_t LogWriter::oldPieces(double now) const {
    std::error_code error;
    const auto sizeOf = [&](const Piece& piece) {
        const std::uintmax_t size = std::filesystem::file_size(piece.file, error);
        return error ? 0 : static_cast<std::uint64_t>(size);
    };
    std::uint64_t held = 2 * size_;  // the next file counts as large as this one
    if (options_.keepBytes > 0)
        for (const Piece& piece : pieces_) held += sizeOf(piece);
    const std::filesystem::path folder = file_.has_parent_path() ? file_.parent_path() : ".";
    const std::filesystem::space_info space = std::filesystem::space(folder, error);
    const double wanted =
        error ? 0 : options_.keepFree * static_cast<double>(space.capacity) + static_cast<double>(size_);
    std::uint64_t free = error ? 0 : space.available;
    std::size_t count = 0;
    for (; count < pieces_.size(); ++count) {
        const bool old = options_.keepSeconds > 0 && pieces_[count].end < now - options_.keepSeconds;
        const bool large = options_.keepBytes > 0 && held > options_.keepBytes;
        const bool narrow = options_.keepFree > 0 && static_cast<double>(free) < wanted;
        if (!old && !large && !narrow) break;
        const std::uint64_t size = sizeOf(pieces_[count]);
        held -= std::min(size, held);
        free += size;
    }
    return count;
}

/// Deletes the oldest pieces. One that cannot be deleted is tried again with the next file.
void LogWriter::dropPieces(std::size_t count) {
    std::size_t index = 0;
    std::erase_if(pieces_, [&](const Piece& piece) {
        std::error_code error;
        return index++ < count && (std::filesystem::remove(piece.file, error), !error);
    });
}

Result<> LogWriter::writeIndex(const RecordHeader& next) {
    encodeLogIndex(keyframes_, size_, record_, next);
    return writeRecord(record_);
}

void LogWriter::abandon() {
    if (descriptor_ < 0) return;
    discard();
    ::close(std::exchange(descriptor_, -1));
    if (replaced_ >= 0) ::close(std::exchange(replaced_, -1));
}

Result<> LogWriter::close() {
    if (descriptor_ < 0) return {};
    Result<> result = checkFile();
    if (result && !broken_) result = writeIndex();
    if (result && !broken_) result = flush();
    if (broken_ || replaced_ >= 0) discard();
    if (replaced_ >= 0) ::close(std::exchange(replaced_, -1));
    if (::close(descriptor_) != 0 && result) result = std::unexpected(failure("cannot close", errno));
    descriptor_ = -1;
    return result;
}

}  // namespace rtsg
