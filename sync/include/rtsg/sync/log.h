// Log: a file of records (record.h): heads, keyframes and frames, in the same bytes as on the wire, and at the end an
// index of the keyframes.
//
// Invariant: apply() writes a record with one write() before it returns; the state is then acknowledged. A killed
// process loses no acknowledged state, as the page cache outlives it (LogOptions::sync asks for more). Everything a
// reader needs is repeated before each keyframe, so damage costs at most the frames up to the next keyframe. A reader
// keeps every intact record, reports the bytes that it skipped, and rebuilds a missing index.
// Threading: one thread an object. A log may be read while it is written: the record being written does not count as
// damage. Files are read and never mapped, so a file that shrinks under its reader just ends early.

// Example:
//     #include <rtsg/core/node_type.h>
//     #include <rtsg/core/scene.h>
//     #include <rtsg/sync/log.h>
//     rtsg::Scene scene;
//     const auto log = rtsg::LogWriter::create("session.rlog", rtsg::builtinTypes());
//     if (!log) return;
//     const rtsg::Attachment attachment = scene.bus().attach(**log);
//     for (int frame = 0; frame < 600; ++frame) scene.newFrame(frame / 60.0);
//     if (const auto closed = (*log)->close(); !closed) std::cerr << closed.error().format() << '\n';
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <rtsg/core/bus.h>
#include <rtsg/core/output_file.h>
#include <rtsg/sync/change_codec.h>
#include <rtsg/sync/dictionary.h>
#include <rtsg/sync/encoded_record.h>
#include <rtsg/sync/input_codec.h>
#include <rtsg/sync/record.h>

namespace rtsg {

struct LogKeyframe {
    std::uint64_t offset = 0;  // offset of the record, bytes from the file's start
    std::uint64_t to = 0;      // the state that it holds
    double time = 0;           // seconds
    std::uint64_t head = 0;    // offset of the head record that explains its numbers
    friend bool operator==(const LogKeyframe&, const LogKeyframe&) = default;
};

struct LogOptions {
    std::string creator = "rtsg";
    /// With Mode::input the log has keyframes, and for each frame only its input. The scene must record its inputs
    /// (Scene::setInputRecording) before the log is attached.
    StreamMode mode;
    /// For Mode::state: the input of each frame is written before the frame, if the scene records it. Tests that run
    /// the application again need it; other readers skip it.
    bool inputs = false;
    /// A keyframe is written when the frames since the last one take this many bytes and `keyframeFactor` times the
    /// bytes of the last keyframe. So the cost of keyframes stays a fixed share of the frames'.
    std::uint64_t keyframeBytes = std::uint64_t{1} << 20;
    double keyframeFactor = 2;
    /// A keyframe is also written after this much scene time, in seconds, since the last one; later if keyframes would
    /// take more than 1 MiB a second. 0 switches this off. Damage costs at most the time between two keyframes.
    double keyframeSeconds = 10;
    /// The first keyframe of an epoch is written twice if it is at most this long, because no earlier one could replace
    /// it.
    std::uint64_t repeatFirstUpTo = std::uint64_t{1} << 20;
    /// A new file is begun when the log has this many bytes (and at least four times those of a keyframe) or this much
    /// scene time in seconds; 0 means never. The full file is renamed: a.rlog becomes a.0001.rlog and so on. Each is a
    /// whole log of the same session, and a.rlog has the newest states. Works with apply(), which can take the first
    /// keyframe of the new file.
    std::uint64_t rotateBytes = 0;
    double rotateSeconds = 0;
    /// Renamed files whose states are all older than this, in seconds of scene time, are deleted; 0 keeps all.
    double keepSeconds = 0;
    /// When a new file is begun, the oldest renamed ones are deleted until the whole log takes at most this many bytes,
    /// where the new file is counted with the size of the last one; 0 means no limit. The newest renamed file is never
    /// deleted.
    std::uint64_t keepBytes = 0;
    /// The same until this share of the file system is free, and also as many bytes as the last file has; 0 means no
    /// limit.
    double keepFree = 0;
    /// When the data must be on the medium, and not only with the operating system. Each flush takes milliseconds.
    enum class Sync : std::uint8_t { atClose, atKeyframes, always } sync = Sync::atClose;
    /// What happens to an existing file of this name, and to its pieces if the new log rotates. A file that is replaced
    /// is not truncated, so its readers can finish.
    Existing existing = Existing::replace;
    /// Appends behind the last intact record of an existing log instead of replacing it.
    bool append = false;
    /// When appending: the scene time, in seconds, at which the session began, for the heads of later pieces. Empty:
    /// the log's first state tells it.
    std::optional<double> sessionStart;
    /// The epoch of the session: that of a mirror server of the same scene, or that of the log appended to. 0: a new
    /// one.
    std::uint64_t epoch = 0;
};

class LogWriter : public Subscriber {
  public:
    /// `types` gives the meaning of TypeIndex numbers; builtinTypes() serves any scene. Errors: the file cannot be
    /// written, or another writer has it open.
    static Result<std::unique_ptr<LogWriter>> create(const std::filesystem::path& file, TypeTable types,
                                                     LogOptions options = {});
    ~LogWriter() override;

