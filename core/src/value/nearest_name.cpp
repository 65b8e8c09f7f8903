// Finds the name that is nearest to a misspelled one.
#include "nearest_name.h"

#include <algorithm>
#include <cctype>

namespace rtsg::detail {

namespace {

/// Letters to change, add, drop or swap; `most` and one if there are more.
std::size_t distance(std::string_view a, std::string_view b, std::size_t most) {
    if ((a.size() > b.size() ? a.size() - b.size() : b.size() - a.size()) > most) return most + 1;
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

}  // namespace

std::string_view nearest(std::string_view word, const std::vector<std::string_view>& known) {
    constexpr std::size_t longest = 60;  // nobody misspells longer names
    if (word.empty() || word.size() > longest) return {};
    std::size_t least = std::max<std::size_t>(word.size() / 3, word.size() > 3 ? 2 : 1);
    std::string_view result;
    for (const std::string_view one : known) {
        const std::size_t far = distance(word, one, least);
        if (far > least || (far == least && !result.empty())) continue;
        if (far >= std::min(word.size(), one.size())) continue;  // nothing in common
        least = far;
        result = one;
    }
    return result;
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
