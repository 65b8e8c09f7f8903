// Replay: plays a log back into a scene, checking each state against the origin's hash; and compares logs.
//
// Invariant: the scene is always in a state of the log. After damaged bytes the replay goes on at the next keyframe.
// Subscribers of the scene's bus see what those of the origin saw. A log of another build or an earlier format is
// checked with the writer's node types and version of the hash, so logs stay valid when types gain fields. Threading:
// one thread, which owns the scene.

// Example:
//     #include <rtsg/sync/replay.h>
//     const auto replayer = rtsg::Replayer::open("session.rlog");
//     if (!replayer) return;
//     rtsg::Result<bool> more = true;
//     while (more && *more) more = (*replayer)->step();  // one state at a time, each checked against its hash
//     std::cout << (*replayer)->verified() << " of " << (*replayer)->frames() << " states verified\n";
#pragma once

#include <array>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <rtsg/core/scene.h>
#include <rtsg/sync/input_replica.h>
#include <rtsg/sync/log.h>

namespace rtsg {

/// The place where two states or two logs differ. `node` is a DEF name or, without one, "#" and the node's number.
/// `field` is a field's name or another property ("type", "name", "routes", "existence"). Both may be empty if unknown.
struct Divergence {
    std::uint64_t frame = 0;  // state number; 0 if it concerns no single state
    double time = 0;          // seconds
    std::string node, field, text;

    /// One line: frame, time, node.field and what is wrong with it.
    std::string format() const;
};

/// What the two sides are called in a Divergence's text: "recorded 1, now 2".
struct DifferenceWords {
    std::string_view a = "first", b = "second";
};

/// Returns nothing if the states are equal. Of several differences it prefers one that no other leads to by a route,
/// which is the cause rather than an effect; then the first in order of node numbers and fields. `frame` and `time` are
/// those of `a`.
std::optional<Divergence> firstDifference(const Scene& a, const Scene& b, DifferenceWords words = {});

/// Says that a log begins later than its session, because it is a later piece of a rotated log, or several of them.
struct LaterPiece {
    double begins = 0;  // seconds into the session
    double letGo = 0;   // seconds from the session's start that were deleted on purpose; all if equal to `begins`
    /// Says where the earlier part is: "what came before is in pieces before it".
    std::string format() const;
};

class Replayer {
  public:
    /// `maxPayload` and errors: as LogReader::open.
    static Result<std::unique_ptr<Replayer>> open(const std::filesystem::path& file,
                                                  std::uint64_t maxPayload = kMaxPayload);

    /// The scene that is replayed. Its behaviours are off, since the log has all their effects. For a log in input mode
    /// they are on and run again; then register the application's deterministic ones (by name) before the first step.
    Scene& scene() { return *scene_; }
    /// Brings the scene to the log's next state. False at the end. An error means that an intact record could not be
    /// applied; the next step then goes on at the next keyframe.
    Result<bool> step();
    /// Goes to the last state whose time() is not after `time`, or to the first state if all are later. It starts from
    /// the nearest intact keyframe, or from the present state if that is nearer. Subscribers get the keyframe and one
    /// set with all later changes. A log of several sessions is read through once for this.
    Result<> seek(double time);
    /// The scene's time, made to never go back: a session whose times begin earlier than the last one ended continues
    /// from that end.
    double time() const { return frames_ == 0 ? scene_->now() : time_; }
    /// The time of the state that step() leads to next, as far as the log is intact; nothing at the end. Several states
    /// may have the same time, as when an Inline has loaded.
    std::optional<double> nextTime();
    /// The first and the last of the frames that are missing between the present one and the next that the log holds.
    /// Nothing if none is, or if the next one is of another session. It looks ahead, as nextTime() does.
    std::optional<std::pair<std::uint64_t, std::uint64_t>> missingNext();
    /// True if no state comes after the present one.
    bool atEnd() { return !nextTime(); }