    Result<> apply(const Scene& scene, const ChangeSet& changes) override;
    std::string subscriberName() const override { return "log " + file_.string(); }

    /// Does what apply() does without the scene, so it writes only the keyframes that it is given. A snapshot of
    /// another state than the last one written begins a new epoch, because the scene was a replica that joined anew.
    /// After an error nothing more is written, and the file ends with the last whole record. Errors: the disk is full;
    /// somebody deleted or truncated the file, which is noticed at the next keyframe or at close().
    Result<> write(const ChangeSet& changes);
    /// Writes a frame that somebody else has encoded, with its bytes as they are. `set` is the same frame decoded; it
    /// is encoded instead if the log lacks a type description that the bytes rely on. `set` may be null if the frame
    /// creates no nodes. Precondition: the frame follows the last one.
    Result<> write(const EncodedRecord& frame, const ChangeSet* set);
    /// True after a frame if a keyframe or another file is due. Then call write() with the state's snapshot.
    bool wantsSnapshot() const;
    /// Writes the snapshot of the last state as a keyframe, in another file if one is due.
    Result<> writeSnapshot(const ChangeSet& snapshot);
    /// Number of frames that were encoded here rather than written as they came.
    std::uint64_t encoded() const { return encoded_; }
    /// Marks the session as complete: the next session in the same file follows its last state without a loss.
    Result<> endSession() { return writeIndex(); }
    /// Writes the index, flushes and closes. Only here are the errors of this last step reported; the destructor drops
    /// them.
    Result<> close();
    /// Closes without the index, as a killed process would. Readers can tell that the log ended early.
    void abandon();

    std::uint64_t bytes() const { return size_; }
    std::uint64_t frames() const { return frames_; }
    std::uint64_t epoch() const { return epoch_; }

  private:
    /// A renamed file, with the time of its last state in seconds.
    struct Piece {
        std::filesystem::path file;
        double end = 0;
        std::uint64_t epoch = 0;
    };

    LogWriter(std::filesystem::path file, TypeTable types, LogOptions options);
    Result<> openFile();
    Result<> openAppended();
    void goOnInFile();
    void goOnBehind(const std::filesystem::path& piece);
    Result<> beginEpoch();
    void makeHead();
    Result<> writeHead();
    Result<> writeKeyframe(const ChangeSet& changes);
    Result<> writeFrame(const ChangeSet& changes);
    void enter(std::uint64_t state, const Hash128& hash, double time);
    Result<> entered(bool isSnapshot);
    Result<> writeRecord(const ByteBuffer& record);
    Result<> writeIndex(const RecordHeader& next = {});
    Result<> checkFile();
    Result<> flush();
    bool keyframeDue(double now) const;
    bool rotationDue(double now) const;
    Result<> rotate(const ChangeSet& state);
    Result<> beginPiece(const std::filesystem::path& fresh, const ChangeSet& state);
    Result<> moveIntoPlace(const std::filesystem::path& fresh, const std::filesystem::path& piece);
    void dropSecondName();
    Result<> replaceFile();
    Result<> dropReplacedPieces();
    void discard();
    Result<std::filesystem::path> freePieceName();
    void adoptPieces();
    std::size_t oldPieces(double now) const;
    void dropPieces(std::size_t count);
    Diagnostic failure(std::string_view what, int error) const;

    std::filesystem::path file_;
    TypeTable types_;
    LogOptions options_;
    int descriptor_ = -1;
    int replaced_ = -1;                       // the file that this one will replace; its lock keeps other writers away
    std::filesystem::path created_, target_;  // the temporary path, and the one that it will get
    std::vector<std::filesystem::path> replacedPieces_;  // pieces of the log that is replaced
    bool broken_ = false;
    std::uint64_t state_ = 0;  // the last state written; its hash and time follow
    Hash128 hash_;
    double time_ = 0;
    std::uint64_t epoch_ = 0, size_ = 0, frames_ = 0, encoded_ = 0, head_ = 0;
    std::uint64_t sinceKeyframe_ = 0, keyframeSize_ = 0;
    double keyframeTime_ = 0;
    bool regular_ = true, firstOfEpoch_ = true;
    std::vector<LogKeyframe> keyframes_;
    std::optional<double> pieceStart_, sessionStart_;  // scene times of the first states of the file and of the session
    std::optional<double> keptFrom_;  // time of the oldest state in the pieces that stay, if some were deleted
    bool isLater_ = false;            // pieces of the session come before this file
    std::vector<Piece> pieces_;
    std::uint64_t pieceNumber_ = 0;
    ChangeEncoder encoder_;
    InputEncoder inputs_;
    ByteBuffer record_, headRecord_;
};

class LogFiles;

/// A run of bytes that no intact record covers.
struct LogDamage {
    std::uint64_t offset = 0, length = 0;
    std::string text;
};

class LogReader {
  public:
    /// `file` may be a folder with the pieces of one log, or several files with commas between them
    /// ("a.0001.rlog,a.rlog"), which are read one after the other (filesOfLog()). Errors: there is no such file, or it
    /// has no intact record. Records with a payload of more than `maxPayload` bytes count as damaged.
    static Result<LogReader> open(const std::filesystem::path& file, std::uint64_t maxPayload = kMaxPayload);
    LogReader(LogReader&& other) noexcept;
    LogReader& operator=(LogReader&& other) noexcept;
    ~LogReader();

