// Finds what patterns name by the names that nodes have in a scene.
#include "field_patterns.h"

#include <fmt/format.h>

namespace rtsg {

namespace {

/// Whether a text is as the pattern says, in which a * stands for any letters.
bool matchesPattern(std::string_view pattern, std::string_view text) {
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

}  // namespace

std::string scopedName(const Scene& scene, NodeId id) {
    std::string path;
    for (const Node* node = scene.find(id); node; node = scene.find(node->scope())) {
        const std::string_view name = scene.name(node->id());
        if (name.empty()) return {};
        path.insert(0, path.empty() ? std::string(name) : fmt::format("{}/", name));
    }
    return path;
}

Result<FieldPatterns> FieldPatterns::make(const std::vector<std::string>& patterns) {
    FieldPatterns created;
    for (const std::string& pattern : patterns) {
        const std::size_t dot = pattern.rfind('.');
        if (dot == pattern.npos || dot == 0 || dot + 1 == pattern.size())
            return fail(DiagnosticCode("no-such-field"), pattern + ": expected NODE.field");
        created.patterns_.push_back({pattern.substr(0, dot), pattern.substr(dot + 1)});
    }
    return created;
}

std::vector<FieldPatterns::Match> FieldPatterns::matches(const Scene& scene, NodeId id) const {
    std::vector<Match> found;
    const Node* const node = scene.find(id);
    if (!node || node->type().internal) return found;
    const std::string path = scopedName(scene, id), number = "#" + std::to_string(id.value);
    for (std::size_t p = 0; p < patterns_.size(); ++p) {
        if (patterns_[p].node == number)
            found.push_back({p, number});
        else if (!path.empty() && matchesPattern(patterns_[p].node, path))
            found.push_back({p, path});
    }
    return found;
}

bool FieldPatterns::matches(std::size_t pattern, std::string_view field) {
    if (!matchesPattern(patterns_[pattern].field, field)) return false;
    patterns_[pattern].matched = true;
    return true;
}

std::string FieldPatterns::matchedNothing() const {
    for (const Pattern& pattern : patterns_)
        if (!pattern.matched) return pattern.node + "." + pattern.field;
    return {};
}

}  // namespace rtsg
