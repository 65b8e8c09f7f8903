// The filters that `rtsg convert --filter` names: each passes a document's commands on, changed.
#include <rtsg/documents/filters.h>

#include <algorithm>
#include <charconv>
#include <vector>

#include "check/validated_node.h"
#include "commands/suggestion.h"
#include "filter_parts.h"

namespace rtsg {

namespace {

constexpr FilterInfo kFilters[] = {
    {"drop-comments", "", "leaves out comments and remarks on declarations"},
    {"drop-defaults", "", "leaves out values that are their fields' defaults"},
    {"drop-metadata", "", "leaves out metadata nodes, WorldInfo and META"},
    {"drop-names", "", "leaves out names that nothing refers to"},
    {"drop-scripts", "", "leaves out Scripts and the routes to and from them"},
    {"embed", "", "Inlines and InlineGeometry become what they name; on by itself for robots (URDF)"},
    {"flatten-inlines", "", "Inlines become Groups with their content"},
    {"flatten-protos", "", "instances of prototypes become the nodes of their bodies"},
    {"flatten-transforms", "", "Transforms that nothing moves go into the coordinates below them"},
    {"index", "", "equal points, colours, normals and texture coordinates become one; triangles get indices"},
    {"portable", "", "materials with metadata of mirrors and glass become portable ones; flatten-protos undoes it"},
    {"quantise", "E", "numbers become the shortest decimals with an error of at most E; rotations and times stay"},
    {"rename", "OLD:NEW,...", "renames DEFs"},
    {"select", "NAME,...", "keeps the nodes with this DEF or of this type, with all nodes inside"},
    {"share", "", "equal nodes become one node that is used several times"},
    {"short-names", "", "renames DEFs to n1, n2, ... (imported and exported names stay)"},
    {"statistics", "", "reports the content of the document"},
    {"units", "CATEGORY:FACTOR,...", "puts values into other units; without an argument, into the standard's"},
    {"validate", "", "reports problems of the document as a whole"},
};

Result<double> numberIn(std::string_view text) {
    double number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error != std::errc() || end != text.data() + text.size() || !(number >= 0))
        return fail("quantise=E takes the largest error, a number that is not negative, not '" + std::string(text) +
                    "'");
    return number;
}

}  // namespace

Result<std::unique_ptr<DocumentHandler>> makeFilter(std::string_view name, DocumentHandler& next,
                                                    const FilterContext& context) {
    using namespace detail;
    const std::size_t equals = std::min(name.find('='), name.size());
    const std::string_view argument = name.substr(std::min(equals + 1, name.size()));
    const bool hasArgument = equals < name.size();
    name = name.substr(0, equals);
    const auto info = std::ranges::find(kFilters, name, &FilterInfo::name);
    if (info == std::end(kFilters)) {
        std::vector<std::string_view> known;
        for (const FilterInfo& one : kFilters) known.push_back(one.name);
        return fail("there is no filter " + std::string(name) + didYouMean(name, known));
    }
    const bool needs = !info->argument.empty() && name != "units";
    if (hasArgument ? info->argument.empty() : needs)
        return fail(hasArgument ? "filter " + std::string(name) + " takes no argument"
                                : "filter " + std::string(name) + " is written " + std::string(name) + "=" +
                                      std::string(info->argument));
    if (name.starts_with("drop-")) return makeDropFilter(name.substr(5), next);
    if (name == "embed") return makeEmbed(next, context);
    if (name == "flatten-inlines") return makeFlattenInlines(next, context);
    if (name == "flatten-protos") return makeFlattenProtos(next, context);
    if (name == "flatten-transforms") return makeFlattenTransforms(next);
    if (name == "index") return makeIndex(next);
    if (name == "portable") return makePortable(next, context.diagnostics);
    if (name == "rename") return makeRename(argument, next, context.diagnostics);
    if (name == "select") return makeSelect(argument, next, context.diagnostics);
    if (name == "share") return makeShareNodes(next);
    if (name == "short-names") return makeShortNames(next);
    if (name == "statistics") return makeStatistics(next, context.diagnostics);
    if (name == "units") return makeUnits(argument, next);
    if (name == "validate") return makeValidate(next, context.diagnostics, context.scripts, context.dialect);
    const Result<double> error = numberIn(argument);
    if (!error) return std::unexpected(error.error());
    return makeQuantise(*error, next);
}

std::span<const FilterInfo> filters() {
    return kFilters;
}

}  // namespace rtsg
