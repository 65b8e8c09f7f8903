// Log: a file of records (record.h): heads, keyframes and frames, the same bytes as on the wire, and at the end an
// index of the keyframes.
//
// Invariant: a record is written with one write() before apply() returns; a state is acknowledged once apply() has
// returned, and a killed process loses none of those (the page cache outlives it; LogOptions::sync asks for more).
// What a reader needs is repeated before every keyframe, so damage costs at most the frames up to the next keyframe.
// A reader keeps every intact record, reports the bytes it had to skip, and rebuilds the index where it is missing.
// Threading: one thread an object. A log may be read while it is written: what its writer is at is no damage. Files are
// read, never mapped: one that shrinks under its reader reads as cut short.

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
    std::uint64_t offset = 0;  // of the record, bytes from the file's start
    std::uint64_t to = 0;      // the state it holds
    double time = 0;           // seconds
    std::uint64_t head = 0;    // offset of the head record that explains its numbers
    friend bool operator==(const LogKeyframe&, const LogKeyframe&) = default;
};

struct LogOptions {
    std::string creator = "rtsg";
    /// Mode::input: keyframes, and of each frame only what came into it. The scene must record its inputs
    /// (Scene::setInputRecording) from before the log is attached.
    StreamMode mode;
    /// Mode::state: in front of each frame goes what came into it, where the scene records that: what tests that run
    /// the application again need. Other readers skip it.
    bool inputs = false;
    /// A keyframe is written once the frames since the last one take this many bytes and `keyframeFactor` times
    /// the last keyframe: its cost then stays a fixed share of the frames'.
    std::uint64_t keyframeBytes = std::uint64_t{1} << 20;
    double keyframeFactor = 2;
    /// And, whatever they take, once this much scene time has passed since the last one, seconds; later where keyframes
    /// would then take more than 1 MiB for each second. 0: never for that reason. Damage costs what lies between two.
    double keyframeSeconds = 10;
    /// The first keyframe of an epoch is written twice if it is not longer than this: nothing before it could stand
    /// in for it.
    std::uint64_t repeatFirstUpTo = std::uint64_t{1} << 20;
    /// A new file is begun once the log takes so many bytes (and four times those of a keyframe), or so much scene
    /// time, in seconds; 0: never. What is full is renamed: of a.rlog a.0001.rlog and so on, each a whole log of the
    /// same session; a.rlog has the newest states. For apply(), which can take a keyframe to begin with.
    std::uint64_t rotateBytes = 0;
    double rotateSeconds = 0;
    /// Of these files only those with something of the last so many seconds stay; 0: all.
    double keepSeconds = 0;
    /// When the data has to be on the medium itself, not only with the system: costs milliseconds each time.
    enum class Sync : std::uint8_t { atClose, atKeyframes, always } sync = Sync::atClose;
    /// What becomes of a file of this name, and of its pieces where the new log rotates. One that is replaced is never
    /// cut: whoever reads it reads on.
    Existing existing = Existing::replace;
    /// Goes on behind the last intact record of an existing log instead of replacing it.
    bool append = false;
    /// Appended: when the session began, scene time in seconds, for the heads of later pieces; else the first state
    /// says it.
    std::optional<double> sessionStart;
    /// The session that the log belongs to, as a mirror server of the same scene names it, or, appended, as it was; 0:
    /// one of its own.
    std::uint64_t epoch = 0;
};

class LogWriter : public Subscriber {
  public:
    /// `types`: what TypeIndex numbers mean, builtinTypes() for any scene. Fails when the file cannot be written or
    /// another writer has it open.
    static Result<std::unique_ptr<LogWriter>> create(const std::filesystem::path& file, TypeTable types,
                                                     LogOptions options = {});
    ~LogWriter() override;

    Result<> apply(const Scene& scene, const ChangeSet& changes) override;
    std::string subscriberName() const override { return "log " + file_.string(); }

    /// As apply, without the scene: writes no keyframes but those given. A snapshot of another state than the last
    /// one written begins a new epoch: the scene was a replica that joined anew. After an error (the disk is full; the
    /// file was deleted or cut by someone else, which is noticed at the next keyframe or at close) nothing more is
    /// written; what was is left ending with the last whole record.
    Result<> write(const ChangeSet& changes);
    /// As write(), of a frame that somebody else has encoded, whose bytes go into the file as they are. `set`, which it
    /// holds, is written instead where the log lacks what such bytes count on (the description of a node type); null
    /// where it creates no nodes. Precondition: the frame follows the last one.
    Result<> write(const EncodedRecord& frame, const ChangeSet* set);
    /// After a frame: it is time for a keyframe, or for another file; write() with the state's snapshot makes it.
    bool wantsSnapshot() const;
    /// The snapshot of the last state written: a keyframe, in another file if it is time for one.
    Result<> writeSnapshot(const ChangeSet& snapshot);
    /// Frames that were encoded here, not written as they came.
    std::uint64_t encoded() const { return encoded_; }
    /// Nothing is missing between the last state and the first of a session that is to follow in the same file.
    Result<> endSession() { return writeIndex(); }
    /// Writes the index, flushes, closes. Errors of this last step are only seen here; the destructor does the same.
    Result<> close();
    /// Closes without the index, as if killed: who reads it can tell that it ended before its time.
    void abandon();

    std::uint64_t bytes() const { return size_; }
    std::uint64_t frames() const { return frames_; }
    std::uint64_t epoch() const { return epoch_; }

