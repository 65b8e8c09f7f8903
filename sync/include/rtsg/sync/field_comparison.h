// FieldComparison: compares chosen fields of two scenes that run side by side, within a tolerance. It compares what a
// scene does rather than what its document says.
//
// Invariant: nodes are paired by their DEF names, with those of the scopes around them in front ("LEAF/HINGE"), and
// fields by their names. So an edit elsewhere in the document changes nothing. The work for a state grows with what
// changed in it.
// Threading: that of both scenes.

// Example:
//     #include <rtsg/sync/field_comparison.h>
//     rtsg::Scene recorded, now;  // each runs its frames beside the other
//     rtsg::FieldComparison doors({{"DOOR.*"}, {"initial"}, 1e-4}, recorded, now, {"recorded", "now"});
//     doors.first();
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <rtsg/sync/replay.h>

namespace rtsg {

struct FieldSelection {
    /// "HOOK.translation", "DOOR.*" or "*.rotation"; a * stands for any letters. Empty: all fields of all named nodes.
    std::vector<std::string> fields;
    /// Patterns of fields to leave out. The word "initial" leaves out what has not changed since the first state in
    /// either scene, so that only what happens counts.
    std::vector<std::string> ignore;
    /// The largest difference allowed in any component: absolute for numbers, seconds and metres; for rotations the
    /// angle between them in radians.
    double tolerance = 0;

    /// True if anything was chosen. If not, states are compared as a whole.
    bool any() const { return !fields.empty() || !ignore.empty() || tolerance > 0; }
    /// Error: the first pattern that is not NODE.field, or a tolerance that is negative or not finite.
    Result<> check() const;
};

/// A field that differed, with the first state in which it did.
struct FieldDifference {
    std::string node, field;            // as DEF names; with scopes "OUTER/INNER"
    std::uint64_t frame = 0, last = 0;  // first and last state in which it differed, numbers of the first scene
    double time = 0;                    // of `frame`, seconds
    std::uint64_t states = 0;           // number of states in which it differed
    double largest = 0;                 // infinite for values that are not numbers or differ in length
    std::string text;                   // both values at `frame`
    std::string cause;                  // the routes that led to it, or that it was set from outside; empty if unknown
};

/// The values of one field over time, up to four components, for charts.
struct FieldHistory {
    struct Sample {
        double time = 0;
        std::array<float, 4> a{}, b{};
    };
    std::string node, field;
    int components = 0;
    std::vector<Sample> samples;
};

/// The largest difference of components: 0 for equal values, infinite where no number can say it. For rotations it is
/// the angle between them in radians. Precondition: neither is SFNode or MFNode.
double valueDistance(const Value& a, const Value& b);

class FieldComparison {
  public:
    /// Which fields are compared: those of the first scene, which is the reference; or those that either scene has.
    enum class Fields : std::uint8_t { ofFirst, ofEither };

    /// Precondition: selection.check() succeeds. Both scenes must outlive this.
    FieldComparison(FieldSelection selection, const Scene& a, const Scene& b, DifferenceWords words = {},
                    Fields whose = Fields::ofFirst);
    ~FieldComparison();

    /// Compares the present states of both scenes as a whole. True if all chosen fields agree.
    bool first();
    /// Tell it each change set of a scene since the last comparison.
    void changedA(const ChangeSet& set);
    void changedB(const ChangeSet& set);
    /// Compares what has changed. True if all chosen fields agree in this state.
    bool compare();

    /// The differences, in the order in which they began.
    const std::vector<FieldDifference>& differences() const;
    /// The values of the fields that differed and are numeric: at most 64 fields and 4096 samples each.
    std::vector<FieldHistory> histories() const;
    /// Why nothing was compared: a pattern matches none of the compared fields, or all that was chosen is also ignored.
    /// Empty if something was compared.
    std::string nothingCompared() const;
    /// Patterns to ignore that match nothing: they were misspelled, or their nodes are gone.
    std::vector<std::string> ignoredInVain() const;
    /// Number of fields compared.
    std::size_t fieldCount() const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

/// The differences of two logs, in fields that either has. Logs of one session are compared by state number and time,
/// even if one begins later; other logs by the time since their start.
struct LogFieldReport {
    std::vector<FieldDifference> differences;  // frames and times are those of `a`
    std::uint64_t states = 0;                  // number of states compared
    std::size_t fields = 0;
    std::vector<std::string> ignoredInVain;
    double end = 0;                     // end of the time that both logs hold, seconds since the start
    std::string unequalEnds;            // says which log ends earlier, if it does by more than a microsecond
    std::array<std::string, 2> damage;  // LogReader::damageText() of each; no state is missing because of it
};
/// Errors: as Replayer; a log with gaps; a pattern that matches nothing.
Result<LogFieldReport> diffLogFields(const std::filesystem::path& a, const std::filesystem::path& b,
                                     const FieldSelection& selection);

/// The differences of two documents, at most `most`. Named nodes are paired by name, others by position and type, so
/// one additional node does not make all later ones differ. `node` is a DEF name or a path from one:
/// "DOOR.children[1].geometry".
std::vector<Divergence> sceneDifferences(const Scene& a, const Scene& b, std::size_t maximum = SIZE_MAX,
                                         DifferenceWords words = {});

}  // namespace rtsg