    struct Record {
        RecordHeader header;
        std::uint64_t offset = 0;
        std::span<const std::byte> bytes;  // the whole record; valid until the next call
    };
    /// Returns the next intact record of any kind, or nothing at the end. Skips damaged bytes and notes them in
    /// damage().
    std::optional<Record> next();
    /// Sets where next() goes on; `offset` must be that of a record.
    void seek(std::uint64_t offset) { position_ = offset; }
    std::uint64_t position() const { return position_; }
    std::uint64_t size() const { return size_; }

    /// The keyframes in file order, from the index or, if there is no intact one, from a scan of all records.
    const std::vector<LogKeyframe>& keyframes();
    bool hadIndex() const { return hadIndex_; }

    const std::vector<LogDamage>& damage() const { return damage_; }
    /// Says how many places are damaged, and describes the first. Empty if none is.
    std::string damageText() const;
    const std::filesystem::path& file() const { return file_; }
    /// End of the last intact record that next() returned.
    std::uint64_t intactEnd() const { return intactEnd_; }
    /// True if that record was the index that ends a session. If it was not, later states are unknown: the writer was
    /// killed or is still writing, the file was truncated, or pieces are missing. Call it when next() has returned
    /// nothing; the same holds for goesOn().
    bool closed() const { return closed_; }
    /// True if that record was the index of a piece that has a later piece.
    bool goesOn() const { return goesOn_; }
    /// True if a writer has the file open. A record that was half written when next() reached it counts neither as
    /// intact nor as damaged, as the rest is still to come.
    bool beingWritten() const;

  private:
    LogReader() = default;
    Result<RecordHeader> load(std::uint64_t offset);
    bool waitsForMore(std::uint64_t offset);
    void growTo(std::uint64_t end);
    std::uint64_t findMagic(std::uint64_t from);
    void noteDamage(std::uint64_t from, std::uint64_t to, std::string text);
    bool readIndex();
    bool readIndex(std::uint64_t from, std::uint64_t end, std::vector<LogKeyframe>& into);
    void scanKeyframes();

    std::filesystem::path file_;
    std::unique_ptr<LogFiles> files_;
    std::uint64_t size_ = 0, position_ = 0, intactEnd_ = 0, maxPayload_ = kMaxPayload;
    std::uint64_t searchBudget_ = 0;  // bytes that may still be hashed to find the next record after damage
    std::vector<LogDamage> damage_;
    std::optional<std::vector<LogKeyframe>> keyframes_;
    bool hadIndex_ = false, closed_ = false, goesOn_ = false;
    ByteBuffer window_;  // bytes of the file from windowAt_ on
    std::uint64_t windowAt_ = 0;
};

/// True if a LogWriter, of this program or another, has the file open. False if there is no file.
bool isBeingWritten(const std::filesystem::path& file);

/// The files that a name stands for, in order: those of a folder, which must be the pieces of one log (NAME.0001.rlog
/// and so on, then NAME.rlog); or those separated by commas, if no file has that name; or the one file. Error: the
/// folder has no log, or several.
Result<std::vector<std::filesystem::path>> filesOfLog(const std::filesystem::path& name);
/// The gaps between the files of a name, one sentence for each gap. It reads only the beginning and end of each file.
std::vector<std::string> gapsBetweenFiles(const std::filesystem::path& name);
/// The earlier files of a log in pieces, in order: those that have its name and a number.
std::vector<std::filesystem::path> earlierPieces(const std::filesystem::path& file);
/// Those of the earlier files whose content shows that they are pieces; a log that only has such a name is left out.
/// They are deleted when a rotating log replaces `file`.
std::vector<std::filesystem::path> recordedPieces(const std::filesystem::path& file);
/// The log that a numbered file is a piece of: the file beside it without the number. Empty if there is none.
std::filesystem::path laterPiece(const std::filesystem::path& piece);

}  // namespace rtsg