    std::uint64_t frames() const { return frames_; }      // states reached by step() and seek()
    std::uint64_t verified() const { return verified_; }  // those of `frames` with the origin's hash
    std::uint64_t gaps() const { return gaps_; }          // times that frames were missing
    /// Frames of states earlier than the scene's state: pieces of the log are in the wrong order.
    std::uint64_t framesBehind() const { return behind_; }
    /// Times that step() came to another session and it is unknown what lies between the two. seam() tells why for the
    /// last of them.
    std::uint64_t unclosedSessions() const { return unclosed_; }
    enum class Seam : std::uint8_t {
        notClosed,     // nothing ended the earlier session: its writer was killed, or a replica joined anew
        goesOn,        // the earlier session goes on in a piece that does not follow
        beginsBefore,  // the later session begins in a piece that is not before it
    };
    Seam seam() const { return seam_; }
    /// The last set applied, which led to the scene's state. After seek() it may be merged from several. It has `input`
    /// where the log has it; in input mode it has nothing else.
    const ChangeSet& lastSet() const { return *set_; }
    /// The first state whose hash is not the origin's. Node and field are exact if the log itself can tell, by running
    /// the frame again from its input or at the next keyframe. Otherwise the text says that they are a guess.
    const std::optional<Divergence>& divergence() const { return divergence_; }
    /// Empty if the log begins where its first session did. How much was deleted is known once the log has been read.
    std::optional<LaterPiece> laterPiece();
    const LogReader& log() const { return log_; }
    const StreamHead& head() const { return head_; }
    /// The parts of the log that this program does not know, which it left out of the scene.
    const DecoderLosses& losses() const { return decoder_.losses(); }
    const std::vector<LogKeyframe>& keyframes() { return log_.keyframes(); }

  private:
    explicit Replayer(LogReader log);
    Result<bool> take(const LogReader::Record& record);
    Result<bool> takeInput(const LogReader::Record& record);
    bool leadsOn(const RecordHeader& header);
    void missFrames();
    void meetSession();
    Result<> goesOn(const LogReader::Record& record, double from);
    Result<> apply(const LogReader::Record& record);
    Result<> adoptHead(std::span<const std::byte> record);
    bool startAt(const LogKeyframe& keyframe);
    Result<> composeUntil(double time);
    double timeOf(const RecordHeader& header) const;
    void noteTime(const RecordHeader& header);
    void findCycles();
    double shiftAt(std::uint64_t offset) const;
    Result<> lose(std::uint64_t offset, std::uint64_t state, std::string_view why);
    void check(const RecordHeader& header, const ChangeSet& set);
    std::optional<Divergence> compareWithRerun(const RecordHeader& header, const ChangeSet& set) const;
    std::optional<Divergence> compareAtNextKeyframe() const;

    LogReader log_;
    StreamHead head_, first_;  // of the present session, and of the first one in the log
    ChangeDecoder decoder_;
    InputDecoder inputDecoder_{&decoder_};
    std::unique_ptr<Scene> scene_;
    std::unique_ptr<InputReplica> runner_;  // computes the frames in input mode
    std::shared_ptr<ChangeSet> input_;      // otherwise: the input of the frame that follows in the log
    bool headed_ = false;                   // head_ is of this epoch
    bool lost_ = true;                      // waiting for a keyframe
    bool reported_ = false;                 // missing frames have been reported until then
    bool closed_ = false, goesOn_ = false;  // kind of the last record, apart from heads; as in LogReader
    Seam seam_ = Seam::notClosed;
    std::uint64_t frames_ = 0, verified_ = 0, gaps_ = 0, behind_ = 0, unclosed_ = 0;
    double time_ = -std::numeric_limits<double>::infinity();
    double shift_ = 0;  // time() minus the scene's time
    /// From this offset on, shift_ has that value, because a session begins earlier than the last one ended. For
    /// seek().
    struct Cycle {
        std::uint64_t offset = 0;
        double shift = 0;
    };
    std::optional<std::vector<Cycle>> cycles_;
    std::optional<Divergence> divergence_;
    std::shared_ptr<ChangeSet> set_ = std::make_shared<ChangeSet>();
};

struct ComparedStates {
    std::uint64_t both = 0, one = 0;    // states that both logs hold, and that only one holds
    std::array<std::string, 2> damage;  // LogReader::damageText() of each; all states may be there in spite of it
    /// "in every state", or the number of states that could be compared.
    std::string format() const;
};
/// Compares two logs state by state. Returns nothing if they share at least one state number, agree in all that they
/// share, end with the same state, and neither lacks states in the middle that the other has. One may begin later or
/// have merged frames. `progress` gets the bytes of `a` that were read, and their total.
Result<std::optional<Divergence>> diffLogs(const std::filesystem::path& a, const std::filesystem::path& b,
                                           const std::function<void(std::uint64_t, std::uint64_t)>& progress = {},
                                           ComparedStates* compared = nullptr);

}  // namespace rtsg
