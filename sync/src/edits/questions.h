// Questions: find where two scenes differ by comparing hashes, and repair it (PROTOCOL.md, "Differences").
//
// Invariant: an answer has at most kLongestAnswer bytes, however large the scene. From a scene of n nodes to one node
// takes log256(n) questions. An answer is about one state, which it names.
// Threading: the thread of the scene that is asked or compared.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <rtsg/core/hash_terms.h>
#include <rtsg/core/scene.h>
#include <rtsg/sync/replay.h>

#include "sockets/message.h"

namespace rtsg::mirror {

constexpr unsigned kFanOutBits = 8;     // a range is answered in 256 parts
constexpr std::size_t kMaxRanges = 16;  // in one question
constexpr std::size_t kMaxNodes = 64;   // inspected at once; if more differ, a snapshot is sent
constexpr std::size_t kMaxWants = 512;  // parts of nodes sent again at once
constexpr std::size_t kLongestAnswer = std::size_t{128} << 10;

/// The 2^bits node numbers from `first` on.
struct NodeRange {
    std::uint32_t first = 0;
    unsigned bits = 0;
};

/// A part of a node that can be sent again: a field, or one of these.
using NodePart = std::uint32_t;
constexpr NodePart kNamePart = 0x10000, kRoutesPart = 0x10001, kWholeNode = 0x10002;

/// The smallest range from 0 that holds all node numbers.
NodeRange wholeRange(const Scene& scene);
/// Sums of hashOfNode() over equal parts of the range: 256 parts, or as many as it has numbers.
std::vector<Hash128> partialSums(const Scene& scene, NodeRange range);

// ---- asking (`out` becomes a whole message) ----------------------------------------------------------------------
/// Without ranges it asks about the whole scene.
void askDoubt(ByteBuffer& out, std::uint64_t session, std::span<const NodeRange> ranges);

// ---- answering: `in` stands behind the session; false when the question is malformed -------------------------------
bool answerDoubt(const Scene& scene, std::uint64_t session, wire::Reader& in, ByteBuffer& out);
bool answerInspect(const Scene& scene, std::uint64_t session, wire::Reader& in, ByteBuffer& out);
/// Makes a set from the scene's state to itself that has the wanted parts.
bool answerWant(const Scene& scene, wire::Reader& in, ChangeSet& out);

/// The asking side: goes from "the hashes differ" to the nodes and fields that differ, and to the set that repairs
/// them.
class Bisection {
  public:
    enum class Step : std::uint8_t {
        ask,        // send `question`
        same,       // everything compared is the same
        hopeless,   // too much differs, or it cannot be repaired: a snapshot is needed
        malformed,  // the answer made no sense
    };
    /// Begins with these ranges; with none it compares everything.
    void begin(std::uint64_t session, std::vector<NodeRange> ranges, ByteBuffer& question);
    bool running() const { return running_; }
    void stop() { running_ = false; }
    unsigned questions() const { return questions_; }

    /// Take an answer about the state that `replica` is in. `in` stands behind session and state.
    Step digest(const Scene& replica, wire::Reader& in, ByteBuffer& question);
    Step anatomy(const Scene& replica, wire::Reader& in, ByteBuffer& question);
    /// Adds to the answer to `want` what only this side knows: routes and nodes that must go.
    void complete(const Scene& replica, ChangeSet& set) const;
    /// The differences found, with names.
    const std::vector<Divergence>& found() const { return found_; }

  private:
    void differs(const Scene& replica, NodeId node, std::string field, std::string text);

    std::uint64_t session_ = 0;
    bool running_ = false;
    unsigned questions_ = 0;
    std::vector<NodeRange> asked_;
    std::vector<NodeId> suspects_, extra_, routes_;
    std::vector<Divergence> found_;
};

}  // namespace rtsg::mirror