  private:
    /// A file that was renamed; the time of its last state, seconds.
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
    Result<> putInPlace(const std::filesystem::path& fresh, const std::filesystem::path& piece);
    void dropSecondName();
    Result<> takePlace();
    Result<> dropReplacedPieces();
    void discard();
    Result<std::filesystem::path> freePieceName();
    void adoptPieces();
    bool isOld(const Piece& piece, double now) const;
    void dropOldPieces(double now);
    Diagnostic failure(std::string_view what, int error) const;

    std::filesystem::path file_;
    TypeTable types_;
    LogOptions options_;
    int descriptor_ = -1;
    int replaced_ = -1;                    // the file whose place it will take: its lock keeps others from it
    std::filesystem::path made_, target_;  // where it is until then, if it was made here; and what leads to that one
    std::vector<std::filesystem::path> replacedPieces_;  // of what it replaces
    bool broken_ = false;
    std::uint64_t state_ = 0;  // last one written, its hash and its time beside it
    Hash128 hash_;
    double time_ = 0;
    std::uint64_t epoch_ = 0, size_ = 0, frames_ = 0, encoded_ = 0, head_ = 0;
    std::uint64_t sinceKeyframe_ = 0, keyframeSize_ = 0;
    double keyframeTime_ = 0;
    bool regular_ = true, firstOfEpoch_ = true;
    std::vector<LogKeyframe> keyframes_;
    std::optional<double> pieceStart_, sessionStart_;  // scene times of the file's and the session's first state
    std::optional<double> keptFrom_;                   // of the oldest state in a piece that stays, where some went
    bool isLater_ = false;                             // pieces of the session come before this file
    std::vector<Piece> pieces_;
    std::uint64_t pieceNumber_ = 0;
    ChangeEncoder encoder_;
    InputEncoder inputs_;
    ByteBuffer record_, headRecord_;
};

/// Bytes that no intact record covers.
struct LogDamage {
    std::uint64_t offset = 0, length = 0;
    std::string text;
};

class LogReader {
  public:
    /// Fails when there is no such file or not one intact record in it. Records with a longer payload than `maxPayload`
    /// bytes count as damaged.
    static Result<LogReader> open(const std::filesystem::path& file, std::uint64_t maxPayload = kMaxPayload);
    LogReader(LogReader&& other) noexcept;
    LogReader& operator=(LogReader&& other) noexcept;
    ~LogReader();

    struct Record {
        RecordHeader header;
        std::uint64_t offset = 0;
        std::span<const std::byte> bytes;  // the whole record; valid until the next call
    };
    /// The next intact record of any kind; nothing at the end. Skips what is damaged and notes it in damage().
    std::optional<Record> next();
    /// Where next() goes on; `offset` is a record's.
    void seek(std::uint64_t offset) { position_ = offset; }
    std::uint64_t position() const { return position_; }
    std::uint64_t size() const { return size_; }

    /// In file order; from the index at the end or, without an intact one, from a scan of the records.
    const std::vector<LogKeyframe>& keyframes();
    bool hadIndex() const { return hadIndex_; }

    const std::vector<LogDamage>& damage() const { return damage_; }
    /// How many places, and the first of them; empty: none.
    std::string damageText() const;
    const std::filesystem::path& file() const { return file_; }
    /// End of the last intact record that next() has returned.
    std::uint64_t intactEnd() const { return intactEnd_; }
    /// Whether that record was the index that a session ends with: if not, its writer was killed or is still at it,
    /// somebody cut it, or pieces are missing, and what came after is not known. Of use once next() has returned
    /// nothing, as goesOn().
    bool closed() const { return closed_; }
    /// Whether that record was the index of a piece that another one follows.
    bool goesOn() const { return goesOn_; }
    /// Whether a writer has the file open. The record that it was in the middle of when next() came there is neither
    /// intact nor damaged: it is yet to come.
    bool beingWritten() const;

  private:
    LogReader() = default;
    bool read(std::uint64_t offset, std::size_t length, ByteBuffer& into);
    Result<RecordHeader> load(std::uint64_t offset);
    bool waitsForMore(std::uint64_t offset);
    void growTo(std::uint64_t end);
    std::uint64_t findMagic(std::uint64_t from);
    void noteDamage(std::uint64_t from, std::uint64_t to, std::string text);
    bool readIndex();
    void scanKeyframes();

    std::filesystem::path file_;
    int descriptor_ = -1;
    std::uint64_t size_ = 0, position_ = 0, intactEnd_ = 0, maxPayload_ = kMaxPayload;
    std::uint64_t searchBudget_ = 0;  // bytes of hashing left for candidates found while resynchronising
    std::vector<LogDamage> damage_;
    std::optional<std::vector<LogKeyframe>> keyframes_;
    bool hadIndex_ = false, closed_ = false, goesOn_ = false;
    ByteBuffer window_;  // the file's bytes from windowAt_
    std::uint64_t windowAt_ = 0;
};

/// Whether a LogWriter, of this program or another, has the file open. False if there is none.
bool isBeingWritten(const std::filesystem::path& file);

/// The files before this one of a log that was written in pieces, in order: those with its name and a number.
std::vector<std::filesystem::path> earlierPieces(const std::filesystem::path& file);
/// Those of them that were written as pieces, as what is in them says: a log that only has such a name is none. They go
/// when a log that rotates replaces `file`.
std::vector<std::filesystem::path> recordedPieces(const std::filesystem::path& file);
/// The log that a file with a number in its name was a piece of: the one beside it without the number. Empty: none.
std::filesystem::path laterPiece(const std::filesystem::path& piece);

}  // namespace rtsg
