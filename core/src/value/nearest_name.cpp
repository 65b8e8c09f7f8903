// Finds the name that is nearest to a misspelled one.
#include "nearest_name.h"

#include <algorithm>
#include <array>
#include <cctype>

namespace rtsg::detail {

namespace {

/// Letters to change, add, drop or swap; `most` and one if there are more.
std::size_t distance(std::string_view a, std::string_view b, std::size_t maximum) {
    if ((a.size() > b.size() ? a.size() - b.size() : b.size() - a.size()) > maximum) return maximum + 1;
    std::vector<std::size_t> before(b.size() + 1), above(b.size() + 1), row(b.size() + 1);
    for (std::size_t k = 0; k <= b.size(); ++k) above[k] = k;
    const auto lower = [](char c) { return std::tolower(static_cast<unsigned char>(c)); };
    for (std::size_t i = 1; i <= a.size(); ++i) {
        row[0] = i;
        for (std::size_t k = 1; k <= b.size(); ++k) {
            const std::size_t change = lower(a[i - 1]) != lower(b[k - 1]);
            row[k] = std::min({above[k] + 1, row[k - 1] + 1, above[k - 1] + change});
            if (i > 1 && k > 1 && lower(a[i - 1]) == lower(b[k - 2]) && lower(a[i - 2]) == lower(b[k - 1]))
                row[k] = std::min(row[k], before[k - 2] + 1);
        }
        before.swap(above);
        above.swap(row);
    }
    return above[b.size()];
}

std::string lowerCase(std::string_view word) {
    std::string result(word);
    std::ranges::transform(result, result.begin(),
                           [](char c) { return static_cast<char>(std::tolower(static_cast<unsigned char>(c))); });
    return result;
}

/// Words that other programs, or other nodes, have for the same thing.
constexpr std::array<std::array<std::string_view, 4>, 10> kSameNames = {{
    {{"position", "translation", "location", "center"}},
    {{"rotation", "orientation"}},
    {{"scale", "size", "dimensions"}},
    {{"color", "diffuseColor", "baseColor", "emissiveColor"}},
    {{"transparency", "opacity", "alpha"}},
    {{"cycleInterval", "duration"}},
    {{"on", "enabled", "active", "visible"}},
    {{"string", "text"}},
    {{"height", "length"}},
    {{"url", "href", "src", "file"}},
}};

/// The intended name if the word is no misspelled one: another form of a name (`fraction` for `fraction_changed`,
/// `start` for `startTime`), or another word for it (`position` for `translation`).
std::string_view otherForm(std::string_view word, const std::vector<std::string_view>& known) {
    std::vector<std::string> lowered;
    lowered.reserve(known.size());
    for (const std::string_view one : known) lowered.push_back(lowerCase(one));
    const auto find = [&](const std::string& lower) {
        const auto found = std::ranges::find(lowered, lower);
        return found == lowered.end() ? std::string_view() : known[static_cast<std::size_t>(found - lowered.begin())];
    };
    std::string lower = lowerCase(word);
    if (lower.starts_with("set_")) lower.erase(0, 4);
    if (lower.ends_with("_changed")) lower.resize(lower.size() - 8);
    if (lower.empty()) return {};
    for (const std::string& form : {lower, lower + "_changed", "set_" + lower})
        if (const std::string_view one = find(form); !one.empty()) return one;
    for (const auto& names : kSameNames) {
        if (std::ranges::find(names, lower, lowerCase) == names.end()) continue;
        for (const std::string_view kind : names) {
            if (kind.empty()) continue;
            for (const std::string& form : {lowerCase(kind), lowerCase(kind) + "_changed"})
                if (const std::string_view one = find(form); !one.empty()) return one;
        }
    }
    constexpr std::size_t minimum = 4;  // letters that say enough
    for (std::size_t i = 0; i < known.size() && lower.size() >= minimum; ++i) {
        if (known[i].size() <= lower.size() || !lowered[i].starts_with(lower)) continue;
        const char next = known[i][lower.size()];
        if (next == '_' || std::isupper(static_cast<unsigned char>(next)) || known[i].size() <= 2 * lower.size())
            return known[i];
    }
    return {};
}

}  // namespace

std::string_view nearest(std::string_view word, const std::vector<std::string_view>& known) {
    constexpr std::size_t longest = 60;  // nobody misspells longer names
    if (word.empty() || word.size() > longest) return {};
    constexpr std::size_t maximum = 1000;  // a file may declare any number of them
    if (known.size() > maximum) return nearest(word, {known.begin(), known.begin() + maximum});
    // Affixes that all events have carry no information.
    const std::size_t own = word.size() - (word.starts_with("set_") ? 4 : word.ends_with("_changed") ? 8 : 0);
    std::size_t minimum = std::max<std::size_t>(own / 3, own > 3 ? 2 : 1);
    std::string_view result;
    for (const std::string_view one : known) {
        const std::size_t far = distance(word, one, minimum);
        if (far > minimum || (far == minimum && !result.empty())) continue;
        if (far >= std::min(word.size(), one.size())) continue;  // nothing in common
        minimum = far;
        result = one;
    }
    return result.empty() ? otherForm(word, known) : result;
}

std::string didYouMean(std::string_view word, const std::vector<std::string_view>& known) {
    const std::string_view meant = nearest(word, known);
    return meant.empty() ? std::string() : " (did you mean " + std::string(meant) + "?)";
}

std::string noField(const NodeType& type, std::string_view described, std::string_view field) {
    std::vector<std::string_view> known;
    for (const FieldDef& one : type.fields)
        if (!one.hidden) known.push_back(one.name);
    return std::string(described) + " has no field '" + std::string(field.substr(0, 80)) + "'" +
           didYouMean(field, known);
}

}  // namespace rtsg::detail
