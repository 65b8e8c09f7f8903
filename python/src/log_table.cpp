// Gathers the values of chosen fields while a log is replayed.
#include "log_table.h"

#include <algorithm>

namespace rtsg::python {

namespace {

/// Whether a text is as the pattern says, in which a * stands for any letters.
bool matches(std::string_view pattern, std::string_view text) {
    std::size_t p = 0, t = 0, star = pattern.npos, from = 0;
    while (t < text.size()) {
        if (p < pattern.size() && pattern[p] == '*') {
            star = p++;
            from = t;
        } else if (p < pattern.size() && pattern[p] == text[t]) {
            ++p, ++t;
        } else if (star != pattern.npos) {
            p = star + 1;
            t = ++from;
        } else {
            return false;
        }
    }
    return pattern.find_first_not_of('*', p) == pattern.npos;
}

/// With the names of the scopes around it in front; empty: it, or one of them, has none.
std::string pathOf(const Scene& scene, NodeId id) {
    std::string path;
    for (const Node* node = scene.find(id); node; node = scene.find(node->scope())) {
        const std::string_view name = scene.name(node->id());
        if (name.empty()) return {};
        path = path.empty() ? std::string(name) : std::string(name) + "/" + path;
    }
    return path;
}

std::uint64_t keyOf(NodeId node, FieldIndex field) {
    return std::uint64_t{node.value} << 16 | field;
}

}  // namespace

Result<LogTable> LogTable::make(const std::vector<std::string>& patterns) {
    LogTable table;
    for (const std::string& pattern : patterns) {
        const std::size_t dot = pattern.rfind('.');
        if (dot == pattern.npos || dot == 0 || dot + 1 == pattern.size())
            return fail(DiagnosticCode("no-such-field"), pattern + ": expected NODE.field");
        table.patterns_.push_back({pattern.substr(0, dot), pattern.substr(dot + 1)});
    }
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
            const auto found = byField_.find(keyOf(change.node, change.field));
            if (found == byField_.end()) continue;
            const Node* const node = scene.find(change.node);
            if (node) columns_[found->second].now = node->value(change.field);
        }
    }
    return {};
}

void LogTable::takeNode(const Scene& scene, NodeId id) {
    const Node* const node = scene.find(id);
    if (!node || node->type().internal) return;
    const std::string path = pathOf(scene, id), number = "#" + std::to_string(id.value);
    for (std::size_t p = 0; p < patterns_.size(); ++p) {
        const Pattern& pattern = patterns_[p];
        const bool byNumber = pattern.node == number;
        if (!byNumber && (path.empty() || !matches(pattern.node, path))) continue;
        for (FieldIndex field = 0; field < node->type().fieldCount(); ++field) {
            const FieldDef& def = node->type().fields[field];
            if (def.hidden || !def.readable() || !matches(pattern.field, def.name)) continue;
            addColumn(*node, field, (byNumber ? number : path) + "." + def.name, p);
        }
    }
}

void LogTable::addColumn(const Node& node, FieldIndex field, const std::string& name, std::size_t pattern) {
    const auto [found, isNew] = byName_.emplace(name, columns_.size());
    patterns_[pattern].matched = true;
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
    byField_[keyOf(node.id(), field)] = found->second;
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
    for (const Pattern& pattern : patterns_)
        if (!pattern.matched) return pattern.node + "." + pattern.field;
    return {};
}

}  // namespace rtsg::python
