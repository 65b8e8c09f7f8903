// FieldComparison: two scenes that run side by side, compared in chosen fields, within a tolerance: what a scene does
// rather than what its document says.
//
// Invariant: nodes are paired by their DEF names (those of the scopes around them in front, "LEAF/HINGE"), fields by
// theirs, so an edit of the document elsewhere changes nothing. Work per state grows with what changed in it.
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
    /// "HOOK.translation", "DOOR.*", "*.rotation"; a * stands for any letters. Empty: all fields of all named nodes.
    std::vector<std::string> fields;
    /// As `fields`, and of these left out. The word "initial" leaves out what has not changed since the first state in
    /// either scene, so that only what happens counts.
    std::vector<std::string> ignore;
    /// Largest difference allowed in any component: of numbers, seconds and metres absolute, of rotations the angle
    /// between them, radians.
    double tolerance = 0;

    /// Whether anything was chosen at all; else states are compared as a whole.
    bool any() const { return !fields.empty() || !ignore.empty() || tolerance > 0; }
    /// The first pattern that is no NODE.field, or a tolerance that is no number from 0 up.
    Result<> check() const;
};

/// A field that was not the same in both scenes, from the first state in which it was not.
struct FieldDifference {
    std::string node, field;            // as DEF names; with scopes "OUTER/INNER"
    std::uint64_t frame = 0, last = 0;  // first and last state in which it differed, numbers of the first scene
    double time = 0;                    // of `frame`, seconds
    std::uint64_t states = 0;           // in how many it differed
    double largest = 0;                 // infinite where the values are no numbers, or not as many
    std::string text;                   // both values at `frame`
    std::string cause;                  // the routes that led to it, or that it was set from outside; empty: not known
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

/// The largest difference of components: 0 for equal values, infinite for those that cannot be told apart by a number.
/// Rotations: the angle between them, radians. Precondition: neither is SFNode or MFNode.
double valueDistance(const Value& a, const Value& b);

class FieldComparison {
  public:
    /// Whose fields are compared: those of the first scene, which says how the second one is to be; or those that
    /// either has, whichever is first.
    enum class Fields : std::uint8_t { ofFirst, ofEither };

    /// Precondition: selection.check() is good. Both scenes outlive this.
    FieldComparison(FieldSelection selection, const Scene& a, const Scene& b, DifferenceWords words = {},
                    Fields whose = Fields::ofFirst);
    ~FieldComparison();

    /// Compares the states that both scenes are in, whole. True if all that was chosen agrees.
    bool first();
    /// What has happened in a scene since the last comparison, set by set.
    void changedA(const ChangeSet& set);
    void changedB(const ChangeSet& set);
    /// Compares what has changed. True if all that was chosen agrees in this state.
    bool compare();

    /// In the order in which they began.
    const std::vector<FieldDifference>& differences() const;
    /// Of the fields that differed, as far as they are numbers: at most 64 fields and 4096 samples each.
    std::vector<FieldHistory> histories() const;
    /// Why the comparison says nothing: a pattern that none of the fields has matched that are compared, or all that
    /// was chosen is ignored. Empty if there was something to compare.
    std::string nothingCompared() const;
    /// What was to be ignored and is not there: patterns that were misspelled, or of nodes that are gone.
    std::vector<std::string> ignoredInVain() const;
    /// Fields that were looked at.
    std::size_t fieldCount() const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

/// What two logs differ in, by fields that either has: of one session, though one log begins later, states of the same
/// numbers and times are compared, else those of the same times since the logs' starts.
struct LogFieldReport {
    std::vector<FieldDifference> differences;  // frames and times are those of `a`
    std::uint64_t states = 0;                  // compared
    std::size_t fields = 0;
    std::vector<std::string> ignoredInVain;
    double end = 0;                     // of what both hold, seconds since the start
    std::string unequalEnds;            // which one ends before the other, if one does by more than a microsecond
    std::array<std::string, 2> damage;  // LogReader::damageText() of each: no state is missing in spite of it
};
/// Errors: as Replayer; a log that has gaps; a pattern that matches nothing.
Result<LogFieldReport> diffLogFields(const std::filesystem::path& a, const std::filesystem::path& b,
                                     const FieldSelection& selection);

/// What two documents differ in, from their roots down: named nodes are paired by their names, others by their places
/// and types, so that one more node does not make all that follow it differ. At most `most`.
/// `node` is a DEF name, or the way from one: "DOOR.children[1].geometry".
std::vector<Divergence> sceneDifferences(const Scene& a, const Scene& b, std::size_t most = SIZE_MAX,
                                         DifferenceWords words = {});

}  // namespace rtsg
