// Replay: a log back into a scene, each state checked against the hash that the origin had; and logs compared.
//
// Invariant: the scene is always in a state of the log. Where bytes are damaged the replay goes on at the next
// keyframe. Subscribers of the scene's bus see what those of the origin saw.
// A log of another build, or of an earlier format, is checked as its writer would: with the writer's node types and
// version of the hash, so that logs stay good whatever types gain. Threading: one thread, which owns the scene.

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

/// Where two states or two logs part. `node` is a DEF name or, without one, "#" and the node's number; `field` is a
/// field's name, or what else differs ("type", "name", "routes", "existence"); both may be empty when unknown.
struct Divergence {
    std::uint64_t frame = 0;  // state number; 0: of no state, but of all
    double time = 0;          // seconds
    std::string node, field, text;

    /// One line: frame, time, node.field and what is wrong with it.
    std::string format() const;
};

/// What the two sides are called in a Divergence's text: "recorded 1, now 2".
struct DifferenceWords {
    std::string_view a = "first", b = "second";
};

/// Nothing when the states are equal. Of several differences, one that no other leads to by a route: the cause rather
/// than what followed from it; of those the first in order of node numbers and fields. `frame` and `time` are those of
/// `a`.
std::optional<Divergence> firstDifference(const Scene& a, const Scene& b, DifferenceWords words = {});

/// A log that does not begin where its session did: a later piece of a rotated one, or several.
struct LaterPiece {
    double begins = 0;  // seconds into the session
    double letGo = 0;   // of the session's first seconds so many were let go on purpose, as a ring does; `begins`: all
    /// Where what came before is: "what came before is in pieces before it".
    std::string format() const;
};

class Replayer {
  public:
    /// `maxPayload`: as LogReader::open.
    static Result<std::unique_ptr<Replayer>> open(const std::filesystem::path& file,
                                                  std::uint64_t maxPayload = kMaxPayload);

    /// Its behaviours are off: everything they did is in the log. Of a log in input mode they are on, and do it again;
    /// the application's deterministic ones have to be registered (by name) before the first step.
    Scene& scene() { return *scene_; }
    /// Brings the scene to the log's next state. False at the end. An error means that an intact record could not be
    /// applied; stepping on then resumes at the next keyframe.
    Result<bool> step();
    /// To the last state whose time() is not after `time` (the first one if all are): from the nearest intact keyframe,
    /// or from where it is if that is nearer. Subscribers get the keyframe and one set with all that came after it. A
    /// log of several sessions is read through once for that.
    Result<> seek(double time);
    /// The scene's time, but that it never goes back: a session that begins with an earlier time than the one before it
    /// in the log ended with goes on from there.
    double time() const { return frames_ == 0 ? scene_->now() : time_; }
    /// The time of the state that step() leads to next, as far as the log is intact; nothing at the end. States may
    /// share an instant: what an Inline brought is one of its own.
    std::optional<double> nextTime();
    /// No state comes after the one that the scene is in.
    bool atEnd() { return !nextTime(); }

    std::uint64_t frames() const { return frames_; }      // states reached by step() and seek()
    std::uint64_t verified() const { return verified_; }  // of these, with the origin's hash
    std::uint64_t gaps() const { return gaps_; }          // times that frames were missing
    /// Frames of states before the one that the scene was in: pieces of a log that stand in another order.
    std::uint64_t framesBehind() const { return behind_; }
    /// Times that step() came to another session and what lies between the two is not known: the last of them says why.
    std::uint64_t unclosedSessions() const { return unclosed_; }
    enum class Seam : std::uint8_t {
        notClosed,     // nothing ended the one before: a replica that joined anew has none, or several states that it
                       // did not get, and its log cannot tell
        goesOn,        // the one before goes on in a piece that does not follow
        beginsBefore,  // the other one begins in a piece that does not come before
    };
    Seam seam() const { return seam_; }
    /// The last set applied: what led to the state the scene is in. After seek() it may be several in one. Has its
    /// `input` where the log has it; in input mode, that only.
    const ChangeSet& lastSet() const { return *set_; }
    /// The first state with another hash than the origin's. The node and field are exact where the log itself can tell:
    /// by running the frame again from its input, or at the next keyframe; else the text says that they are a guess.
    const std::optional<Divergence>& divergence() const { return divergence_; }
    /// Nothing if the log begins where its first session did. How much was let go is known once it has been read.
    std::optional<LaterPiece> laterPiece();
    const LogReader& log() const { return log_; }
    const StreamHead& head() const { return head_; }
    /// What of it this program does not know, and the scene does not have.
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
    void findTurns();
    double shiftAt(std::uint64_t offset) const;
    Result<> lose(std::uint64_t offset, std::uint64_t state, std::string_view why);
    void check(const RecordHeader& header, const ChangeSet& set);
    std::optional<Divergence> compareWithRerun(const RecordHeader& header, const ChangeSet& set) const;
    std::optional<Divergence> compareAtNextKeyframe() const;

    LogReader log_;
    StreamHead head_, first_;  // of the session that it is in, and of the one that the log begins with
    ChangeDecoder decoder_;
    InputDecoder inputDecoder_;
    std::unique_ptr<Scene> scene_;
    std::unique_ptr<InputReplica> runner_;  // in input mode: it computes the frames
    std::shared_ptr<ChangeSet> input_;      // else: what came into the frame that follows in the log
    bool inputsFit_ = false;                // they are of this program's node types
    bool headed_ = false;                   // head_ is of this epoch
    bool lost_ = true;                      // waiting for a keyframe
    bool told_ = false;                     // that frames are missing until then
    bool closed_ = false, goesOn_ = false;  // what the last record was, but for heads: as those of LogReader
    Seam seam_ = Seam::notClosed;
    std::uint64_t frames_ = 0, verified_ = 0, gaps_ = 0, behind_ = 0, unclosed_ = 0;
    double time_ = -std::numeric_limits<double>::infinity();
    double shift_ = 0;  // of time() against the scene's
    /// From this offset on, shift_ is that: where a session begins before the end of the one before it. For seek().
    struct Turn {
        std::uint64_t offset = 0;
        double shift = 0;
    };
    std::optional<std::vector<Turn>> turns_;
    std::optional<Divergence> divergence_;
    std::shared_ptr<ChangeSet> set_ = std::make_shared<ChangeSet>();
};

struct ComparedStates {
    std::uint64_t both = 0, one = 0;    // that both logs hold; that one of them holds alone
    std::array<std::string, 2> damage;  // LogReader::damageText() of each: all states may be there in spite of it
    /// "in every state", or how many those were that could be compared.
    std::string format() const;
};
/// Compares two logs state by state. Nothing when all their common state numbers agree, of which there is at least one,
/// both end with the same, and neither has a hole where the other has states: one may begin later, or have frames
/// merged. `progress` is told the bytes read of `a` and all there are.
Result<std::optional<Divergence>> diffLogs(const std::filesystem::path& a, const std::filesystem::path& b,
                                           const std::function<void(std::uint64_t, std::uint64_t)>& progress = {},
                                           ComparedStates* compared = nullptr);

}  // namespace rtsg
