// LogTable: fields over the states of a log, column by column, and as CSV.
//
// Invariant: all columns have a row for each state that was noted; a row without a value is of a state in which the
// node was not there. Work per state grows with what changed in it, and with the columns. Threading: the scene's.

// Example:
//     #include <rtsg/sync/log_table.h>
//     rtsg::TableOptions options;
//     options.every = 10;
//     const auto table = rtsg::readTable("session.rlog", {"TRAIN.rotation", "DOOR.*"}, options);
//     if (table) table->writeCsv([](std::string_view text) { std::cout << text; });
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include <rtsg/sync/replay.h>

namespace rtsg {

class FieldPatterns;

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
    LogTable(LogTable&&) noexcept;
    LogTable& operator=(LogTable&&) noexcept;
    ~LogTable() override;

    /// To be attached to the bus of a scene that is replayed, or that runs.
    Result<> apply(const Scene& scene, const ChangeSet& changes) override;
    std::string subscriberName() const override { return "table"; }
    /// The state that the scene is in becomes a row.
    void addRow(double time);

    /// Seconds, a row each.
    const std::vector<double>& times() const { return times_; }
    /// In the order of the patterns, then of node numbers and fields.
    std::vector<const Column*> columns() const;
    /// The first pattern that has matched no field; empty: there is none.
    std::string matchedNothing() const;
    /// A line of names, then a line a row (RFC 4180): "time", then one number a column ("DOOR.rotation.x" ...
    /// ".angle"). Numbers are the shortest text that reads back as the same, booleans true and false; texts stand in
    /// quotes, lists as ClassicVRML has them, nodes as numbers, and what there is not is empty.
    void writeCsv(const std::function<void(std::string_view)>& sink) const;

  private:
    LogTable();
    void takeNode(const Scene& scene, NodeId id);
    void addColumn(const Node& node, FieldIndex field, const std::string& name, std::size_t pattern);
    void forget(NodeId id);

    std::unique_ptr<FieldPatterns> patterns_;
    std::vector<double> times_;
    std::vector<Column> columns_;
    std::vector<std::size_t> patternOf_;                      // of each column
    std::unordered_map<std::string, std::size_t> byName_;     // to columns_
    std::unordered_map<std::uint64_t, std::size_t> byField_;  // by node and field, to columns_
};

/// What the numbers of a value are called: x, y, z, angle of SFRotation; empty of a single one, and of lists.
std::vector<std::string> componentNames(FieldType type);

/// Seconds since a log's start: of a scene whose time is that since 1970 to a microsecond, which is what it can tell.
double sinceStart(double time, double start);

struct TableOptions {
    /// Of the states, seconds since the log's start, to a microsecond.
    double from = 0, to = std::numeric_limits<double>::infinity();
    std::uint64_t every = 1;  // state of these
    /// Told bytes read and all there are; false ends it with an error.
    std::function<bool(std::uint64_t, std::uint64_t)> progress{};
};
/// Times count from the log's start. Errors: the log cannot be read; a pattern that no state has a field for;
/// cancelled. `lacks`: where the log first was not whole, if it was not.
Result<LogTable> readTable(const std::filesystem::path& log, const std::vector<std::string>& patterns,
                           const TableOptions& options = {}, std::optional<Divergence>* lacks = nullptr);

}  // namespace rtsg
