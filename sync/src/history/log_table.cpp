// Gathers the values of chosen fields while a log is replayed.
#include <rtsg/sync/log_table.h>

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>
#include <rtsg/sync/log_check.h>

#include "field_patterns.h"

namespace rtsg {

namespace {

std::uint64_t fieldKey(NodeId node, FieldIndex field) {
    return std::uint64_t{node.value} << 16 | field;
}

}  // namespace

LogTable::LogTable() : patterns_(std::make_unique<FieldPatterns>()) {}
LogTable::LogTable(LogTable&&) noexcept = default;
LogTable& LogTable::operator=(LogTable&&) noexcept = default;
LogTable::~LogTable() = default;

Result<LogTable> LogTable::make(const std::vector<std::string>& patterns) {
    auto created = FieldPatterns::make(patterns);
    if (!created) return std::unexpected(created.error());
    LogTable table;
    *table.patterns_ = std::move(*created);
    return table;
}

Result<> LogTable::apply(const Scene& scene, const ChangeSet& changes) {
    if (changes.isSnapshot()) {
        byField_.clear();
        for (Column& column : columns_) column.now.reset();
        scene.forEachNode([&](const Node& node) { takeNode(scene, node.id()); });
        return {};
    }
    for (const Change& change : changes.changes) {
        if (change.kind == ChangeKind::createNode || change.kind == ChangeKind::setName) {
            forget(change.node);
            takeNode(scene, change.node);
        } else if (change.kind == ChangeKind::destroyNode) {
            forget(change.node);
        } else if (change.kind == ChangeKind::setField || change.kind == ChangeKind::insertChild ||
                   change.kind == ChangeKind::removeChild) {
            const auto found = byField_.find(fieldKey(change.node, change.field));
            if (found == byField_.end()) continue;
            const Node* const node = scene.find(change.node);
            if (node) columns_[found->second].now = node->value(change.field);
        }
    }
    return {};
}

void LogTable::takeNode(const Scene& scene, NodeId id) {
    for (const FieldPatterns::Match& match : patterns_->matches(scene, id)) {
        const Node& node = scene.node(id);
        for (FieldIndex field = 0; field < node.type().fieldCount(); ++field) {
            const FieldDef& def = node.type().fields[field];
            if (def.hidden || !def.readable() || !patterns_->matches(match.pattern, def.name)) continue;
            addColumn(node, field, match.name + "." + def.name, match.pattern);
        }
    }
}

void LogTable::addColumn(const Node& node, FieldIndex field, const std::string& name, std::size_t pattern) {
    const auto [found, isNew] = byName_.emplace(name, columns_.size());
    if (isNew) {
        Column column;
        column.name = name;
        column.type = node.type().fields[field].type;
        column.rows.resize(times_.size());
        columns_.push_back(std::move(column));
        patternOf_.push_back(pattern);
    }
    Column& column = columns_[found->second];
    if (column.type != node.type().fields[field].type) return;  // another node has got the name: its values are others
    byField_[fieldKey(node.id(), field)] = found->second;
    column.now = node.value(field);
}

void LogTable::forget(NodeId id) {
    for (auto entry = byField_.begin(); entry != byField_.end();) {
        if (entry->first >> 16 == id.value) {
            columns_[entry->second].now.reset();
            entry = byField_.erase(entry);
        } else {
            ++entry;
        }
    }
}

void LogTable::addRow(double time) {
    times_.push_back(time);
    for (Column& column : columns_) column.rows.push_back(column.now);
}

std::vector<const LogTable::Column*> LogTable::columns() const {
    std::vector<std::size_t> order(columns_.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::ranges::stable_sort(order, {}, [&](std::size_t i) { return patternOf_[i]; });
    std::vector<const Column*> sorted;
    for (const std::size_t i : order) sorted.push_back(&columns_[i]);
    return sorted;
}

std::string LogTable::matchedNothing() const {
    return patterns_->matchedNothing();
}

namespace {

/// A field of CSV in its quotes.
std::string csvQuoted(std::string_view text) {
    std::string result = "\"";
    for (const char c : text) result += c == '"' ? std::string("\"\"") : std::string(1, c);
    return result + '"';
}

template <class T>
void appendNumbers(std::string& line, const void* storage, std::size_t count) {
    const T* number = static_cast<const T*>(storage);
    for (std::size_t i = 0; i < count; ++i) line += fmt::format(",{}", number[i]);
}

void appendCell(std::string& line, FieldType type, const std::optional<Value>& value) {
    const std::size_t count = info(type).components;
    if (!value) {
        line.append(isMF(type) || count == 0 ? 1 : count, ',');
        return;
    }
    if (isMF(type) || type == FieldType::SFImage || type == FieldType::SFCustom) {
        line += "," + csvQuoted(printFieldText(*value));
    } else if (type == FieldType::SFString) {
        line += "," + csvQuoted(value->as<String>());
    } else if (type == FieldType::SFNode) {
        line += value->as<NodeId>() ? fmt::format(",#{}", value->as<NodeId>().value) : ",";
    } else if (type == FieldType::SFBool) {
        line += value->as<bool>() ? ",true" : ",false";
    } else if (type == FieldType::SFInt32) {
        appendNumbers<std::int32_t>(line, value->storage(), count);
    } else if (info(type).elementSize == sizeof(float) * count) {
        appendNumbers<float>(line, value->storage(), count);
    } else {
        appendNumbers<double>(line, value->storage(), count);
    }
}

}  // namespace

std::vector<std::string> componentNames(FieldType type) {
    const std::size_t count = info(type).components;
    if (isMF(type) || count < 2) return {};
    if (type == FieldType::SFRotation) return {"x", "y", "z", "angle"};
    std::vector<std::string> names;
    const bool isColor = type == FieldType::SFColor || type == FieldType::SFColorRGBA;
    for (std::size_t i = 0; i < count; ++i)
        names.push_back(count > 4 ? std::to_string(i) : std::string(1, (isColor ? "rgba" : "xyzw")[i]));
    return names;
}

void LogTable::writeCsv(const std::function<void(std::string_view)>& sink) const {
    const std::vector<const Column*> sorted = columns();
    const auto nameCell = [](const std::string& name) {
        return name.find_first_of(",\"\n\r") == name.npos ? name : csvQuoted(name);
    };
    std::string line = "time";
    for (const Column* const column : sorted) {
        const std::vector<std::string> parts = componentNames(column->type);
        if (parts.empty()) line += "," + nameCell(column->name);
        for (const std::string& part : parts) line += "," + nameCell(column->name + "." + part);
    }
    sink(line += "\n");
    for (std::size_t row = 0; row < times_.size(); ++row) {
        line = fmt::format("{}", times_[row]);
        for (const Column* const column : sorted) appendCell(line, column->type, column->rows[row]);
        sink(line += "\n");
    }
}

double sinceStart(double time, double start) {
    constexpr double kExact = 1e6;  // below, rounding would only lose
    return start < kExact ? time - start : std::round((time - start) * 1e6) / 1e6;
}

Result<LogTable> readTable(const std::filesystem::path& log, const std::vector<std::string>& patterns,
                           const TableOptions& options, std::optional<Divergence>* lacks) {
    constexpr double kSame = 1e-6;  // times since 1970 are exact to a quarter of that
    auto created = LogTable::make(patterns);
    if (!created) return created;
    LogTable& table = *created;
    const auto replayer = Replayer::open(log);
    if (!replayer) return std::unexpected(replayer.error());
    Replayer& inside = **replayer;
    const double start = inside.keyframes().empty() ? 0 : inside.keyframes().front().time;
    const Attachment attachment = inside.scene().bus().attach(table);
    if (options.from > 0)
        if (auto ok = inside.seek(start + options.from - kSame); !ok) return std::unexpected(ok.error());
    LogCheck check(inside);
    bool there = inside.frames() > 0;
    for (std::uint64_t state = 0;;) {
        const double time = sinceStart(inside.time(), start);
        if (there && time > options.to + kSame) break;
        if (there && time >= options.from - kSame && state++ % options.every == 0) table.addRow(time);
        if (options.progress && !options.progress(inside.log().position(), inside.log().size()))
            return fail("cancelled", {}, log.string());
        const auto more = check.step();  // after a state that cannot be had it goes on with the next keyframe
        if (more && !*more) break;
        there = more.has_value();
    }
    if (lacks) {
        *lacks = check.first();
        if (*lacks) (*lacks)->time = sinceStart((*lacks)->time, start);
    }
    if (const std::string none = table.matchedNothing(); !none.empty())
        return fail(DiagnosticCode("no-such-field"), "no state has a field " + none, {}, log.string());
    return created;
}

}  // namespace rtsg
