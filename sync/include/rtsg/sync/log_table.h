// LogTable: the values of fields over the states of a log, as columns and as CSV.
//
// Invariant: each column has one row for each state that was added; a row is empty if the node did not exist in that
// state. The work for a state grows with its changes and with the columns. Threading: the scene's thread.

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
    /// `patterns` are "DOOR.rotation", "DOOR.*", "*.rotation" or "#12.translation"; a * stands for any letters. Errors:
    /// a pattern that is no NODE.field.
    static Result<LogTable> make(const std::vector<std::string>& patterns);
    LogTable(LogTable&&) noexcept;
    LogTable& operator=(LogTable&&) noexcept;
    ~LogTable() override;

    /// Attach it to the bus of a scene that is replayed, or that runs.
    Result<> apply(const Scene& scene, const ChangeSet& changes) override;
    std::string subscriberName() const override { return "table"; }
    /// Adds the scene's present state as a row.
    void addRow(double time);

    /// The time of each row, in seconds.
    const std::vector<double>& times() const { return times_; }
    /// The columns in the order of the patterns, then by node number and field.
    std::vector<const Column*> columns() const;
    /// The first pattern that has matched no field; empty if all have matched.
    std::string matchedNothing() const;
    /// Writes a line of names, then a line for each row (RFC 4180): "time", then one number in each column
    /// ("DOOR.rotation.x" ... ".angle"). Numbers are the shortest text that reads back as the same number, booleans are
    /// true and false, texts stand in quotes, lists are in ClassicVRML, nodes are numbers, and missing values are
    /// empty.
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

/// The names of the components of a value: x, y, z, angle for SFRotation; none for single numbers and for lists.
std::vector<std::string> componentNames(FieldType type);

/// Seconds since a log's start. If scene times count from 1970, the result is rounded to a microsecond, the precision
/// that such times have.
double sinceStart(double time, double start);

struct TableOptions {
    /// The range of states, in seconds since the log's start, to a microsecond.
    double from = 0, to = std::numeric_limits<double>::infinity();
    std::uint64_t every = 1;  // uses only every Nth state
    /// Called with the bytes read and their total; if it returns false, reading ends with an error.
    std::function<bool(std::uint64_t, std::uint64_t)> progress{};
};
/// Times count from the log's start. Errors: the log cannot be read; a pattern matches no field in any state;
/// cancelled. `lacks` gets the first place where the log is incomplete, if there is one.
Result<LogTable> readTable(const std::filesystem::path& log, const std::vector<std::string>& patterns,
                           const TableOptions& options = {}, std::optional<Divergence>* lacks = nullptr);

}  // namespace rtsg
