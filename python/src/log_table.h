// LogTable: fields over the states of a log, column by column.
//
// Invariant: all columns have a row for each state that was noted; a row without a value is of a state in which the
// node was not there. Work per state grows with what changed in it, and with the columns. Threading: the scene's.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include <rtsg/core/scene.h>

namespace rtsg::python {

class LogTable final : public Subscriber {
  public:
    struct Column {
        std::string name;  // "NODE.field", with the names of scopes in front
        FieldType type = FieldType::SFBool;
        std::vector<std::optional<Value>> rows;
        std::optional<Value> now;
    };
    /// "DOOR.rotation", "DOOR.*", "*.rotation", "#12.translation"; a * stands for any letters. Errors: a pattern that
    /// is no NODE.field.
    static Result<LogTable> make(const std::vector<std::string>& patterns);

    /// To be attached to the bus of the scene that is replayed.
    Result<> apply(const Scene& scene, const ChangeSet& changes) override;
    std::string subscriberName() const override { return "table"; }
    /// The state that the scene is in becomes a row.
    void addRow(double time);

    const std::vector<double>& times() const { return times_; }
    /// In the order of the patterns, then of node numbers and fields.
    std::vector<const Column*> columns() const;
    /// The first pattern that has matched no field; empty: there is none.
    std::string matchedNothing() const;

  private:
    struct Pattern {
        std::string node, field;
        bool matched = false;
    };
    void takeNode(const Scene& scene, NodeId id);
    void addColumn(const Node& node, FieldIndex field, const std::string& name, std::size_t pattern);
    void forget(NodeId id);

    std::vector<Pattern> patterns_;
    std::vector<double> times_;
    std::vector<Column> columns_;
    std::vector<std::size_t> patternOf_;                      // of each column
    std::unordered_map<std::string, std::size_t> byName_;     // to columns_
    std::unordered_map<std::uint64_t, std::size_t> byField_;  // by node and field, to columns_
};

}  // namespace rtsg::python
